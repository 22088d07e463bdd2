// Views of a 2-D mesh in colour. A mesh with few curves is drawn as SVG. For others SVG is too slow, and a canvas is used.

const MOST_SVG_CURVES = 60000;
const SMALL = 4;  // In pixels. A smaller cell is drawn as a box.

/** The cells by colour: bin b has the cells with Js in [b, b + 1) / COLOURS, the last bin has the invalid cells. */
function cellsByColour(table, snapshot) {
  const bins = Array.from({length: COLOURS + 1}, () => []);
  table.js[snapshot].forEach((js, cell) => bins[js > 0 ? Math.min(COLOURS - 1, Math.floor(js * COLOURS)) : COLOURS].push(cell));
  return bins;
}

const rgbOfBin = (bin) => (bin === COLOURS ? colourOf(-1) : colourOf((bin + 0.5) / COLOURS));
const colourOfBin = (bin) => css(rgbOfBin(bin));

class SvgDrawing {
  constructor(paths, table, snapshot) {
    this.node = draw('svg', {class: 'drawing', role: 'img', 'aria-label': `the mesh ${snapshot}, coloured by scaled Jacobian`});
    this.plane = draw('g');
    this.node.append(this.plane);
    const fills = [];
    cellsByColour(table, snapshot).forEach((cells, bin) => {
      if (!cells.length) return;
      const pen = paths.text();
      for (const cell of cells) paths.trace(snapshot, cell, pen);
      const path = draw('path', {d: pen.text});
      fills.push([path, bin]);
      this.plane.append(path);
    });
    const pen = paths.text();
    paths.traceEdges(snapshot, pen);
    this.plane.append(draw('path', {class: 'outline', d: pen.text}));
    for (let cell = 0; cell < table.count; ++cell) {
      if (!table.invalid(snapshot, cell) && !table.unrepairable(cell)) continue;
      const outline = paths.text();
      paths.trace(snapshot, cell, outline);
      this.plane.append(draw('path', {class: table.unrepairable(cell) ? 'flagged never' : 'flagged', d: outline.text}));
    }
    const paint = () => { for (const [path, bin] of fills) path.setAttribute('fill', colourOfBin(bin)); };
    paint();
    followTheme(this.node, paint);
  }

  follow({x, y, span}, width, height) {
    const scale = width / span;
    set(this.plane, {transform: `matrix(${scale} 0 0 ${-scale} ${width / 2 - x * scale} ${height / 2 + y * scale})`});
  }
}

class CanvasDrawing {
  constructor(paths, table, snapshot) {
    Object.assign(this, {paths, table, snapshot});
    this.node = make('canvas', {role: 'img', 'aria-label': `the mesh ${snapshot}, coloured by scaled Jacobian`});
    this.boxes = paths.boxes(snapshot);
    this.bins = cellsByColour(table, snapshot);
    followTheme(this.node, () => this.repaint());
  }

