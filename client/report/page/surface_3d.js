// Coloured faces with their edges, as objects of the library. Faces and elements that are drawn extend it.

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

  /** Gives the edges the theme's colour. Those of faces that one can see through are faint. */
  drawEdges(seeThrough) {
    this.ink.color.set(darkTheme.matches ? 0xdfe6ea : 0x141c22);
    this.ink.opacity = (seeThrough ? 0.12 : 0.55) * (darkTheme.matches ? 0.6 : 1);
  }
}

/** The part of a colour, from 0 to 1, in the linear colour space of the library; `value` is from 0 to 255. */
function linearPart(value) {
  return ((value / 255 + 0.055) / 1.055) ** 2.4;
}
