// State that the 3-D views before and after share: the camera, and the choice of what is shown.

const VIEW_FROM = [0.52, -0.72, 0.46];
const STANDS_AFTER = 250;  // milliseconds without a movement
const QUIET_FRAMES = 4;

class Shared3d {
  /**
   * `corners` are those of the cells that the first cut goes through, or of all cells if there are no more (scene.more, and
   * scene.makeMore(), which makes them); null if the page has curved faces of all cells, or makes all corners later. Later,
   * this.surfaces gets the surfaces of the CAD model, and this.scale a DistanceScale if the page has distances.
   */
  constructor(scene, painter, corners, choice) {
    const [x0, y0, z0, x1, y1, z1] = scene.box;
    this.size = Math.hypot(x1 - x0, y1 - y0, z1 - z0);
    this.half = [(x1 - x0) / 2, (y1 - y0) / 2, (z1 - z0) / 2];
    Object.assign(this, {scene, painter, corners, choice, hasAll: !scene.more && !scene.makeMore});
    this.isRoughWhileTurning = painter.inSoftware;
    this.turns = false;
    this.views = [];
    this.surfaces = [];
    this.scale = null;
    this.camera = new THREE.PerspectiveCamera(35, 4 / 3, this.size / 1e4, this.size * 20);
    this.camera.up.set(0, 0, 1);
    this.reset();
  }

  reset() {
    const {middle, distance} = this.frame();
    this.look(middle, distance);
  }

  /** The middle of the box of what the cut leaves, and the distance at which it fills the frame, seen as look() sees it. */
  frame() {
    const {axis, at, flip} = this.choice;
    const low = this.half.map((half) => -half);
    const high = [...this.half];
    if (axis >= 0) (flip ? low : high)[axis] = at;
    const middle = low.map((value, d) => (value + high[d]) / 2);
    const forth = new THREE.Vector3(...VIEW_FROM).normalize();
    const right = new THREE.Vector3().crossVectors(this.camera.up, forth).normalize();
    const up = new THREE.Vector3().crossVectors(forth, right);
    const tangent = Math.tan((this.camera.fov * Math.PI) / 360);
    let distance = 0;
    for (let corner = 0; corner < 8; ++corner) {
      const place = new THREE.Vector3(...middle.map((value, d) => (corner & (1 << d) ? high[d] - value : low[d] - value)));
      const across = Math.max(Math.abs(place.dot(up)) / tangent, Math.abs(place.dot(right)) / (tangent * this.camera.aspect));
      distance = Math.max(distance, across + place.dot(forth));
    }
    return {middle, distance: 1.04 * distance};
  }

  /** Looks from a distance and a direction at a place, which is relative to the centre of the scene. */
  look(place, distance, from = VIEW_FROM) {
    this.target = new THREE.Vector3(...place);
    this.camera.position.set(...from).normalize().multiplyScalar(distance).add(this.target);
    this.camera.lookAt(this.target);
    this.follow();
  }

  /** The picture moves: on a machine without a graphics card, few triangles are drawn until it stands still. */
  move() {
    if (!this.isRoughWhileTurning) return;
    this.movedAt = performance.now();
    this.quietFrames = 0;
    if (!this.turns) this.refine(false);
    if (!this.watches) requestAnimationFrame(() => this.watch());
    this.watches = true;
  }

  /** Waits until the picture stands still. Frames count too, since a slow machine moves it seldom. */
  watch() {
    this.watches = ++this.quietFrames < QUIET_FRAMES || performance.now() - this.movedAt < STANDS_AFTER;
    if (this.watches) requestAnimationFrame(() => this.watch());
    else this.refine(true);
  }

  refine(isFine) {
    this.turns = !isFine;
    for (const view of this.views) view.refine(isFine);
  }

  follow() {
    this.move();
    for (const view of this.views) {
      view.controls.target.copy(this.target);
      view.controls.update();
      view.paint();
    }
  }

  /** Called when a view was turned by hand; turns the others too. */
  turned(by) {
    this.move();
    this.target = by.controls.target.clone();
    for (const view of this.views) {
      if (view !== by) view.controls.target.copy(this.target);
      view.paint();
    }
  }

  turn(sideways, upwards) {
    const arm = this.camera.position.clone().sub(this.target).applyAxisAngle(this.camera.up, sideways);
    const across = new THREE.Vector3().crossVectors(this.camera.up, arm).normalize();
    const raised = arm.clone().applyAxisAngle(across, upwards);
    if (Math.abs(raised.z) < 0.98 * raised.length()) arm.copy(raised);
    this.camera.position.copy(this.target).add(arm);
    this.follow();
  }

  zoom(factor) {
    this.camera.position.sub(this.target).multiplyScalar(factor).add(this.target);
    this.follow();
  }

  /** Views have one shape. Until somebody turns or zooms, the mesh fills them. */
  resize(aspect) {
    const fills = Math.abs(this.camera.position.distanceTo(this.target) - this.frame().distance) < 1e-6 * this.size;
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    if (fills) this.reset();
  }

  /** The mesh has moved: what was made of the one before is made again when it is needed. */
  forget(scene) {
    Object.assign(this, {scene, corners: null, loading: null, hasAll: !scene.more && !scene.makeMore});
  }

  /** Unpacks the corners of all cells when something is shown for the first time that needs them. */
  async load() {
    if (this.hasAll) return;
    document.documentElement.dataset.busy = 'yes';
    const {scene} = this;
    this.loading ??= scene.makeMore?.() ?? unpack(document.getElementById('more').textContent, scene.more);
    const corners = new CornerCells(await this.loading, 'all');
    if (scene === this.scene) Object.assign(this, {corners, hasAll: true});
    delete document.documentElement.dataset.busy;
  }

  /** Shows only the element with this number, from near; null shows all. */
  async isolate(number) {
    if (number !== null) await this.load();
    this.select({only: number});
    const extent = number === null ? null : this.views[0].extent();
    this.onIsolate?.(number, number === null || extent !== null);
    if (number === null) this.reset();
    else if (extent) this.look(extent.place, 4 * extent.radius);
    else this.select({only: null});
  }

  /** Colours all views by 'jacobian' or, if the page has distances, by 'distance'. */
  colourBy(colour) {
    this.choice.colour = colour;
    for (const view of this.views) view.colour();
    this.onColour?.(colour);
  }

  /** Changes the choice and shows it. If one surface is shown by itself, any change shows the others again. */
  select(change) {
    if (Object.keys(change).length > 0) this.choice.surface = -1;
    Object.assign(this.choice, change);
    for (const view of this.views) view.select();
    const {axis, at, skin} = this.choice;
    const isFirst = axis < 0 || skin === 'none' || (axis === this.scene.first_cut && at === 0);
    if (!isFirst && !this.hasAll) this.load().then(() => this.select({}));
  }
}
