// The part of a scene for 2-D: each edge once, as cubic Bézier curves.

/** Up to order 3, one cubic curve is exact. Beyond, each curve has the values and tangents of the edge at its ends. */
const piecesOf = (order) => (order <= 3 ? 1 : Math.floor((order + 1) / 2));

/** The weights of the nodes of an edge (from end to end) for its value and its slope at `at`, from 0 to 1. */
function edgeWeights(order, at) {
  const steps = Array.from({length: order + 1}, (_, i) => i / order);
  const factor = (i, skip) => steps.reduce((value, step, k) => (k === i || k === skip ? value : value * (at - step) / (steps[i] - step)), 1);
  return {
    values: steps.map((_, i) => factor(i, -1)),
    slopes: steps.map((step, i) => steps.reduce((sum, other, m) => (m === i ? sum : sum + factor(i, m) / (step - other)), 0)),
  };
}

/** The rows of weights that turn the nodes of an edge into the control points of its curves between its ends. */
function controlWeights(order) {
  const pieces = piecesOf(order);
  const third = 1 / pieces / 3;
  const rows = [];
  for (let k = 0; k <= pieces; ++k) {
    const {values, slopes} = edgeWeights(order, k / pieces);
    if (k > 0) rows.push(values.map((value, i) => value - third * slopes[i]));
    if (k > 0 && k < pieces) rows.push(values);
    if (k < pieces) rows.push(values.map((value, i) => value + third * slopes[i]));
  }
  return rows;
}

/** Finds the edges and vertices, and adds the arrays that say how the cells are made of them. Returns [{cell, nodes}] and [[cell, corner]]. */
function findEdges(cells, arrays) {
  const {first, opposite} = joinSides(cells);
  const edgeOf = new Int32Array(opposite.length).fill(-1);
  const vertexOf = new Map();
  const [edges, vertices, ends] = [[], [], []];
  const cellEdges = new Int32Array(opposite.length);
  const vertex = (cell, corner) => {
    const node = cells.node(cell, corner);
    if (!vertexOf.has(node)) {
      vertexOf.set(node, vertices.length);
      vertices.push([cell, corner]);
    }
    return vertexOf.get(node);
  };
  for (let cell = 0; cell < cells.count; ++cell) {
    const lists = sideNodes(cells.shapes[cell], cells.mesh.order);
    sidesOf(cells.shapes[cell]).forEach(([from, to], side) => {
      const me = first[cell] + side;
      const [start, end] = [vertex(cell, from), vertex(cell, to)];
      if (opposite[me] >= 0) edgeOf[me] = edgeOf[opposite[me]];
      if (edgeOf[me] < 0) {
        edgeOf[me] = edges.length;
        edges.push({cell, nodes: lists[side]});
        ends.push(start, end);
      }
      cellEdges[me] = ends[2 * edgeOf[me]] === start ? edgeOf[me] + 1 : -(edgeOf[me] + 1);
    });
  }
  arrays.edge_ends = Int32Array.from(ends);
  arrays.cell_edges = cellEdges;
  arrays.cell_sides = Uint8Array.from(cells.shapes, (shape) => sidesOf(shape).length);
  return {edges, vertices};
}

function makeScene2d(snapshots, arrays) {
  const [cells] = snapshots.all;
  const {edges, vertices} = findEdges(cells, arrays);
  const weights = controlWeights(cells.mesh.order);
  const last = weights.length + 1;
  const node = [0, 0, 0];
  snapshots.names.forEach((name, snapshot) => {
    const places = new Float32Array(2 * vertices.length);
    vertices.forEach(([cell, corner], i) => {
      snapshots.put(snapshot, cell, corner, node, 0);
      places.set(node.slice(0, 2), 2 * i);
    });
    const scales = new Float32Array(edges.length);
    const bends = new Int16Array(2 * weights.length * edges.length);
    edges.forEach(({cell, nodes}, edge) => {
      const points = nodes.map((local) => {
        snapshots.put(snapshot, cell, local, node, 0);
        return [node[0], node[1]];
      });
      const [from, to] = [points[0], points.at(-1)];
      const bend = weights.flatMap((row, k) => [0, 1].map((d) => {
        const t = (k + 1) / last;
        return row.reduce((sum, weight, i) => sum + weight * points[i][d], 0) - (1 - t) * from[d] - t * to[d];
      }));
      const most = Math.max(...bend.map(Math.abs));
      if (most <= 1e-9 * Math.hypot(to[0] - from[0], to[1] - from[1])) return;  // The edge is straight.
      scales[edge] = most / 32767;
      bend.forEach((value, i) => { bends[2 * weights.length * edge + i] = Math.round((value / most) * 32767); });
    });
    arrays[`vertices_${name}`] = places;
    arrays[`bend_scales_${name}`] = scales;
    arrays[`bends_${name}`] = bends;
  });
  return {shown: Uint32Array.from({length: cells.count}, (_, cell) => cell), scene: {pieces: piecesOf(cells.mesh.order)}};
}
