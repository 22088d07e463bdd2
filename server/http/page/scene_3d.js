// The part of a scene for 3-D: the faces on the boundary and those of the worst cells, on lattices, and the corners of all cells.

const ALL_CELLS = 4000;       // In meshes with up to this many cells, all cells have curved faces.
const WORST_CELLS = 2000;     // In larger meshes, this many of the worst cells of each snapshot have them.
const MOST_POINTS = 300000;   // In one set of faces. More faces get fewer intervals per edge.

/** Enough intervals per edge for curves to look smooth, but not too many points. */
function intervalsFor(faces, order) {
  if (order === 1) return 1;
  let intervals = Math.min(2 * order, 12);
  while (intervals > 1 && faces * ((intervals + 1) * (intervals + 2)) / 2 > MOST_POINTS) --intervals;
  return intervals;
}

/** The points of faces with this many corners, one face after another. A face is [cell, side]. */
function facePoints(snapshots, snapshot, faces, corners, intervals) {
  const {order} = snapshots.all[0].mesh;
  const weights = faceWeights(corners, order, intervals);
  const points = new Float32Array(3 * weights.length * faces.length);
  const nodes = new Float64Array(3 * weights[0].length);
  const local = new Map();
  let next = 0;
  for (const [cell, side] of faces) {
    const shape = snapshots.all[0].shapes[cell];
    if (!local.has(shape)) local.set(shape, sideNodes(shape, order));
    local.get(shape)[side].forEach((node, i) => snapshots.put(snapshot, cell, node, nodes, 3 * i));
    for (const row of weights) {
      let [x, y, z] = [0, 0, 0];
      for (let i = 0; i < row.length; ++i) {
        const weight = row[i];
        if (weight === 0) continue;
        x += weight * nodes[3 * i];
        y += weight * nodes[3 * i + 1];
        z += weight * nodes[3 * i + 2];
      }
      points[next++] = x;
      points[next++] = y;
      points[next++] = z;
    }
  }
  return points;
}

/** Adds an array that is made when it is used for the first time: faces inside a large mesh may never be shown. */
function addLater(arrays, name, make) {
  Object.defineProperty(arrays, name, {configurable: true, enumerable: true, get() {
    const made = make();
    Object.defineProperty(arrays, name, {value: made, enumerable: true});
    return made;
  }});
}

/** Describes one set of faces, and adds its arrays. `kept`: in how many snapshots they differ. */
function addFaceSet(snapshots, arrays, set, faces, kept, index, sets) {
  const intervals = intervalsFor(faces.length, snapshots.all[0].mesh.order);
  for (const corners of [TRIANGLE, QUADRILATERAL]) {
    const chosen = faces.filter(([cell, side]) => sidesOf(snapshots.all[0].shapes[cell])[side].length === corners);
    if (chosen.length === 0) continue;
    const name = `${set}${corners}`;
    arrays[`${name}_cells`] = Int32Array.from(chosen, ([cell]) => index.get(cell));
    for (let snapshot = 0; snapshot < kept; ++snapshot) {
      addLater(arrays, `${name}_${snapshots.names[snapshot]}_positions`, () => facePoints(snapshots, snapshot, chosen, corners, intervals));
    }
    sets.push({name, set, corners, intervals, snapshots: kept});
  }
}

/** The cells that are shown whole, and the scaled Jacobian up to which all cells are among them. */
function wholeCells(snapshots) {
  const {count} = snapshots.all[0];
  if (count <= ALL_CELLS) return {whole: Array.from({length: count}, (_, cell) => cell), limit: 1};
  const whole = new Set();
  let limit = 1;
  snapshots.all.forEach((cells, snapshot) => {
    const back = snapshot === 0 ? null : new Map(Array.from(snapshots.orders[snapshot], (cell, i) => [cell, i]));
    const worst = cells.worst(WORST_CELLS);
    limit = Math.min(limit, cells.quality.js[worst.at(-1)]);
    for (const cell of worst) whole.add(back ? back.get(cell) : cell);
  });
  return {whole: [...whole], limit};
}

