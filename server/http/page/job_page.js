// The page of one job: its progress, its pictures, its files, and the form for the next run.

const REDRAW_EVERY = 400;  // milliseconds between two drawings of the curves

/** The iterations of a job as columns, and its log. */
class Progress {
  constructor(section) {
    this.history = {iteration: [], phase: [], energy: [], residual: [], seconds: [], min_scaled_jacobian: [], invalid_elements: []};
    this.line = make('p', {class: 'readout', role: 'status'});
    this.curves = make('div');
    this.log = make('pre', {class: 'log', tabindex: 0, role: 'region', 'aria-label': 'Log'});
    section.append(this.line, this.curves, make('details', {}, make('summary', {}, 'Log'), this.log));
    this.drawn = 0;
  }

  take(event) {
    if (event.log) this.log.append(`${instant(event.time)} ${event.log.text ?? event.log.message ?? ''}\n`);
    if (event.stateChange) this.log.append(`${instant(event.time)} ${event.stateChange.state.replace('JOB_STATE_', '').toLowerCase()}\n`);
    if (event.bookmark?.work?.secondsLeft !== undefined && this.said) this.say(event.bookmark.work.secondsLeft);
    if (!event.iteration) return;
    const one = event.iteration;
    const {history} = this;
    if (one.number <= history.iteration.at(-1)) for (const list of Object.values(history)) list.length = 0;  // Another attempt counts from 1 again.
    history.iteration.push(one.number);
    history.phase.push((one.phase ?? '').replace('PHASE_', '').toLowerCase());
    history.energy.push(one.energy ?? 0);
    history.residual.push(one.residual ?? 0);
    history.seconds.push(one.seconds ?? 0);
    history.min_scaled_jacobian.push(one.minScaledJacobian ?? 0);
    history.invalid_elements.push(countOf(one.invalidElements));
    this.said = `${history.phase.at(-1)} ${one.number}: ${grouped(history.invalid_elements.at(-1))} not certified, smallest scaled Jacobian at most ` +
        `${jacobian(history.min_scaled_jacobian.at(-1))}, ${duration(history.seconds.at(-1))}`;
    this.say(one.secondsLeft);
    if (Date.now() - this.drawn > REDRAW_EVERY) this.draw();
  }

  /** Says how far the run is, and how long it will still take if the server estimates that. */
  say(secondsLeft) {
    this.line.textContent = [this.said, shareText(this.history.seconds.at(-1), secondsLeft)].filter(Boolean).join(' · ');
  }

  /** The job has ended: no time is left, and the curves have their last points. */
  end() {
    if (this.said) this.say();
    this.draw();
  }

  draw() {
    if (!this.history.iteration.length) return;
    this.drawn = Date.now();
    this.curves.style.minHeight = `${this.curves.offsetHeight}px`;  // So that what stands below does not move.
    this.curves.replaceChildren();
    convergence(this.curves, this.history);
  }
}

/** Lets one choose a format of the server, and saves the result in it. */
async function downloads(job, signal) {
  const {outputFormats = []} = await askFor('info', {signal});
  const own = job.results[0].format;
  const formats = [own, ...outputFormats.filter((format) => format !== own && !PICTURE_FORMATS.includes(format))];
  let chosen = 0;
  const names = formats.map((format) => shortFormat(format).toLowerCase().replaceAll('_', '-'));
  const get = button('Download', async () => {
    get.disabled = true;
    await download(job, formats[chosen], stemOf(betterName(meshFileOf(job))), signal).catch((error) => signal.aborted || tell(error.message, true));
    get.disabled = false;
  });
  return make('div', {class: 'controls', id: 'downloads'}, labelled('Format', choice(names, 0, (i) => { chosen = i; })), get);
}

/** The fields for a CAD model; null if the server takes none for such a mesh. `order`: of the mesh that the job was made for. */
function geometryFields(job, order, {takesGeometries}) {
  if (!takesGeometries || job.metrics?.mesh?.dimension !== 3) return null;
  return new GeometryFields(order === 1, job.spec.geometry);
}

