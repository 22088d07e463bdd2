// The elements that a cut goes through, if the page has only the corners of the mesh. scene_cut.cpp packs them.

// The faces of cells by their number of corners, in Gmsh's order of corners, and their edges.
const CELL_FACES = {
  4: [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
  5: [[0, 3, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
  6: [[0, 2, 1], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
  8: [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
};

/** The corners of the triangles of all faces, and of the ends of all edges, by the number of a cell's corners. */
const CELL_TRIANGLES = {};
const CELL_EDGES = {};
for (const [size, faces] of Object.entries(CELL_FACES)) {
  CELL_TRIANGLES[size] = faces.flatMap((face) => face.slice(2).flatMap((corner, k) => [face[0], face[k + 1], corner]));
  // Each edge belongs to two faces, once in each direction.
  CELL_EDGES[size] = faces.flatMap((face) => face.flatMap((from, k) => {
    const to = face[(k + 1) % face.length];
    return from < to ? [from, to] : [];
  }));
}

/** The corners of cells: of those that the first cut goes through, or of all. `name` is that of their arrays: cut or all. */
class CornerCells {
  constructor(arrays, name) {
    Object.assign(this, {arrays, name});
    this.corners = arrays[`${name}_corners`];
    this.sizes = arrays[`${name}_shapes`];
    this.numbers = new Float64Array(this.sizes.length);
    this.first = new Uint32Array(this.sizes.length + 1);
    let number = 0;
    for (let cell = 0; cell < this.sizes.length; ++cell) {
      this.numbers[cell] = number += arrays[`${name}_numbers`][cell];  // They arrive as differences.
      this.first[cell + 1] = this.first[cell] + this.sizes[cell];
    }
  }

  /** The scaled Jacobian, rounded up to a multiple of 1/255; 0 if it is not positive. */
  js(snapshot, cell) {
    return this.arrays[`${this.name}_js_${snapshot}`][cell] / 255;
  }

  places(snapshot) {
    return this.arrays[`${this.name}_vertices_${snapshot}`];
  }

  /** The cells with corners on both sides of the plane at `at` across an axis. */
  cutBy(snapshot, axis, at) {
    const places = this.places(snapshot);
    const found = [];
    for (let cell = 0; cell < this.sizes.length; ++cell) {
      let below = false;
      let above = false;
      for (let i = this.first[cell]; i < this.first[cell + 1]; ++i) {
        if (places[3 * this.corners[i] + axis] > at) above = true;
        else below = true;
      }
      if (below && above) found.push(cell);
    }
    return found;
  }

  cellOfNumber(number) {
    return this.numbers.indexOf(number);
  }

  describe(snapshot, cell) {
    const value = this.js(snapshot, cell);
    return `element ${this.numbers[cell]}: scaled Jacobian ${value > 0 ? `about ${value.toFixed(2)}` : 'not positive, invalid'}`;
  }
}

/** Draws cells with straight edges between their corners. */
class DrawnCells extends Surface3d {
  constructor(scene, snapshot, shared) {
    super(scene);
    Object.assign(this, {snapshot, shared, cells: null, shown: [], owners: []});
  }

  colour() {
    if (this.cells) this.show(this.cells, this.shown);
  }

  /** Shows these of the cells. */
  show(cells, shown) {
    Object.assign(this, {cells, shown});
    this.mesh.visible = this.lines.visible = shown.length > 0;
    this.drawEdges(false);
    if (!shown.length) return;
    const {corners, first, sizes} = cells;
    const places = cells.places(this.snapshot);
    const bins = Array.from({length: 256}, (_, value) => this.shared.choice.colour === 'distance' ? themeColour('--line').map(linearPart) : colourOf(value / 255).map(linearPart));
    let [triangles, segments] = [0, 0];
    for (const cell of shown) {
      triangles += CELL_TRIANGLES[sizes[cell]].length;
      segments += CELL_EDGES[sizes[cell]].length;
    }
    const points = new Float32Array(3 * triangles);
    const colours = new Float32Array(3 * triangles);
    const edges = new Float32Array(3 * segments);
    this.owners = new Uint32Array(triangles / 3);
    let [point, edge] = [0, 0];
    for (const cell of shown) {
      const colour = bins[Math.round(255 * cells.js(this.snapshot, cell))];
      for (const corner of CELL_TRIANGLES[sizes[cell]]) {
        this.owners[Math.floor(point / 9)] = cell;
        const at = 3 * corners[first[cell] + corner];
        for (let d = 0; d < 3; ++d, ++point) [points[point], colours[point]] = [places[at + d], colour[d]];
      }
      for (const corner of CELL_EDGES[sizes[cell]]) {
        const at = 3 * corners[first[cell] + corner];
        for (let d = 0; d < 3; ++d) edges[edge++] = places[at + d];
      }
    }
    this.surface.setAttribute('position', new THREE.BufferAttribute(points, 3));
    this.surface.setAttribute('color', new THREE.BufferAttribute(colours, 3));
    this.surface.computeVertexNormals();
    this.surface.computeBoundingSphere();
    this.outline.setAttribute('position', new THREE.BufferAttribute(edges, 3));
    this.outline.computeBoundingSphere();
  }

  /** The cell of a triangle of the mesh. */
  cellOf(triangle) {
    return this.owners[triangle];
  }
}
