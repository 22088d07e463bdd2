// The cells of a 2-D mesh as closed paths of Bézier curves. scene_2d.cpp packs them. Coordinates are relative to the centre
// of the scene; y points upwards.

/** A pen that writes a path as text for SVG. */
class PathText {
  constructor() { this.text = ''; }
  moveTo(x, y) { this.text += `M${x} ${y}`; }
  lineTo(x, y) { this.text += `L${x} ${y}`; }
  bezierCurveTo(a, b, c, d, x, y) { this.text += `C${a} ${b} ${c} ${d} ${x} ${y}`; }
  closePath() { this.text += 'Z'; }
}

class Paths2d {
  constructor(scene, arrays) {
    this.points = 3 * scene.pieces - 1;
    this.ends = arrays.edge_ends;
    this.edges = arrays.cell_edges;
    this.first = new Int32Array(arrays.cell_sides.length + 1);
    arrays.cell_sides.forEach((sides, i) => { this.first[i + 1] = this.first[i] + sides; });
    this.count = arrays.cell_sides.length;
    this.snapshots = {};
    for (const snapshot of scene.snapshots) {
      this.snapshots[snapshot] =
          {vertices: arrays[`vertices_${snapshot}`], scales: arrays[`bend_scales_${snapshot}`], bends: arrays[`bends_${snapshot}`]};
    }
    // Digits beyond single precision are left out.
    const size = Math.max(scene.box[3] - scene.box[0], scene.box[4] - scene.box[1]);
    this.unit = 10 ** Math.floor(Math.log10(size) - 7);
  }

  /** Traces an edge from its first end to its second, or backwards. The pen is at the beginning. */
  traceEdge(snapshot, edge, backwards, pen) {
    const {vertices, scales, bends} = this.snapshots[snapshot];
    const from = 2 * this.ends[2 * edge + (backwards ? 1 : 0)];
    const to = 2 * this.ends[2 * edge + (backwards ? 0 : 1)];
    const [x0, y0, x1, y1] = [vertices[from], vertices[from + 1], vertices[to], vertices[to + 1]];
    const scale = scales[edge];
    if (scale === 0) {
      pen.lineTo(x1, y1);
      return;
    }
    const base = 2 * edge * this.points;
    const steps = this.points + 1;
    const control = (k) => {
      if (k === steps) return [x1, y1];
      const t = k / steps;
      const i = base + 2 * ((backwards ? steps - k : k) - 1);
      return [x0 + t * (x1 - x0) + scale * bends[i], y0 + t * (y1 - y0) + scale * bends[i + 1]];
    };
    for (let k = 1; k < steps; k += 3) pen.bezierCurveTo(...control(k), ...control(k + 1), ...control(k + 2));
  }

  /** Traces the closed path of a cell. */
  trace(snapshot, cell, pen) {
    const {vertices} = this.snapshots[snapshot];
    for (let i = this.first[cell]; i < this.first[cell + 1]; ++i) {
      const edge = Math.abs(this.edges[i]) - 1;
      const backwards = this.edges[i] < 0;
      if (i === this.first[cell]) {
        const vertex = 2 * this.ends[2 * edge + (backwards ? 1 : 0)];
        pen.moveTo(vertices[vertex], vertices[vertex + 1]);
      }
      this.traceEdge(snapshot, edge, backwards, pen);
    }
    pen.closePath();
  }

  /** Traces every edge once. */
  traceEdges(snapshot, pen) {
    const {vertices} = this.snapshots[snapshot];
    for (let edge = 0; 2 * edge < this.ends.length; ++edge) {
      const vertex = 2 * this.ends[2 * edge];
      pen.moveTo(vertices[vertex], vertices[vertex + 1]);
      this.traceEdge(snapshot, edge, false, pen);
    }
  }

  /** A pen for text, which rounds to the digits that single precision has. */
  text() {
    const round = (value) => Number((Math.round(value / this.unit) * this.unit).toPrecision(9));
    const pen = new PathText();
    return {
      moveTo: (...at) => pen.moveTo(...at.map(round)),
      lineTo: (...at) => pen.lineTo(...at.map(round)),
      bezierCurveTo: (...at) => pen.bezierCurveTo(...at.map(round)),
      closePath: () => pen.closePath(),
      get text() { return pen.text; },
    };
  }

  /** A box round each cell: smallest x, smallest y, largest x, largest y. It may be larger than the cell. */
  boxes(snapshot) {
    this.known ??= {};
    return this.known[snapshot] ??= this.findBoxes(snapshot);
  }

  findBoxes(snapshot) {
    const {vertices, scales, bends} = this.snapshots[snapshot];
    const largest = bends instanceof Int8Array ? 127 : 32767;
    const boxes = new Float32Array(4 * this.count);
    for (let cell = 0; cell < this.count; ++cell) {
      let [left, low, right, high] = [Infinity, Infinity, -Infinity, -Infinity];
      for (let i = this.first[cell]; i < this.first[cell + 1]; ++i) {
        const edge = Math.abs(this.edges[i]) - 1;
        const bend = scales[edge] * largest;
        for (let end = 0; end < 2; ++end) {
          const vertex = 2 * this.ends[2 * edge + end];
          left = Math.min(left, vertices[vertex] - bend);
          right = Math.max(right, vertices[vertex] + bend);
          low = Math.min(low, vertices[vertex + 1] - bend);
          high = Math.max(high, vertices[vertex + 1] + bend);
        }
      }
      boxes.set([left, low, right, high], 4 * cell);
    }
    return boxes;
  }
}
