// What the page says about a job and its meshes, in words, figures and tables.

const stateWord = (job) => job.state.replace('JOB_STATE_', '').toLowerCase();
const fileOf = (job) => job.spec?.labels?.file ?? job.name;
/** The name of the file of a job's mesh, for names of files and for commands. */
const meshFileOf = (job) => job.spec?.labels?.file ?? 'mesh.msh';
const isJudged = (job) => job.spec?.quality !== undefined;
/** What a job does, in a word. */
const workWord = (job) => (isModel(job) ? 'CAD model' : isJudged(job) ? 'quality' : 'optimise');
const countOf = (value) => Number(value ?? 0);

const MOST_LABEL_BYTES = 128;  // the contract's limit

/** The label for a file of this name: its end, if it is too long. */
function labelOf(name) {
  const bytes = new TextEncoder().encode(name);
  let from = Math.max(0, bytes.length - MOST_LABEL_BYTES);
  while ((bytes[from] & 0xc0) === 0x80) ++from;
  return new TextDecoder().decode(bytes.subarray(from));
}

/** Seconds that a job has run; null if it has not begun. */
function secondsRun(job) {
  if (!job.startTime) return null;
  return (new Date(job.endTime ?? Date.now()) - new Date(job.startTime)) / 1000;
}

/**
 * "40 %, 1 min 05 s left" after so many seconds of a run, if its server estimates what is left; otherwise "40 %" if it has a time
 * limit; otherwise empty.
 */
function shareText(seconds, left, limit) {
  const share = (of) => `${Math.max(0, Math.min(99, Math.floor((100 * seconds) / of)))} %`;
  if (left !== undefined) return `${share(Math.max(seconds + left, 1e-9))}, about ${duration(left)} left`;
  return limit ? share(limit) : '';
}

/** How far a job has come: the share of its time that has passed, as far as it is known, and what its last iteration says. */
function progressOf(job) {
  if (job.state === 'JOB_STATE_SUCCEEDED') return '100 %';
  if (hasEnded(job) || !job.startTime) return '–';
  const {seconds, secondsLeft} = job.iteration ?? {};
  const share = shareText(secondsLeft === undefined ? secondsRun(job) : seconds ?? 0, secondsLeft, job.spec.options?.timeLimit);
  const parts = share ? [share] : [];
  if (job.iteration) parts.push(`iteration ${grouped(job.iteration.number)}`, `${grouped(countOf(job.iteration.invalidElements))} not certified`);
  return parts.join(', ') || 'reading';
}

/** What came of a job, in one line. */
function outcomeOf(job) {
  if (job.error) return job.error.message;
  if (!job.metrics?.mesh) return '';
  if (isModel(job)) return job.metrics.notes?.[0] ?? '';
  return uncertifiedOf(job.metrics) > 0 ? `${leftOf(job.metrics)} not certified valid` : 'all elements certified valid';
}

/** The most important figures of a job's mesh, or of the meshes before and after. */
function figures(job) {
  const {mesh, before, after, iterations, seconds, device} = job.metrics;
  const pair = (show, pick) => (isJudged(job) ? [show(pick(after))] : [make('small', {}, `${show(pick(before))} → `), show(pick(after))]);
  const tile = (name, ...content) => make('div', {class: 'tile'}, make('dt', {}, name), make('dd', {}, ...content));
  const all = [
    tile('Smallest scaled Jacobian', ...pair(jacobian, (one) => one.minScaledJacobian ?? 0)),
    tile('Mean scaled Jacobian', ...pair(jacobian, (one) => one.meanScaledJacobian ?? 0)),
    tile('Invalid elements', ...pair(grouped, (one) => countOf(one.invalidElements))),
    tile('Certified valid', ...pair(grouped, (one) => countOf(one.certified?.valid))),
    tile('Mesh', grouped(countOf(mesh.elements)), make('small', {}, ` ${countOf(mesh.elements) === 1 ? 'element' : 'elements'} of order ${mesh.order}, ${mesh.dimension}\u2011D`)),
  ];
  const where = device ? `, on ${device}` : '';
  if (!isJudged(job)) all.push(tile('Iterations', grouped(iterations ?? 0), make('small', {}, ` in ${duration(seconds ?? 0)}${where}`)));
  return make('dl', {class: 'tiles'}, ...all);
}

