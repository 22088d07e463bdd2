// The picture of a CAD model: its faces in colours of their own, with their edges.

const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

/** The colour of a face as [r, g, b]: hues of faces whose numbers are near differ most. */
const faceColour = (face) => srgb(darkTheme.matches ? 0.62 : 0.8, 0.085, face * GOLDEN_ANGLE);

/** A model that came as a mesh of triangles (JobSpec.quality says how). Each face has nodes of its own. */
class CadModel {
  constructor(mesh) {
    const names = new Map(mesh.groups.map(({tag, name}) => [tag, name]));
    const index = new Map();
    this.faces = [];
    this.triangles = joinedArrays(Uint32Array, mesh.blocks.map(({nodes}) => nodes));
    this.faceOfNode = new Uint32Array(mesh.xyz.length / 3);
    for (const {entity, nodes} of mesh.blocks) {
      if (!index.has(entity)) index.set(entity, this.faces.push({tag: entity, name: names.get(entity) ?? '', area: 0}) - 1);
      for (const node of nodes) this.faceOfNode[node] = index.get(entity);
    }
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    mesh.xyz.forEach((value, i) => { [low[i % 3], high[i % 3]] = [Math.min(low[i % 3], value), Math.max(high[i % 3], value)]; });
    this.box = [...low, ...high];
    this.sizes = high.map((value, d) => value - low[d]);
    this.centre = high.map((value, d) => value / 2 + low[d] / 2);
    this.xyz = Float32Array.from(mesh.xyz, (value, i) => value - this.centre[i % 3]);
    this.measure();
  }

  /** Adds up the areas of the triangles of each face. */
  measure() {
    const [a, b, c] = [0, 1, 2].map(() => new THREE.Vector3());
    for (let i = 0; i < this.triangles.length; i += 3) {
      [a, b, c].forEach((corner, k) => corner.fromArray(this.xyz, 3 * this.triangles[i + k]));
      this.faces[this.faceOfNode[this.triangles[i]]].area += b.sub(a).cross(c.sub(a)).length() / 2;
    }
  }

  /** The ends of the sides that only one triangle of a face has: the face's edges. */
  edges() {
    const ends = new Map();
    const nodes = this.xyz.length / 3;
    for (let i = 0; i < this.triangles.length; i += 3) {
      for (let k = 0; k < 3; ++k) {
        const [from, to] = [this.triangles[i + k], this.triangles[i + (k + 1) % 3]];
        const key = Math.min(from, to) * nodes + Math.max(from, to);
        if (!ends.delete(key)) ends.set(key, [from, to]);
      }
    }
    return Uint32Array.from([...ends.values()].flat());
  }

  describe(face) {
    const {tag, name} = this.faces[face];
    return `face ${tag}${name ? ` “${name}”` : ''}`;
  }
}

/** Draws the faces of a model. */
class DrawnModel extends Surface3d {
  constructor(world, model) {
    super(world);
    Object.assign(this, {model, ends: model.edges()});
    this.faces = {cells: Uint32Array.from(model.faces, (_, face) => face), faceOf: (node) => model.faceOfNode[node], distances: () => undefined};
    const place = new THREE.BufferAttribute(model.xyz, 3);
    this.surface.setAttribute('position', place);
    this.surface.setIndex(new THREE.BufferAttribute(model.triangles, 1));
    this.surface.computeVertexNormals();
    this.outline.setAttribute('position', place);
    this.colour();
  }

  colour() {
    const colours = this.model.faces.map((_, face) => faceColour(face).map((value) => linearPart(value) * 65535));
    const all = Uint16Array.from({length: this.model.xyz.length}, (_, i) => colours[this.model.faceOfNode[Math.floor(i / 3)]][i % 3]);
    this.surface.setAttribute('color', new THREE.BufferAttribute(all, 3, true));
    this.drawEdges(this.solid.transparent);
  }

  /** Shows the faces for which shown(face) is true. */
  show(shown, seeThrough) {
    const {faceOfNode, triangles} = this.model;
    const isShown = this.model.faces.map((_, face) => shown(face));
    this.surface.setIndex(new THREE.BufferAttribute(triangles.filter((_, i) => isShown[faceOfNode[triangles[i - i % 3]]]), 1));
    this.outline.setIndex(new THREE.BufferAttribute(this.ends.filter((node) => isShown[faceOfNode[node]]), 1));
    this.mesh.visible = this.lines.visible = this.surface.index.count > 0;
    Object.assign(this.solid, {transparent: seeThrough, opacity: seeThrough ? 0.25 : 1, depthWrite: !seeThrough});
    this.solid.needsUpdate = true;
    this.drawEdges(seeThrough);
  }

  /** While the model is turned without a graphics card, many edges are left out. */
  refine(isFine) {
    this.lines.visible = this.mesh.visible && (isFine || this.outline.index.count < MOST_ROUGH_EDGES);
  }
}

/** The view of a model. */
class ModelView extends View3d {
  constructor(host, scene, model, shared) {
    const table = {numbers: model.faces.map(({tag}) => tag), describe: (_, face) => model.describe(face)};
    super(host, scene, {}, model, table, 'model', shared, []);
    this.colour();
  }

  draw(model) {
    return [new DrawnModel(this.world, model)];
  }

  colour() {
    this.canvas.setAttribute('aria-label', 'the CAD model, each face in a colour of its own');
    for (const one of this.drawn) one.colour();
    this.paint();
  }

  select() {
    const {skin, only} = this.shared.choice;
    for (const one of this.drawn) one.show((face) => only === null || this.table.numbers[face] === only, skin === 'through' && only === null);
    this.paint();
  }
}

/** Adds the view of a model with its controls. Returns {isolate(tag), dispose()}; null if the browser cannot draw it. */
function modelPicture(section, model) {
  const painter = Painter3d.create();
  if (!painter) {
    section.append(make('p', {}, 'This browser cannot draw in three dimensions (WebGL 2), so there is no picture.'));
    return null;
  }
  const scene = {box: model.box, centre: model.centre, worst: {model: []}};
  const shared = new Shared3d(scene, painter, null, {axis: -1, at: 0, flip: true, skin: 'solid', only: null});
  const box = make('div', {class: 'view view-size'});
  section.append(make('div', {class: 'columns'}, make('figure', {}, box)), make('div', {class: 'controls'},
      labelled('Faces', choice(['solid', 'see-through'], 0, (i) => shared.select({skin: SKINS[i]}))), button('All faces', () => shared.isolate(null)),
      button('Zoom in', () => shared.zoom(0.7)), button('Zoom out', () => shared.zoom(1 / 0.7)), button('Save as PNG', () => savePictures(shared)),
      make('span', {class: 'quiet small'}, 'Drag to turn. A double click shows only the face under it, or all again. After a click on the picture, the wheel and the keys + and − zoom, and the arrow keys turn.')));
  shared.views.push(new ModelView(box, scene, model, shared));
  shared.follow();
  return {
    isolate: (tag) => shared.isolate(tag),
    dispose() {
      for (const view of shared.views) view.dispose();
      painter.dispose();
    },
  };
}