  follow(viewport, width, height) {
    this.seen = [viewport, width, height];
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.repaint(); });
  }

  /** Yields the cells that can be seen, as [cell, size in pixels]. */
  * inSight(cells, {x, y, span}, width, height) {
    const unit = span / width;
    const [left, right] = [x - span / 2, x + span / 2];
    const [low, high] = [y - (height / 2) * unit, y + (height / 2) * unit];
    for (const cell of cells) {
      const i = 4 * cell;
      if (this.boxes[i] > right || this.boxes[i + 2] < left || this.boxes[i + 1] > high || this.boxes[i + 3] < low) continue;
      yield [cell, Math.max(this.boxes[i + 2] - this.boxes[i], this.boxes[i + 3] - this.boxes[i + 1]) / unit];
    }
  }

  repaint() {
    if (!this.seen) return;
    const [viewport, width, height] = this.seen;
    const ratio = window.devicePixelRatio || 1;
    const size = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.node.width !== size[0] || this.node.height !== size[1]) [this.node.width, this.node.height] = size;
    const pen = this.node.getContext('2d');
    const scale = (width / viewport.span) * ratio;
    const move = [size[0] / 2 - viewport.x * scale, size[1] / 2 + viewport.y * scale];
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, ...size);
    const large = this.paintSmall(pen, size, scale, move);
    pen.setTransform(scale, 0, 0, -scale, ...move);
    const line = getComputedStyle(document.documentElement).getPropertyValue('--mesh-line');
    const invalidLine = css(themeColour('--invalid'));
    large.forEach((cells, bin) => {
      pen.fillStyle = colourOfBin(bin);
      for (const [cell, pixels] of cells) {
        pen.beginPath();
        this.paths.trace(this.snapshot, cell, pen);
        pen.fill();
        const flagged = this.table.invalid(this.snapshot, cell);
        if (pixels < 8) continue;
        pen.strokeStyle = flagged ? invalidLine : line;
        pen.lineWidth = ((flagged ? 2 : 0.7) * ratio) / scale;
        pen.stroke();
      }
    });
  }

  /** Paints the cells of few pixels as boxes, worse cells over better ones. Returns the other cells that can be seen, by bin. */
  paintSmall(pen, size, scale, move) {
    const image = pen.createImageData(...size);
    const pixels = new Uint32Array(image.data.buffer);
    const large = this.bins.map(() => []);
    const [viewport, width, height] = this.seen;
    for (let bin = COLOURS; bin >= 0; --bin) {
      const painted = bin === 0 ? COLOURS : bin - 1;  // 63, 62, …, 0, then the invalid cells
      const [r, g, b] = rgbOfBin(painted);
      const colour = (255 << 24) | (b << 16) | (g << 8) | r;  // for little-endian machines, which all are
      for (const [cell, extent] of this.inSight(this.bins[painted], viewport, width, height)) {
        if (extent >= SMALL) {
          large[painted].push([cell, extent]);
          continue;
        }
        const i = 4 * cell;
        const left = Math.max(0, Math.floor(this.boxes[i] * scale + move[0]));
        const right = Math.min(size[0] - 1, Math.floor(this.boxes[i + 2] * scale + move[0]));
        const low = Math.min(size[1] - 1, Math.floor(move[1] - this.boxes[i + 1] * scale));
        for (let y = Math.max(0, Math.floor(move[1] - this.boxes[i + 3] * scale)); y <= low; ++y) {
          pixels.fill(colour, y * size[0] + left, y * size[0] + right + 1);
        }
      }
    }
    pen.putImageData(image, 0, 0);
    return large;
  }
}

/** The view of one snapshot of a 2-D mesh in the element `host`. Views with the same viewport move together. */
class View2d {
  constructor(host, scene, paths, table, snapshot, viewport, crosses) {
    Object.assign(this, {host, snapshot, viewport});
    this.draw(scene, paths, table);
    host.append(this.drawing.node);
    this.overlay = new Overlay(host, scene.worst[snapshot], crosses);
    this.centre = scene.centre;
    viewport.views.push(this);
    steer(host, viewport);
    new ResizeObserver(() => this.follow(viewport)).observe(host);
    this.probe = document.createElement('canvas').getContext('2d');
    host.addEventListener('pointermove', (event) => this.point(event));
    host.addEventListener('pointerleave', () => this.overlay.showText(''));
  }

  draw(scene, paths, table) {
    Object.assign(this, {paths, table});
    const Drawing = paths.edges.length * scene.pieces <= MOST_SVG_CURVES ? SvgDrawing : CanvasDrawing;
    this.drawing = new Drawing(paths, table, this.snapshot);
  }

  /** Shows a mesh that has moved, in place of the one before. */
  show(scene, paths, table) {
    const {node} = this.drawing;
    this.draw(scene, paths, table);
    node.replaceWith(this.drawing.node);
    this.overlay.show(scene.worst[this.snapshot], []);
    this.follow(this.viewport);
  }

  follow(viewport) {
    const [width, height] = [this.host.clientWidth, this.host.clientHeight];
    if (!width) return;
    this.drawing.follow(viewport, width, height);
    const scale = width / viewport.span;
    this.overlay.follow(([x, y]) => [width / 2 + (x - this.centre[0] - viewport.x) * scale,
      height / 2 - (y - this.centre[1] - viewport.y) * scale]);
  }

  point(event) {
    if (event.buttons) return this.overlay.showText('');
    const [x, y] = this.viewport.under(this.host, event.clientX, event.clientY);
    const boxes = this.paths.boxes(this.snapshot);
    for (let cell = 0; cell < this.paths.count; ++cell) {
      const i = 4 * cell;
      if (x < boxes[i] || y < boxes[i + 1] || x > boxes[i + 2] || y > boxes[i + 3]) continue;
      const path = new Path2D();
      this.paths.trace(this.snapshot, cell, path);
      if (!this.probe.isPointInPath(path, x, y)) continue;
      const box = this.host.getBoundingClientRect();
      return this.overlay.showText(this.table.describe(this.snapshot, cell), event.clientX - box.left, event.clientY - box.top);
    }
    this.overlay.showText('');
  }
}
