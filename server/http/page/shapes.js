// The shapes of cells, and where the nodes of a cell lie: Gmsh's order, as core/reference/lattice.cpp has it. Positions are
// whole numbers from 0 to the order.

const TRIANGLE = 3;
const QUADRILATERAL = 4;

/** By the numbers of Shape in the contract. An edge or face is a list of vertices; `places`: of the vertices, in units of the order. */
const SHAPES = {
  2: {name: 'line', dimension: 1, places: [[0, 0, 0], [1, 0, 0]], edges: [], faces: []},
  [TRIANGLE]: {name: 'triangle', dimension: 2, places: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], edges: [[0, 1], [1, 2], [2, 0]], faces: []},
  [QUADRILATERAL]: {name: 'quadrilateral', dimension: 2, places: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    edges: [[0, 1], [1, 2], [2, 3], [3, 0]], faces: []},
  5: {name: 'tetrahedron', dimension: 3, places: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    edges: [[0, 1], [1, 2], [2, 0], [3, 0], [3, 2], [3, 1]], faces: [[0, 2, 1], [0, 1, 3], [0, 3, 2], [3, 1, 2]]},
  // The layers of a pyramid shrink towards their first corner.
  6: {name: 'pyramid', dimension: 3, places: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]],
    edges: [[0, 1], [0, 3], [0, 4], [1, 2], [1, 4], [2, 3], [2, 4], [3, 4]],
    faces: [[0, 1, 4], [3, 0, 4], [1, 2, 4], [2, 3, 4], [0, 3, 2, 1]]},
  7: {name: 'prism', dimension: 3, places: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    edges: [[0, 1], [0, 2], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [3, 5], [4, 5]],
    faces: [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [0, 3, 5, 2], [1, 2, 5, 4]]},
  8: {name: 'hexahedron', dimension: 3,
    places: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    edges: [[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]],
    faces: [[0, 3, 2, 1], [0, 1, 5, 4], [0, 4, 7, 3], [1, 2, 6, 5], [2, 3, 7, 6], [4, 5, 6, 7]]},
};

/** The sides of a cell: the edges of a face, the faces of a volume. */
function sidesOf(shape) {
  return SHAPES[shape].dimension === 2 ? SHAPES[shape].edges : SHAPES[shape].faces;
}

/** The position of (i, j) in the lattice of a side: i towards its second vertex, j towards its last one. */
function onSide(shape, order, side, i, j) {
  const {places} = SHAPES[shape];
  const [origin, first, last] = [places[side[0]], places[side[1]], places[side.at(-1)]];
  return origin.map((at, d) => order * at + (first[d] - at) * i + (side.length > 2 ? (last[d] - at) * j : 0));
}

/** The positions strictly inside a shape. */
function insideOf(shape, order) {
  if (shape === 2) return Array.from({length: Math.max(0, order - 1)}, (_, i) => [i + 1, 0, 0]);
  if (shape === 7) {
    if (order < 3) return [];
    return latticeOf(TRIANGLE, order - 3).flatMap(([i, j]) => latticeOf(2, order - 2).map(([k]) => [i + 1, j + 1, k + 1]));
  }
  const smaller = order - {3: 3, 4: 2, 5: 4, 6: 3, 8: 2}[shape];
  if (smaller < 0) return [];
  return latticeOf(shape, smaller).map((at) => at.map((value, d) => value + (d < SHAPES[shape].dimension ? 1 : 0)));
}

const knownLattices = new Map();

/** The positions of all nodes of a cell, in their order. */
function latticeOf(shape, order) {
  const key = 100 * shape + order;
  if (!knownLattices.has(key)) knownLattices.set(key, makeLattice(shape, order));
  return knownLattices.get(key);
}

function makeLattice(shape, order) {
  if (order === 0) return [[0, 0, 0]];
  const {dimension, places, edges, faces} = SHAPES[shape];
  const all = places.map((at) => at.map((value) => order * value));
  for (const edge of edges) for (let i = 1; i < order; ++i) all.push(onSide(shape, order, edge, i, 0));
  for (const face of dimension === 3 ? faces : []) {
    for (const [i, j] of insideOf(face.length, order)) all.push(onSide(shape, order, face, i, j));
  }
  return [...all, ...insideOf(shape, order)];
}

const knownSides = new Map();

/** Of each side, the numbers of its nodes in the cell, row by row: i runs fastest. */
function sideNodes(shape, order) {
  const key = 100 * shape + order;
  if (!knownSides.has(key)) knownSides.set(key, findSideNodes(shape, order));
  return knownSides.get(key);
}

function findSideNodes(shape, order) {
  const number = new Map(latticeOf(shape, order).map((at, node) => [at.join(), node]));
  return sidesOf(shape).map((side) => {
    const nodes = [];
    for (let j = 0; j <= (side.length > 2 ? order : 0); ++j) {
      for (let i = 0; i <= (side.length === TRIANGLE ? order - j : order); ++i) nodes.push(number.get(onSide(shape, order, side, i, j).join()));
    }
    return nodes;
  });
}

/** The factor of a Lagrange polynomial on equal steps that is 1 at `node` and 0 at the nodes before it; `at` is from 0 to 1. */
function risingFactor(order, node, at) {
  let value = 1;
  for (let m = 0; m < node; ++m) value *= (order * at - m) / (node - m);
  return value;
}

/** For each point of a face's lattice with this many intervals, the weights of the face's nodes; both row by row. */
function faceWeights(corners, order, intervals) {
  const rows = [];
  const forEach = (steps, visit) => {
    for (let j = 0; j <= steps; ++j) for (let i = 0; i <= (corners === TRIANGLE ? steps - j : steps); ++i) visit(i, j);
  };
  forEach(intervals, (a, b) => {
    const [x, y] = [a / intervals, b / intervals];
    const row = [];
    forEach(order, (i, j) => {
      const along = risingFactor(order, i, x) * risingFactor(order, j, y);
      row.push(corners === TRIANGLE ? along * risingFactor(order, order - i - j, 1 - x - y) :
        along * risingFactor(order, order - i, 1 - x) * risingFactor(order, order - j, 1 - y));
    });
    rows.push(row);
  });
  return rows;
}
