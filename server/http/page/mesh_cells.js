// The cells of a mesh that came from the server, which cells share a side, and where they are.

/** The cells of the highest dimension with their quality; those of a result in the order of those before, by their numbers. */
class MeshCells {
  constructor(mesh, quality) {
    Object.assign(this, {mesh, quality, count: quality.js.length});
    this.shapes = new Uint8Array(this.count);
    this.first = new Uint32Array(this.count + 1);
    const own = mesh.blocks.filter(({shape}) => SHAPES[shape]?.dimension === mesh.dimension);
    this.nodes = joinedArrays(Int32Array, own.map((block) => block.nodes));
    let cell = 0;
    for (const {shape, nodes} of own) {
      const each = latticeOf(shape, mesh.order).length;
      for (let i = 0; i < nodes.length && cell < this.count; i += each) {
        this.shapes[cell] = shape;
        this.first[cell + 1] = this.first[cell] + each;
        ++cell;
      }
    }
    if (cell !== this.count || this.first[cell] !== this.nodes.length) throw new Error('The mesh and its quality do not fit together; please report it.');
  }

  /** order[c] is the cell that has the number of cell c of `other`; null if the two do not have the same cells. */
  orderLike(other) {
    if (this.count !== other.count || this.mesh.order !== other.mesh.order) return null;
    const at = new Map();
    this.quality.numbers.forEach((number, cell) => at.set(number, cell));
    const order = Int32Array.from(other.quality.numbers, (number) => at.get(number) ?? -1);
    return order.every((cell, i) => cell >= 0 && this.shapes[cell] === other.shapes[i]) ? order : null;
  }

  node(cell, local) {
    return this.nodes[this.first[cell] + local];
  }

  isInvalid(cell) {
    return !(this.quality.js[cell] > 0);
  }

  /** The mean of a cell's nodes, and the longest distance from its first node to another. */
  extent(cell) {
    const {xyz} = this.mesh;
    const place = [0, 0, 0];
    let size = 0;
    const [from, to] = [this.first[cell], this.first[cell + 1]];
    const first = 3 * this.nodes[from];
    for (let i = from; i < to; ++i) {
      const at = 3 * this.nodes[i];
      for (let d = 0; d < 3; ++d) place[d] += xyz[at + d] / (to - from);
      size = Math.max(size, Math.hypot(xyz[at] - xyz[first], xyz[at + 1] - xyz[first + 1], xyz[at + 2] - xyz[first + 2]));
    }
    return {place, size};
  }

  /** The box of all cells: smallest x, y, z, largest x, y, z. */
  box() {
    const {xyz} = this.mesh;
    const box = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
    const isSeen = new Uint8Array(xyz.length / 3);
    for (const node of this.nodes) {
      if (isSeen[node]) continue;
      isSeen[node] = 1;
      for (let d = 0; d < 3; ++d) {
        const value = xyz[3 * node + d];
        if (value < box[d]) box[d] = value;
        if (value > box[3 + d]) box[3 + d] = value;
      }
    }
    return box;
  }

  /** The cells with the smallest scaled Jacobians, worst first. */
  worst(most) {
    const {js} = this.quality;
    const cells = Uint32Array.from({length: this.count}, (_, cell) => cell);
    if (this.count > 20 * most) {  // Most cells are better than a bound that enough cells keep: twice as many as needed, as a sample says.
      const sample = Float64Array.from({length: Math.floor(this.count / 16)}, (_, i) => js[16 * i]).sort();
      const bound = sample[Math.ceil(most / 8) + 8];
      const found = cells.filter((cell) => !(js[cell] > bound));
      if (found.length >= most) return found.sort((a, b) => js[a] - js[b] || a - b).subarray(0, most);
    }
    return cells.sort((a, b) => js[a] - js[b] || a - b).subarray(0, most);
  }
}

/** The number of each cell's first side, and of all sides. */
function firstSides(cells) {
  const first = new Uint32Array(cells.count + 1);
  const counts = Object.keys(SHAPES).reduce((all, shape) => Object.assign(all, {[shape]: sidesOf(Number(shape)).length}), []);
  for (let cell = 0; cell < cells.count; ++cell) first[cell + 1] = first[cell] + counts[cells.shapes[cell]];
  return first;
}

/** Of each side the smallest three corners, sorted (−1 for a third one of an edge): two sides that share these are the same. */
function sideCorners(cells, first) {
  const corners = new Int32Array(3 * first[cells.count]);
  const found = [0, 0, 0, 0];
  let next = 0;
  for (let cell = 0; cell < cells.count; ++cell) {
    const own = sidesOf(cells.shapes[cell]);
    const begin = cells.first[cell];
    for (let side = 0; side < own.length; ++side) {
      const {length} = own[side];
      for (let i = 0; i < length; ++i) {  // Sorts by insertion.
        const node = cells.nodes[begin + own[side][i]];
        let at = i;
        for (; at > 0 && found[at - 1] > node; --at) found[at] = found[at - 1];
        found[at] = node;
      }
      corners[next++] = found[0];
      corners[next++] = found[1];
      corners[next++] = length > 2 ? found[2] : -1;
    }
  }
  return corners;
}

/** The sides of the cells: opposite[s] is the same side of another cell, or −1 on the boundary; first[c] is the first side of cell c. */
function joinSides(cells) {
  const first = firstSides(cells);
  const corners = sideCorners(cells, first);
  const sides = first[cells.count];
  const opposite = new Int32Array(sides).fill(-1);
  const head = new Int32Array(cells.mesh.xyz.length / 3).fill(-1);  // By the smallest corner, the sides that wait for another.
  const next = new Int32Array(sides);
  for (let me = 0; me < sides; ++me) {
    const [least, second, third] = [corners[3 * me], corners[3 * me + 1], corners[3 * me + 2]];
    let before = -1;
    let other = head[least];
    while (other >= 0 && (corners[3 * other + 1] !== second || corners[3 * other + 2] !== third)) {
      before = other;
      other = next[other];
    }
    if (other >= 0) {
      opposite[me] = other;
      opposite[other] = me;
      if (before < 0) head[least] = next[other];
      else next[before] = next[other];
    } else {
      next[me] = head[least];
      head[least] = me;
    }
  }
  return {first, opposite};
}