/** The spec of the next run: all that the last one had, but for what the form shows. */
async function nextSpec(job, form, model, layers, keepOrders) {
  const {quality, labels, outputs = [], ...rest} = job.spec;
  const own = quality ? [] : outputs.filter((format) => !PICTURE_FORMATS.includes(format));
  const options = form.options();
  return {...rest, labels, options, keepOrders: keepOrders.value, layers: layers.spec(options), outputs: [...(own.length ? own : ['MESH_FORMAT_UNSPECIFIED']), ...PICTURE_FORMATS],
    geometry: model ? await model.spec() : rest.geometry};
}

/** The form for a run on this job's mesh, with the options of the last one, and the same for a terminal and Python. */
async function runForm(job, order, groups, signal) {
  const {options, layers: before} = job.spec;
  const [schemas, info] = await Promise.all([schemasOfMessages(), askFor('info', {signal})]);
  signal.throwIfAborted();
  const model = geometryFields(job, order, info);
  const keepOrders = new OptionField('keepOrders', schemas['varimesh.v1.JobSpec'].properties.keepOrders, schemas);
  keepOrders.value = job.spec.keepOrders;
  const form = new OptionForm(schemas, before?.spacing ? {...options, layerSpacing: before.spacing} : options ?? {}, [keepOrders], Boolean(info.device));
  const spacing = form.fields.find(({name}) => name === 'layerSpacing');
  const layers = new LayerFields(schemas, before ?? {}, groups, spacing);
  modelField = model;
  if (waitingModel?.job === job.name) {
    if (model) model.take(waitingModel.model);
    else tell(`${waitingModel.model.name} is not used: this server reads no CAD models, or the mesh is plane.`, true);
    waitingModel = null;
  }
  const section = addSection('run', isJudged(job) ? 'Optimise' : 'Run again');
  const start = make('button', {type: 'submit', class: 'main'}, isJudged(job) ? 'Optimise' : 'Run with these options');
  const node = make('form', {}, form.node, layers.node, ...(model ? [model.node] : []), make('div', {class: 'controls'}, start));
  const run = async () => {
    const {name} = await submitSpec(await nextSpec(job, form, model, layers, keepOrders));
    if (!signal.aborted) location.hash = `#/${name}`;
  };
  node.addEventListener('submit', async (event) => {
    event.preventDefault();
    start.disabled = true;
    await run().catch((error) => tell(error.message, true));
    start.disabled = false;
  });
  section.append(node, commandTexts(meshFileOf(job), node, [...form.fields.filter((field) => field !== spacing), keepOrders, layers, ...(model ? [model] : [])], Boolean(model?.straight)), ...notInTexts(job.spec, model));
}

/** Draws the mesh, or both meshes. Returns the mesh that the job was made for. */
async function showPicture(section, job, signal) {
  const note = make('p', {class: 'quiet', role: 'status'}, 'Fetching the picture …');
  section.append(note);
  let before = await (isJudged(job) ? cellsAfter(job, signal) : cellsBefore(job, signal));
  const after = isJudged(job) ? null : await cellsAfter(job, signal);
  signal.throwIfAborted();
  const {mesh} = before;
  note.remove();
  if (after && !after.orderLike(before)) {
    section.append(make('p', {class: 'quiet'}, 'The result does not have the same elements as the mesh before, so only the result is shown.'));
    before = after;
  }
  const groups = job.metrics?.unrepairable ?? [];
  const {scene, arrays} = makeScene(before, after === before ? null : after, new Set(groups.flatMap((group) => (group.elements ?? []).map(Number))));
  const crosses = groups.map((group) => ({place: [group.x ?? 0, group.y ?? 0, group.z ?? 0]}));
  const views = (scene.dimension === 2 ? pictures2d : pictures3d)(section, scene, arrays, new CellTable(scene, arrays), crosses, []);
  signal.addEventListener('abort', () => views.dispose?.());
  section.append(make('div', {class: 'columns'}, ...scene.snapshots.map((name) => worstTableOf(scene, name, views.go))), groupTable(before.mesh));
  return mesh;
}

