// Views of a 3-D mesh that can be turned: its boundary, and the elements behind a cut or below a threshold.

const MOST_ROUGH_EDGES = 10000;  // ends of edges that are drawn while a mesh is turned without a graphics card

/** The colours of all points of a face set, in the linear colour space of the library. */
function pointColours(faces, table, snapshot) {
  const linear = (value) => linearPart(value) * 65535;
  const bins = Array.from({length: COLOURS}, (_, bin) => colourOf((bin + 0.5) / COLOURS).map(linear));
  const invalid = colourOf(-1).map(linear);
  const colours = new Uint16Array(3 * faces.cells.length * faces.pattern.count);
  let next = 0;
  for (const cell of faces.cells) {
    const js = table.js[snapshot][cell];
    const colour = js > 0 ? bins[Math.min(COLOURS - 1, Math.floor(js * COLOURS))] : invalid;
    for (let i = 0; i < faces.pattern.count; ++i) for (let c = 0; c < 3; ++c) colours[next++] = colour[c];
  }
  return colours;
}

/** Draws one set of faces. What the library needs is made when faces are shown for the first time. */
class DrawnFaces extends Surface3d {
  constructor(scene, faces, table, snapshot, shared) {
    super(scene);
    Object.assign(this, {faces, table, snapshot, shared, made: false});
    this.mesh.visible = this.lines.visible = false;
  }

  make() {
    this.made = true;
    const place = new THREE.BufferAttribute(this.faces.positions(this.snapshot), 3);
    this.surface.setAttribute('position', place);
    this.surface.setIndex(new THREE.BufferAttribute(this.faces.select(this.faces.pattern.triangles, () => true), 1));
    this.surface.computeVertexNormals();
    this.outline.setAttribute('position', place);
    this.colour();
  }

  colour() {
    if (!this.made) return;
    const {scale, choice} = this.shared;
    const colours = choice.colour === 'distance' ? distanceColours(this.faces, scale, this.snapshot) : pointColours(this.faces, this.table, this.snapshot);
    this.surface.setAttribute('color', new THREE.BufferAttribute(colours, 3, true));
    this.drawEdges(this.solid.transparent);
  }

  /** Shows the faces for which shown(cell, face) is true. Returns how many triangles they have. */
  show(shown, seeThrough) {
    const triangles = this.faces.select(this.faces.pattern.triangles, shown);
    this.mesh.visible = this.lines.visible = triangles.length > 0;
    if (triangles.length === 0) return 0;
    if (!this.made) this.make();
    const index = (pattern) => new THREE.BufferAttribute(this.faces.select(pattern, shown), 1);
    this.fine = [new THREE.BufferAttribute(triangles, 1), index(this.faces.pattern.lines)];
    this.rough = this.shared.isRoughWhileTurning ? [index(this.faces.coarse.triangles), index(this.faces.coarse.lines)] : this.fine;
    this.refine(!this.shared.turns);
    Object.assign(this.solid, {transparent: seeThrough, opacity: seeThrough ? 0.12 : 1, depthWrite: !seeThrough});
    this.solid.needsUpdate = true;
    this.drawEdges(seeThrough);
    return triangles.length / 3;
  }

  /** Draws all triangles, or one or two of each face, and then no edges if there are many. */
  refine(isFine) {
    if (!this.fine) return;
    const [triangles, lines] = isFine ? this.fine : this.rough;
    this.surface.setIndex(triangles);
    this.outline.setIndex(lines);
    this.lines.visible = this.mesh.visible && (isFine || lines.count < MOST_ROUGH_EDGES);
  }
}

