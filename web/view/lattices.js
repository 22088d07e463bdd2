// Faces of a 3-D mesh as lattices of points, triangles and lines. scene_3d.cpp packs them; a page that has the mesh gives their
// positions as they are.

/**
 * The lattice on a face with this many corners and this many intervals per edge: the number of its points, and the indices
 * of the points of its triangles and of the lines of its outline.
 */
function latticePattern(corners, intervals) {
  const rows = [];
  let count = 0;
  for (let j = 0; j <= intervals; ++j) {
    rows.push(count);
    count += corners === 3 ? intervals - j + 1 : intervals + 1;
  }
  const point = (i, j) => rows[j] + i;
  const triangles = [];
  for (let j = 0; j < intervals; ++j) {
    const last = corners === 3 ? intervals - j : intervals;
    for (let i = 0; i < last; ++i) {
      triangles.push(point(i, j), point(i + 1, j), point(i, j + 1));
      if (corners === 4 || i + 1 < last) triangles.push(point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
    }
  }
  const lines = [];
  for (let k = 0; k < intervals; ++k) {
    lines.push(point(k, 0), point(k + 1, 0), point(0, k), point(0, k + 1));
    if (corners === 3) lines.push(point(intervals - k, k), point(intervals - k - 1, k + 1));
    else lines.push(point(k, intervals), point(k + 1, intervals), point(intervals, k), point(intervals, k + 1));
  }
  return {count, intervals, triangles, lines};
}

/** The faces of one set and of one shape. `description` is an entry of scene.sets. */
class FaceSet {
  constructor(description, arrays) {
    Object.assign(this, description);
    this.cells = arrays[`${description.name}_cells`];
    this.pattern = latticePattern(description.corners, description.intervals);
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