/** The worst elements of a mesh, each with a button that shows it. */
function worstTableOf(scene, snapshot, go) {
  const rows = scene.worst[snapshot].map((one) => [numberCell(one.number, String(one.number)), one.shape, numberCell(one.scaled_jacobian, jacobian(one.scaled_jacobian)),
    go ? button('Show', () => go(one.place, one.size)) : '']);
  return table(scene.snapshots.length > 1 ? `The worst elements ${snapshot}` : 'The worst elements',
      [{text: 'Element', class: 'number'}, 'Shape', {text: 'Scaled Jacobian', class: 'number'}, 'Action'], rows);
}

/** What has come of the call at the end of a job; empty: it has none. */
function callText({webhookCall}) {
  if (!webhookCall) return '';
  if (webhookCall.state === 'STATE_DELIVERED') return 'webhook called';
  return `webhook ${webhookCall.state === 'STATE_WAITING' ? 'not called yet' : 'given up'}${webhookCall.error ? `: ${webhookCall.error}` : ''}`;
}

/** What to do with a job besides looking. */
function jobButtons(job) {
  const name = job.name.slice(5, 13);
  if (!hasEnded(job)) return [sureButton('Cancel', `Cancel ${name}`, () => cancelJob(job.name))];
  return [sureButton('Delete', `Delete ${name}`, async () => {
    await deleteJob(job.name);
    location.hash = '#/jobs';
  })];
}

async function showJob(name, signal) {
  let job = await getJob(name, signal);
  signal.throwIfAborted();
  document.title = `${fileOf(job)} – VariMesh`;
  const section = addSection('job', fileOf(job));
  const line = make('p', {id: 'state', 'data-state': stateWord(job)});
  const buttons = make('div', {class: 'controls'});
  const describe = () => {
    line.dataset.state = stateWord(job);
    line.textContent = [workWord(job), stateWord(job), isModel(job) && !job.error ? '' : outcomeOf(job), hasEnded(job) ? `took ${duration(secondsRun(job))}` : '', callText(job), job.name]
        .filter(Boolean).join(' · ');
    buttons.replaceChildren(...jobButtons(job));
  };
  describe();
  section.append(line, buttons);
  const progress = new Progress(section);
  const mesh = make('div');
  section.append(mesh);
  ready();
  const ended = new AbortController();
  signal.addEventListener('abort', () => ended.abort());
  const wasOver = hasEnded(job);  // then its events tell of the past
  if (!wasOver && !isJudged(job)) followMesh(name, mesh, ended.signal);
  job = await follow(name, (event) => {
    progress.take(event);
    if (wasOver || !event.stateChange) return;
    Object.assign(job, {state: event.stateChange.state});
    if (!hasEnded(job)) describe();
  }, signal).finally(() => ended.abort());
  signal.throwIfAborted();
  progress.end();
  describe();
  if (isModel(job)) return showModel(job, signal);
  if (job.metrics?.mesh) buttons.after(figures(job), warnings(job));
  if (!isJudged(job) && job.results?.length) {
    const choices = await downloads(job, signal);
    signal.throwIfAborted();
    buttons.append(choices);
  }
  if (isJudged(job)) judged.set(job.spec.mesh.digest, job.name);
  let order = isJudged(job) || !job.spec.geometry?.order ? job.metrics?.mesh?.order : 1;
  let groups = [];
  if (job.results?.length) {
    const picture = addSection('pictures', 'The mesh, coloured by scaled Jacobian');
    const mesh = await showPicture(picture, job, signal).catch((error) => {
      signal.throwIfAborted();
      picture.append(make('p', {class: 'lost'}, error.message));
    });
    if (mesh) [order, groups] = [mesh.order, boundaryGroups(mesh)];
  }
  signal.throwIfAborted();
  await runForm(job, order, groups, signal);
}