/** The view of one snapshot in the element `host`. Views share the camera and the choice of what is shown. */
class View3d {
  constructor(host, scene, arrays, sets, table, snapshot, shared, crosses) {
    Object.assign(this, {host, table, snapshot, shared, centre: scene.centre, middles: arrays.middles});
    this.whole = scene.whole === scene.cells;
    this.canvas = make('canvas', {role: 'img', 'aria-label': `the mesh ${snapshot}, coloured by scaled Jacobian`});
    host.append(this.canvas);
    this.world = new THREE.Scene();
    this.world.add(new THREE.HemisphereLight(0xffffff, 0xc8c8c8, 2.2));
    this.lamp = new THREE.DirectionalLight(0xffffff, 1.3);
    this.world.add(this.lamp);
    this.drawn = this.draw(sets);
    this.drawnCells = scene.corners ? new DrawnCells(this.world, snapshot, shared) : null;
    this.overlay = new Overlay(host, scene.worst[snapshot], crosses);
    this.controls = new THREE.OrbitControls(shared.camera, host);
    this.controls.enableZoom = false;
    host.tabIndex = 0;
    host.addEventListener('focus', () => { this.controls.enableZoom = true; host.classList.add('active'); });
    host.addEventListener('blur', () => { this.controls.enableZoom = false; host.classList.remove('active'); });
    host.addEventListener('pointerdown', () => host.focus({preventScroll: true}));
    this.controls.addEventListener('change', () => shared.turned(this));
    host.addEventListener('pointermove', (event) => this.point(event));
    host.addEventListener('dblclick', (event) => this.isolate(event));
    host.addEventListener('pointerleave', () => this.overlay.showText(''));
    host.addEventListener('keydown', (event) => this.press(event));
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(host);
    followTheme(host, () => this.colour());
    this.select();
    this.resize();
  }

  draw(sets) {
    return sets.map((faces) => new DrawnFaces(this.world, faces, this.table, this.snapshot, this.shared));
  }

  /** Shows a mesh that has moved, in place of the one before. */
  show(scene, arrays, sets, table) {
    for (const one of this.drawn) {
      this.world.remove(one.mesh, one.lines);
      one.dispose();
    }
    Object.assign(this, {table, middles: arrays.middles});
    this.drawn = this.draw(sets);
    this.overlay.show(scene.worst[this.snapshot], []);
    this.select();
  }

  /** Colours everything anew, by what has been chosen. */
  colour() {
    const byDistance = this.shared.choice.colour === 'distance';
    const what = byDistance ? 'distance from the CAD model' : 'scaled Jacobian';
    this.host.classList.toggle('by-distance', byDistance);
    this.canvas.setAttribute('aria-label', `the mesh ${this.snapshot}, coloured by ${what}`);
    for (const one of this.drawn) one.colour();
    this.drawnCells?.colour();
    this.paint();
  }

  /**
   * Shows what has been chosen. A cut removes the cells whose middle is beyond it. If the page has only the corners of most
   * cells, those that the cut goes through are drawn with straight edges.
   */
  select() {
    const {axis, at, flip, threshold, skin, only, surface} = this.shared.choice;
    if (only !== null) return this.selectOnly(only);
    if (surface >= 0) return this.selectSurface(surface);
    const beyond = (cell) => axis >= 0 && (this.middles[3 * cell + axis] > at) !== flip;
    const poor = (cell) => this.table.js[this.snapshot][cell] < threshold;
    const cut = axis >= 0 && this.whole && skin === 'solid';
    for (const one of this.drawn) {
      if (one.faces.set === 'skin') one.show((cell) => skin !== 'none' && !beyond(cell), skin === 'through');
      else one.show((cell) => poor(cell) || (cut && !beyond(cell)), false);
    }
    const {corners} = this.shared;
    this.drawnCells?.show(corners, corners && axis >= 0 && skin !== 'none' ? corners.cutBy(this.snapshot, axis, at) : []);
    this.paint();
  }

  /** Shows one element: curved if the page has its faces, otherwise with straight edges. */
  selectOnly(number) {
    const cell = this.table.numbers.indexOf(number);
    let faces = 0;
    for (const one of this.drawn) {
      faces += one.show((candidate) => one.faces.set === 'inner' && candidate === cell, false);
    }
    const {corners} = this.shared;
    const other = faces === 0 && corners ? corners.cellOfNumber(number) : -1;
    this.drawnCells?.show(corners, other < 0 ? [] : [other]);
    this.paint();
  }

  /** Shows only the boundary that was made on one surface of the CAD model. */
  selectSurface(surface) {
    for (const one of this.drawn) one.show((_, face) => one.faces.set === 'skin' && one.faces.surfaces[face] === surface, false);
    this.drawnCells?.show(this.shared.corners, []);
    this.paint();
  }

