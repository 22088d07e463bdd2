// Faces of a 3-D mesh as lattices of points, triangles and lines. scene_3d.cpp packs them; a page that has the mesh gives their
// positions as they are.

/**
 * The lattice on a face with this many corners and this many intervals per edge: the number of its points, and the indices
 * of the points of its triangles and of the lines of its outline. `stride`: of the points, these use each so many-th one along
 * an edge; it divides the intervals.
 */
function latticePattern(corners, intervals, stride = 1) {
  const rows = [];
  let count = 0;
  for (let j = 0; j <= intervals; ++j) {
    rows.push(count);
    count += corners === 3 ? intervals - j + 1 : intervals + 1;
  }
  const point = (i, j) => rows[j] + i;
  const triangles = [];
  for (let j = 0; j < intervals; j += stride) {
    const last = corners === 3 ? intervals - j : intervals;
    for (let i = 0; i < last; i += stride) {
      triangles.push(point(i, j), point(i + stride, j), point(i, j + stride));
      if (corners === 4 || i + stride < last) triangles.push(point(i + stride, j), point(i + stride, j + stride), point(i, j + stride));
    }
  }
  const lines = [];
  for (let k = 0; k < intervals; k += stride) {
    const next = k + stride;
    lines.push(point(k, 0), point(next, 0), point(0, k), point(0, next));
    if (corners === 3) lines.push(point(intervals - k, k), point(intervals - next, next));
    else lines.push(point(k, intervals), point(next, intervals), point(intervals, k), point(intervals, next));
  }
  return {count, intervals, triangles, lines};
}

/** The faces of one set and of one shape. `description` is an entry of scene.sets. */
class FaceSet {
  constructor(description, arrays) {
    Object.assign(this, description);
    this.cells = arrays[`${description.name}_cells`];
    this.pattern = latticePattern(description.corners, description.intervals);
    this.coarse = latticePattern(description.corners, description.intervals, description.intervals);
    this.surfaces = arrays[`${description.name}_surfaces`];
    this.arrays = arrays;
    this.known = {};
  }

  /** The largest distance of each face from the CAD model; negative: not known. Undefined if the page has none. */
  distances(snapshot) {
    return this.arrays[`${this.name}_distances_${snapshot}`];
  }

  /** x, y and z of all points of all faces, relative to the centre of the scene. */
  positions(snapshot) {
    const stored = this.snapshots > 1 ? snapshot : 'before';
    return this.known[stored] ??= this.unpack(stored);
  }

  unpack(snapshot) {
    const given = this.arrays[`${this.name}_${snapshot}_positions`];
    if (given) return given;
    const origins = this.arrays[`${this.name}_${snapshot}_origins`];
    const scales = this.arrays[`${this.name}_${snapshot}_scales`];
    const steps = this.arrays[`${this.name}_${snapshot}_steps`];
    const positions = new Float32Array(steps.length);
    const each = 3 * this.pattern.count;
    for (let face = 0; face < this.cells.length; ++face) {
      for (let i = 0; i < each; ++i) positions[face * each + i] = origins[3 * face + (i % 3)] + scales[face] * steps[face * each + i];
    }
    return positions;
  }

  /** The points of the triangles or lines in `pattern`, for the faces for which shown(cell, face) is true. */
  select(pattern, shown) {
    let faces = 0;
    this.cells.forEach((cell, face) => { faces += shown(cell, face) ? 1 : 0; });
    const index = new Uint32Array(faces * pattern.length);
    let next = 0;
    this.cells.forEach((cell, face) => {
      if (!shown(cell, face)) return;
      for (const point of pattern) index[next++] = face * this.pattern.count + point;
    });
    return index;
  }

  /** The face that a point belongs to. */
  faceOf(point) {
    return Math.floor(point / this.pattern.count);
  }
}
