// Faces of a 3-D mesh as lattices of points, triangles and lines: scene_3d.cpp is the other side.

/** Triangles and outline of a lattice with so many intervals an edge, as numbers of its points. */
function latticePattern(corners, intervals) {
  const rows = [];
  let count = 0;
  for (let j = 0; j <= intervals; ++j) {
    rows.push(count);
    count += corners === 3 ? intervals - j + 1 : intervals + 1;
  }
  const at = (i, j) => rows[j] + i;
  const triangles = [];
  for (let j = 0; j < intervals; ++j) {
    const last = corners === 3 ? intervals - j : intervals;
    for (let i = 0; i < last; ++i) {
      triangles.push(at(i, j), at(i + 1, j), at(i, j + 1));
      if (corners === 4 || i + 1 < last) triangles.push(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  const lines = [];
  for (let k = 0; k < intervals; ++k) {
    lines.push(at(k, 0), at(k + 1, 0), at(0, k), at(0, k + 1));
    if (corners === 3) lines.push(at(intervals - k, k), at(intervals - k - 1, k + 1));
    else lines.push(at(k, intervals), at(k + 1, intervals), at(intervals, k), at(intervals, k + 1));
  }
  return {count, triangles, lines};
}

/** All faces of one set, of one shape. */
class FaceSet {
  constructor(facts, arrays) {
    Object.assign(this, facts);
    this.cells = arrays[`${facts.name}_cells`];
    this.pattern = latticePattern(facts.corners, facts.intervals);
    this.arrays = arrays;
    this.known = {};
  }

  /** x y z of every point of every face, relative to the scene's centre. */
  positions(stage) {
    const of = this.stages > 1 ? stage : 'before';
    return this.known[of] ??= this.unpack(of);
  }

  unpack(stage) {
    const origins = this.arrays[`${this.name}_${stage}_origins`];
    const scales = this.arrays[`${this.name}_${stage}_scales`];
    const steps = this.arrays[`${this.name}_${stage}_steps`];
    const positions = new Float32Array(steps.length);
    const each = 3 * this.pattern.count;
    for (let face = 0; face < this.cells.length; ++face) {
      for (let i = 0; i < each; ++i) positions[face * each + i] = origins[3 * face + (i % 3)] + scales[face] * steps[face * each + i];
    }
    return positions;
  }

  /** Numbers of the points of the triangles, or lines, of those faces that `shown` says yes to. */
  select(pattern, shown) {
    let faces = 0;
    for (const cell of this.cells) faces += shown(cell) ? 1 : 0;
    const index = new Uint32Array(faces * pattern.length);
    let next = 0;
    this.cells.forEach((cell, face) => {
      if (!shown(cell)) return;
      for (const point of pattern) index[next++] = face * this.pattern.count + point;
    });
    return index;
  }

  /** The cell that a point belongs to. */
  cellOf(point) {
    return this.cells[Math.floor(point / this.pattern.count)];
  }
}