  /** The middle of what is shown, and half its size: {place, radius}; null if nothing is shown. */
  extent() {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const {mesh, surface} of [...this.drawn, this.drawnCells].filter(Boolean)) {
      if (!mesh.visible) continue;
      const places = surface.getAttribute('position').array;
      const count = surface.index ? surface.index.count : places.length / 3;
      for (let i = 0; i < count; ++i) {
        const at = 3 * (surface.index ? surface.index.array[i] : i);
        for (let d = 0; d < 3; ++d) [low[d], high[d]] = [Math.min(low[d], places[at + d]), Math.max(high[d], places[at + d])];
      }
    }
    if (low[0] > high[0]) return null;
    return {place: low.map((value, d) => (value + high[d]) / 2), radius: Math.hypot(...low.map((value, d) => high[d] - value)) / 2};
  }

  resize() {
    const [width, height] = [this.host.clientWidth, this.host.clientHeight];
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (!width || (this.canvas.width === across && this.canvas.height === down)) return;
    Object.assign(this.canvas, {width: across, height: down});
    this.shared.resize(width / height);
    this.paint();
  }

  /** Draws all triangles, or few of them while somebody turns the mesh. */
  refine(isFine) {
    for (const one of this.drawn) one.refine(isFine);
    this.host.dataset.detail = isFine ? 'fine' : 'rough';  // whoever takes a picture of the page waits for it
    this.paint();
  }

  paint() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.render(); });
  }

  /** Gives back what the library and the browser hold for the view, which has left the page. */
  dispose() {
    this.isGone = true;
    this.observer.disconnect();
    this.controls.dispose();
    for (const one of this.drawn) one.dispose();
    this.drawnCells?.dispose();
  }

  render() {
    if (this.isGone) return;
    const {camera} = this.shared;
    this.lamp.position.copy(camera.position);
    this.shared.painter.paint(this.world, camera, this.canvas);
    if (!this.isSeen) performance.mark('picture');  // tests/bench/page waits for it
    this.isSeen = true;
    const [width, height] = [this.host.clientWidth, this.host.clientHeight];
    const turned = camera.quaternion.clone().invert();
    this.overlay.showAxes([[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => {
      const {x, y} = new THREE.Vector3(...axis).applyQuaternion(turned);
      return [x, -y];
    }));
    this.overlay.follow((place) => {
      const at = new THREE.Vector3(...place.map((value, d) => value - this.centre[d])).project(camera);
      return at.z < 1 ? [((at.x + 1) / 2) * width, ((1 - at.y) / 2) * height] : null;
    });
  }

  /** Describes the element under the pointer. */
  point(event) {
    if (event.buttons) return this.overlay.showText('');
    if (this.pointing) return;
    this.pointing = true;
    requestAnimationFrame(() => {
      this.pointing = false;
      const {x, y, text} = this.under(event);
      this.overlay.showText(text, x, y);
    });
  }

  /** The element under the pointer: its number and a line about it. Without one, the text is empty. */
  under(event) {
    const box = this.host.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((x / box.width) * 2 - 1, 1 - (y / box.height) * 2), this.shared.camera);
    const solid = [...this.drawn, this.drawnCells].filter((one) => one?.mesh.visible && !one.solid.transparent);
    const hit = ray.intersectObjects(solid.map((one) => one.mesh))[0];
    if (!hit) return {x, y, text: '', number: null};
    if (hit.object === this.drawnCells?.mesh) {
      const cell = this.drawnCells.cellOf(hit.faceIndex);
      const {cells} = this.drawnCells;
      return {x, y, text: cells.describe(this.snapshot, cell), number: cells.numbers[cell]};
    }
    const {faces} = solid.find((one) => one.mesh === hit.object);
    const face = faces.faceOf(hit.face.a);
    const cell = faces.cells[face];
    const text = this.table.describe(this.snapshot, cell) + describeDistance(faces, face, this.snapshot, this.shared.surfaces);
    return {x, y, text, number: this.table.numbers[cell]};
  }

  /** Shows only the element under the pointer, or all again. */
  isolate(event) {
    const {number} = this.under(event);
    this.shared.isolate(this.shared.choice.only === null ? number : null);
  }

  /** The picture as a PNG file, on the ground of the page and without the marks. */
  picture() {
    this.shared.refine(true);
    this.render();
    const drawn = this.canvas;
    const canvas = document.createElement('canvas');
    canvas.width = drawn.width;
    canvas.height = drawn.height;
    const context = canvas.getContext('2d');
    context.fillStyle = getComputedStyle(drawn.closest('.view')).backgroundColor;
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(drawn, 0, 0);
    return canvas.toDataURL('image/png');
  }

  press(event) {
    const turns = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
    if (turns[event.key]) this.shared.turn(...turns[event.key].map((way) => way * 0.15));
    else if (event.key === '+' || event.key === '=') this.shared.zoom(0.8);
    else if (event.key === '-') this.shared.zoom(1.25);
    else if (event.key === '0') this.shared.reset();
    else return;
    event.preventDefault();
  }
}
