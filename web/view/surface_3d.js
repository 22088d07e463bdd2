// What draws in three dimensions: the painter, and coloured faces with their edges, as objects of the library.

/** Coloured faces with their edges. Faces and elements that are drawn extend it. */
class Surface3d {
  constructor(scene) {
    this.surface = new THREE.BufferGeometry();
    this.outline = new THREE.BufferGeometry();
    this.solid = new THREE.MeshLambertMaterial({vertexColors: true, side: THREE.DoubleSide, polygonOffset: true,
      polygonOffsetFactor: 1, polygonOffsetUnits: 1});
    this.ink = new THREE.LineBasicMaterial({transparent: true});
    this.mesh = new THREE.Mesh(this.surface, this.solid);
    this.lines = new THREE.LineSegments(this.outline, this.ink);
    scene.add(this.mesh, this.lines);
  }

  dispose() {
    for (const one of [this.surface, this.outline, this.solid, this.ink]) one.dispose();
  }

  /** Gives the edges the theme's colour. Those of faces that one can see through are faint. */
  drawEdges(seeThrough) {
    this.ink.color.set(darkTheme.matches ? 0xdfe6ea : 0x141c22);
    this.ink.opacity = (seeThrough ? 0.12 : 0.55) * (darkTheme.matches ? 0.6 : 1);
  }
}

/**
 * Draws for all views, which copy its pictures: on a machine without a graphics card, each context costs about a second. There
 * it also does without smooth edges, which cost as much again.
 */
class Painter3d {
  /** A painter; null if the browser cannot draw in three dimensions. */
  static create() {
    const canvas = document.createElement('canvas');
    const context = canvas.getContext('webgl2', {alpha: true, antialias: false});
    if (!context) return null;
    const facts = context.getExtension('WEBGL_debug_renderer_info');
    const machine = context.getParameter(facts ? facts.UNMASKED_RENDERER_WEBGL : context.RENDERER);
    const inSoftware = /swiftshader|llvmpipe|softpipe|software|basic render/i.test(machine);
    return new Painter3d(inSoftware ? {canvas, context} : {antialias: true, alpha: true}, inSoftware);
  }

  constructor(choice, inSoftware) {
    this.inSoftware = inSoftware;
    this.renderer = new THREE.WebGLRenderer(choice);
    this.renderer.setPixelRatio(1);
  }

  /** Gives the WebGL context back to the browser, which has only a few. */
  dispose() {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Draws a world into the canvas of a view. */
  paint(world, camera, canvas) {
    const drawn = this.renderer.domElement;
    if (drawn.width !== canvas.width || drawn.height !== canvas.height) this.renderer.setSize(canvas.width, canvas.height, false);
    this.renderer.render(world, camera);
    const context = canvas.getContext('2d');
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(drawn, 0, 0);
  }
}

/** The part of a colour, from 0 to 1, in the linear colour space of the library; `value` is from 0 to 255. */
function linearPart(value) {
  return ((value / 255 + 0.055) / 1.055) ** 2.4;
}
