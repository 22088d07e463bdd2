// State that the 3-D views before and after share: the camera, and the choice of what is shown.

class Shared3d {
  constructor(scene, choice) {
    const [x0, y0, z0, x1, y1, z1] = scene.box;
    this.size = Math.hypot(x1 - x0, y1 - y0, z1 - z0);
    this.half = [(x1 - x0) / 2, (y1 - y0) / 2, (z1 - z0) / 2];
    this.choice = choice;
    this.views = [];
    this.camera = new THREE.PerspectiveCamera(35, 4 / 3, this.size / 1e4, this.size * 20);
    this.camera.up.set(0, 0, 1);
    this.reset();
  }

  reset() {
    this.look([0, 0, 0], this.size * 1.5);
  }

  /** Looks from a distance at a place, which is relative to the centre of the scene. */
  look(place, distance) {
    this.target = new THREE.Vector3(...place);
    this.camera.position.set(0.52, -0.72, 0.46).normalize().multiplyScalar(distance).add(this.target);
    this.camera.lookAt(this.target);
    this.follow();
  }

  follow() {
    for (const view of this.views) {
      view.controls.target.copy(this.target);
      view.controls.update();
      view.paint();
    }
  }

  /** Called when a view was turned by hand; turns the others too. */
  turned(by) {
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

  select(change) {
    Object.assign(this.choice, change);
    for (const view of this.views) view.select();
  }
}
