// What web/view draws, made of meshes that came from the server: the same document and arrays as the report's scene.cpp makes.

const WORST_ROWS = 10;

/**
 * The mesh before, and perhaps after, an optimisation: the same cells at two places. Each of `all` is a MeshCells, and after the
 * first they are in its order.
 */
class Snapshots {
  /** `box`: in whose middle the scene has its centre. */
  constructor(before, after = null, box = before.box()) {
    this.all = [before];
    this.orders = [null];
    const order = after?.orderLike(before);
    if (order) {
      this.all.push(after);
      this.orders.push(order);
    }
    this.names = ['before', 'after'].slice(0, this.all.length);
    this.box = box;
    this.centre = [0, 1, 2].map((d) => this.box[d] / 2 + this.box[3 + d] / 2);
  }

  /** The cell of this snapshot that is the cell of the first. */
  cell(snapshot, cell) {
    return snapshot === 0 ? cell : this.orders[snapshot][cell];
  }

  js(snapshot, cell) {
    return this.all[snapshot].quality.js[this.cell(snapshot, cell)];
  }

  /** Copies a node of a cell, relative to the centre, to `to` from `at` on. */
  put(snapshot, cell, local, to, at) {
    const cells = this.all[snapshot];
    const node = 3 * cells.node(this.cell(snapshot, cell), local);
    for (let d = 0; d < 3; ++d) to[at + d] = cells.mesh.xyz[node + d] - this.centre[d];
  }
}

/** The numbers of the cells in `shown` as differences, as CellTable and CornerCells want them. */
function numberSteps(cells, shown) {
  let last = 0;
  return Float64Array.from(shown, (cell) => {
    const number = cells.quality.numbers[cell];
    const step = number - last;
    last = number;
    return step;
  });
}

/** The table of the worst elements. `index` is a Map from the cells that are shown to their places there. */
function worstRows(snapshots, snapshot, index) {
  const cells = snapshots.all[snapshot];
  const back = snapshot === 0 ? null : new Map(Array.from(snapshots.orders[snapshot], (cell, i) => [cell, i]));
  return Array.from(cells.worst(Math.min(WORST_ROWS, cells.count)), (cell) => {
    const shown = index.get(back ? back.get(cell) : cell);
    return {number: cells.quality.numbers[cell], shape: SHAPES[cells.shapes[cell]].name, scaled_jacobian: cells.quality.js[cell],
      ...cells.extent(cell), ...(shown === undefined ? {} : {cell: shown})};
  });
}

/** Adds what 2-D and 3-D share: numbers, qualities and marks of the cells that are shown. `unrepairable`: numbers of elements. */
function completeScene(snapshots, scene, arrays, shown, unrepairable) {
  const [before] = snapshots.all;
  arrays.numbers = numberSteps(before, shown);
  arrays.marks = Uint8Array.from(shown, (cell) => {
    let mark = unrepairable.has(before.quality.numbers[cell]) ? MARK_UNREPAIRABLE : 0;
    snapshots.all.forEach((cells, snapshot) => {
      if (cells.quality.answers[snapshots.cell(snapshot, cell)] !== CELL_VALID) mark |= MARK_UNCERTIFIED[snapshots.names[snapshot]];
    });
    return mark;
  });
  const index = new Map();
  shown.forEach((cell, i) => index.set(cell, i));
  scene.worst = {};
  snapshots.names.forEach((name, snapshot) => {
    arrays[`js_${name}`] = Float32Array.from(shown, (cell) => snapshots.js(snapshot, cell));
    scene.worst[name] = worstRows(snapshots, snapshot, index);
  });
  Object.assign(scene, {dimension: before.mesh.dimension, cells: before.count, shown: shown.length, centre: snapshots.centre, box: snapshots.box,
    snapshots: snapshots.names});
}

/** Makes {scene, arrays} of one or two MeshCells. `box`: that of the scene, if it is not the one of the first mesh. */
function makeScene(before, after, unrepairable, box) {
  const snapshots = new Snapshots(before, after, box);
  const arrays = {};
  const {scene, shown} = before.mesh.dimension === 2 ? makeScene2d(snapshots, arrays) : makeScene3d(snapshots, arrays);
  completeScene(snapshots, scene, arrays, shown, unrepairable);
  return {scene, arrays};
}
