// The CAD model on which the boundary slides, or from which a straight mesh is curved, if the server takes models.

const CAD_FILE = /\.(step|stp|iges|igs|brep)$/i;
const USUAL_ORDER = 3;

/** The SHA-256 of bytes, as the server names what it has. */
async function digestOf(bytes) {
  const digest = new Uint8Array(await crypto.subtle.digest('SHA-256', bytes));
  return [...digest].map((byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** Sends a CAD model and returns its digest. */
async function sendModel(file) {
  const bytes = await file.arrayBuffer();
  const digest = await digestOf(bytes);
  await request(`meshes?digest=${digest}`, {method: 'POST', headers: {'Content-Type': 'application/octet-stream'}, body: bytes});
  return digest;
}

/** The part of the form for a model. `straight`: the mesh has order 1, so it is curved. */
class GeometryFields {
  constructor(straight, before) {
    Object.assign(this, {straight, before, file: null});
    this.input = make('input', {type: 'file', id: 'model', accept: '.step,.stp,.iges,.igs,.brep', 'aria-describedby': 'model-hint'});
    this.input.addEventListener('change', () => this.take(this.input.files[0]));
    this.order = make('input', {type: 'number', id: 'model-order', min: 2, max: 10, step: 1, value: before?.order ?? USUAL_ORDER});
    this.said = make('p', {class: 'quiet small', id: 'model-hint'});
    this.node = make('div', {class: 'options'}, make('div', {class: 'option'}, make('label', {for: 'model'}, 'CAD model'), this.input, this.said),
        ...(straight ? [make('div', {class: 'option'}, make('label', {for: 'model-order'}, 'order of the curved mesh'), this.order)] : []));
    this.explain();
  }

  /** Takes a file that was chosen or dropped. */
  take(file) {
    this.file = file ?? null;
    this.explain();
    this.node.dispatchEvent(new Event('input', {bubbles: true}));
  }

  explain() {
    if (this.usesBoundary) {
      this.said.textContent = 'Boundary nodes slide on the mesh’s own boundary, as in the last run, unless there is a model.';
      return;
    }
    const what = this.straight ? 'The mesh is curved with it.' : 'Boundary nodes slide on it.';
    this.said.textContent = this.file ? `${this.file.name}. ${what}` : this.before?.digest ? `That of the last run. ${what}` : `STEP, IGES or BREP; none is needed. ${what}`;
  }

  get isGiven() {
    return this.file !== null || Boolean(this.before?.digest);
  }

  /** Whether nodes slide without a model, on the mesh's own boundary. */
  get usesBoundary() {
    return !this.isGiven && this.before?.slideOn === 'SLIDE_ON_BOUNDARY';
  }

  /** The part of a JobSpec; undefined if nothing slides. */
  async spec() {
    if (!this.isGiven) return this.before;
    const digest = this.file ? await sendModel(this.file) : this.before.digest;
    return {...this.before, digest, slideOn: undefined, ...(this.straight ? {order: Number(this.order.value)} : {})};
  }

  /** The model, and how nodes slide on it, as words of the command and as arguments in Python. */
  words() {
    if (!this.isGiven && !this.usesBoundary) return [];
    const name = this.file?.name ?? 'model.step';
    return [...(this.isGiven ? ['--geometry', name.startsWith('-') ? `./${name}` : name] : ['--slide-on', 'boundary']), ...(this.straight && this.isGiven ? ['--order', this.order.value] : []),
      ...this.settings().flatMap(([flag, , value]) => (value === true ? [flag] : [flag, String(value)]))];
  }

  argument() {
    if (!this.isGiven && !this.usesBoundary) return [];
    const name = JSON.stringify(this.file?.name ?? 'model.step');
    const more = this.settings().map(([, keyword, value]) => `${keyword}=${value === true ? 'True' : JSON.stringify(value)}`);
    if (this.straight && this.isGiven) more.unshift(`order=${this.order.value}`);
    if (!this.isGiven) return [`geometry=varimesh.Geometry(${['slide_on="boundary"', ...more].join(', ')})`];
    return [more.length ? `geometry=varimesh.Geometry(${[name, ...more].join(', ')})` : `geometry=${name}`];
  }

  /** How nodes slide, as in the last run: [flag, keyword in Python, value] of each setting that is not the default. */
  settings() {
    const {slide, snap, smoothAngle, tolerance, growth} = this.before ?? {};
    return [['--slide', 'slide', slide && slide !== 'SLIDE_UNSPECIFIED' ? slide.replace('SLIDE_', '').toLowerCase() : undefined], ['--snap', 'snap', snap],
      ['--smooth-angle', 'smooth_angle', smoothAngle], ['--geometry-tolerance', 'tolerance', tolerance], ['--refine-growth', 'growth', growth]].filter(([, , value]) => value);
  }
}