/** How many elements of the result, or of the mesh that was judged, are not certified valid. */
const uncertifiedOf = ({mesh, after}) => countOf(mesh.elements) - countOf(after?.certified?.valid);
/** "2 of 10 elements" that are not certified valid. */
const leftOf = (metrics) => `${grouped(uncertifiedOf(metrics))} of ${counted(countOf(metrics.mesh.elements), 'element')}`;

/** What to do in this page for a remedy, by the end of its kind. */
const REMEDY_ACTIONS = {
  OPTIMISE: () => 'Optimise the mesh',
  MORE_TIME: () => 'Give the run more time',
  UNTIL_VALID: () => 'Set until to valid',
  RAISE_ORDER: ({order}) => `Set order to ${order}`,
  SPLIT: () => 'Set repair to split',
  SLIDE: () => 'Choose a CAD model, on which boundary nodes then slide',
  OTHER_BOUNDARY: () => 'Mesh the boundary anew or refine it',
};

/** A remedy in the words of this page. */
function remedyText(remedy) {
  const action = REMEDY_ACTIONS[remedy.kind?.replace('KIND_', '')];
  return action ? `${action(remedy)}: ${remedy.reason}` : remedy.sentence;
}

/** What somebody who uses the mesh should know: whether it is valid, what to try if it is not, and notes. */
function warnings(job) {
  const {left, geometry, notes = []} = job.metrics;
  const uncertified = uncertifiedOf(job.metrics);
  const isValid = uncertified === 0;
  const remedies = (left?.remedies ?? []).map(remedyText);
  const lines = [...(isValid ? [] : remedies), ...notes, ...(geometry?.sentences ?? [])].filter(Boolean);
  const sentence = isValid ? 'All elements are certified valid.' : left?.sentence || `${leftOf(job.metrics)} ${uncertified === 1 ? 'is' : 'are'} not certified valid.`;
  return make('div', {id: 'verdict'}, make('p', {class: `verdict ${isValid ? 'good' : 'bad'}`}, sentence),
      ...(lines.length ? [make('ul', {class: 'warnings'}, ...lines.map((text) => make('li', {}, text)))] : []));
}

/** The groups of a mesh, with how many elements each has. */
function groupTable(mesh) {
  const counts = new Map();
  for (const {shape, physical, nodes} of mesh.blocks) {
    const dimension = SHAPES[shape]?.dimension ?? 0;
    const each = dimension === 0 ? 1 : latticeOf(shape, mesh.order).length;
    for (const tag of physical) {
      const key = `${dimension}:${tag}`;
      counts.set(key, (counts.get(key) ?? 0) + nodes.length / each);
    }
  }
  const names = new Map(mesh.groups.map(({dimension, tag, name}) => [`${dimension}:${tag}`, name]));
  for (const key of names.keys()) if (!counts.has(key)) counts.set(key, 0);
  if (counts.size === 0) return make('p', {class: 'quiet'}, 'The mesh has no physical groups.');
  const rows = [...counts].sort().map(([key, count]) => [names.get(key) ?? '–', ...key.split(':').map((value) => numberCell(Number(value), value)), numberCell(count)]);
  return table('Physical groups', ['Name', {text: 'Dimension', class: 'number'}, {text: 'Tag', class: 'number'}, {text: 'Elements', class: 'number'}], rows);
}

/** A button that acts at its second click within five seconds. */
function sureButton(text, label, act) {
  let until = 0;
  const node = button(text, async () => {
    if (Date.now() > until) {
      until = Date.now() + 5000;
      node.textContent = `${text}: click again`;
      setTimeout(() => { node.textContent = text; }, 5000);
      return;
    }
    node.disabled = true;
    await act().catch((error) => {
      node.disabled = false;
      tell(error.message, true);
    });
  });
  node.setAttribute('aria-label', label);
  return node;
}