/** The corners of all cells, from which a cut is drawn with straight edges. */
function cornersOf(snapshots) {
  const arrays = {};
  const [cells] = snapshots.all;
  const sizes = Uint8Array.from(cells.shapes, (shape) => SHAPES[shape].places.length);
  const corners = new Int32Array(sizes.reduce((sum, size) => sum + size, 0));
  const vertexOf = new Int32Array(cells.mesh.xyz.length / 3).fill(-1);
  const places = snapshots.names.map(() => []);
  let [next, vertices] = [0, 0];
  for (let cell = 0; cell < cells.count; ++cell) {
    for (let corner = 0; corner < sizes[cell]; ++corner) {
      const node = cells.node(cell, corner);
      if (vertexOf[node] < 0) {
        vertexOf[node] = vertices;
        places.forEach((list, snapshot) => snapshots.put(snapshot, cell, corner, list, 3 * vertices));
        ++vertices;
      }
      corners[next++] = vertexOf[node];
    }
  }
  arrays.all_shapes = sizes;
  arrays.all_corners = corners;
  arrays.all_numbers = numberSteps(cells, Uint32Array.from({length: cells.count}, (_, cell) => cell));
  snapshots.names.forEach((name, snapshot) => {
    arrays[`all_vertices_${name}`] = Float32Array.from(places[snapshot]);
    arrays[`all_js_${name}`] = Uint8Array.from(sizes, (_, cell) => {
      const js = snapshots.js(snapshot, cell);
      return js > 0 ? Math.min(255, Math.max(1, Math.ceil(255 * js))) : 0;
    });
  });
  return arrays;
}

/** Whether a node of these faces is at another place in the last snapshot than in the first, beyond what formats round. */
function haveMoved(snapshots, faces) {
  const last = snapshots.all.length - 1;
  if (last === 0) return false;
  const [x0, y0, z0, x1, y1, z1] = snapshots.box;
  const most = 1e-6 * Math.hypot(x1 - x0, y1 - y0, z1 - z0);
  const [from, to] = [[0, 0, 0], [0, 0, 0]];
  const {order} = snapshots.all[0].mesh;
  return faces.some(([cell, side]) => sideNodes(snapshots.all[0].shapes[cell], order)[side].some((node) => {
    snapshots.put(0, cell, node, from, 0);
    snapshots.put(last, cell, node, to, 0);
    return from.some((value, d) => Math.abs(value - to[d]) > most);
  }));
}

function makeScene3d(snapshots, arrays) {
  const [cells] = snapshots.all;
  const {whole, limit} = wholeCells(snapshots);
  const {first, opposite} = joinSides(cells);
  const skin = [];
  const index = new Map();
  const show = (cell) => { if (!index.has(cell)) index.set(cell, index.size); };
  whole.forEach(show);
  for (let cell = 0; cell < cells.count; ++cell) {
    for (let side = first[cell]; side < first[cell + 1]; ++side) {
      if (opposite[side] >= 0) continue;
      show(cell);
      skin.push([cell, side - first[cell]]);
    }
  }
  const inner = whole.flatMap((cell) => sidesOf(cells.shapes[cell]).map((_, side) => [cell, side]));
  const sets = [];
  addFaceSet(snapshots, arrays, 'skin', skin, haveMoved(snapshots, skin) ? snapshots.all.length : 1, index, sets);
  addFaceSet(snapshots, arrays, 'inner', inner, snapshots.all.length, index, sets);
  const shown = Uint32Array.from(index.keys());
  arrays.middles = new Float32Array(3 * shown.length);
  shown.forEach((cell, i) => cells.extent(cell).place.forEach((value, d) => { arrays.middles[3 * i + d] = value - snapshots.centre[d]; }));
  const corners = whole.length < cells.count;
  // A large mesh is shown from outside at first: nothing inside it has to be made for that.
  return {shown, scene: {sets, whole: whole.length, whole_up_to: limit, first_cut: corners ? -1 : 1, distances: false, corners,
    makeMore: corners ? () => cornersOf(snapshots) : undefined}};
}
