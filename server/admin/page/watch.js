// Asks the server for its jobs every second and shows them, or asks for a token if the server wants one. With a token that
// allows it, the page cancels jobs.

const EVERY = 1000;      // milliseconds between two requests
const MOST_CURVES = 16;  // running jobs whose curves are drawn

const cards = new Map();
const sure = new Map();  // jobs whose button was clicked once, and until when the next click counts
let mayCancel = false;
let refused = false;  // until somebody types a token; asking on would fill the server's log

const byId = (id) => document.getElementById(id);
const ago = (time, now) => ({text: `${duration(Math.max(0, now - time) / 1000)} ago`, class: 'when'});

function showTiles(status) {
  const tile = (name, value, more) => make('div', {class: 'tile'}, make('dt', {}, name), make('dd', {}, value, make('small', {}, more)));
  byId('tiles').replaceChildren(
      tile('Running', grouped(status.running), ` on ${counted(status.threads, 'thread')}`),
      tile('Waiting', grouped(status.pending), ` of at most ${grouped(status.max_pending_jobs)}`),
      tile('Up for', duration((status.time - status.start_time) / 1000), ''),
      tile('Version', status.version, ''));
}

/** Keeps the card of a job as long as the job runs, so that a chart does not disappear while somebody reads it. */
async function showRunning(jobs, now) {
  const names = new Set(jobs.map((job) => job.job));
  for (const name of cards.keys()) if (!names.has(name)) cards.delete(name);
  const shown = jobs.slice(0, MOST_CURVES);
  for (const job of shown) if (!cards.has(job.job)) cards.set(job.job, new JobCard(job));
  await Promise.all(shown.map((job) => cards.get(job.job).follow().catch(() => {})));
  for (const job of shown) cards.get(job.job).tell(job, now);
  const nodes = shown.map((job) => cards.get(job.job).node);
  if (!jobs.length) nodes.push(make('p', {class: 'quiet'}, 'No job is running.'));
  if (jobs.length > MOST_CURVES) nodes.push(make('p', {class: 'quiet'}, `and ${jobs.length - MOST_CURVES} more`));
  const place = byId('running');
  if (nodes.length !== place.children.length || nodes.some((node, i) => node !== place.children[i])) place.replaceChildren(...nodes);
}

function showWaiting(jobs, now) {
  const rows = jobs.map((job, i) => [{text: grouped(i + 1), class: 'number'}, nameOf(job), make('span', {}, ...labelsOf(job)),
    numberCell(job.priority), ago(job.submitted, now), ...cancelButton(job)]);
  const head = [{text: 'Position', class: 'number'}, 'Job', 'Labels', {text: 'Priority', class: 'number'}, 'Submitted', ...(mayCancel ? [''] : [])];
  byId('waiting').replaceChildren(rows.length ? table('Waiting jobs, each caller’s in the order in which they will run', head, rows) :
      make('p', {class: 'quiet'}, 'No job is waiting.'));
}

function outcome(job) {
  if (job.error) return {text: job.error, class: 'failed'};
  if (!job.min_scaled_jacobian) return '';
  const left = job.not_certified;
  return left ? `${grouped(left)} of ${counted(job.elements, 'element')} not certified valid` : 'all elements certified valid';
}

function showEnded(jobs, now) {
  const rows = jobs.map((job) => [nameOf(job), make('span', {}, ...labelsOf(job)),
    {text: job.state, class: job.state === 'failed' ? 'when failed' : 'when'}, ago(job.ended, now),
    {text: job.began ? duration((job.ended - job.began) / 1000) : '–', class: 'number'}, numberCell(job.iterations ?? null),
    {text: job.min_scaled_jacobian ? job.min_scaled_jacobian.map(jacobian).join(' → ') : '–', class: 'number'}, outcome(job)]);
  const head = ['Job', 'Labels', 'State', 'Ended', {text: 'Took', class: 'number'}, {text: 'Iterations', class: 'number'},
    {text: 'Smallest Js', class: 'number'}, 'Outcome'];
  byId('ended').replaceChildren(rows.length ? table('Newest first, at most 100', head, rows) :
      make('p', {class: 'quiet'}, 'No job has ended.'));
}

/** Asks for a path below api/, with the token that was typed, if there is one. */
function fetchFromServer(path, method = 'GET') {
  const token = sessionStorage.getItem('token');
  return fetch('api/' + path, {method, headers: token ? {Authorization: `Bearer ${token}`} : {}});
}

/** A button that cancels the job at its second click within five seconds; nothing if the token does not allow it. */
function cancelButton(job) {
  if (!mayCancel) return [];
  const words = () => job.state === 'cancelling' ? 'Cancelling …' : sure.get(job.job) > Date.now() ? 'Click again to cancel' : 'Cancel';
  const button = make('button', {type: 'button', class: 'cancel', disabled: job.state === 'cancelling', 'aria-label': `Cancel ${job.job}`}, words());
  button.addEventListener('click', async () => {
    if (!(sure.get(job.job) > Date.now())) {
      sure.set(job.job, Date.now() + 5000);
      button.textContent = words();
      return;
    }
    sure.delete(job.job);
    button.disabled = true;
    const answer = await fetchFromServer(`cancel?job=${encodeURIComponent(job.job)}`, 'POST').catch(() => null);
    if (!answer?.ok) window.console.warn(answer ? await answer.text() : 'The server does not answer.');
    watchOnce();
  });
  return [button];
}

/** Shows why the server does not let this page in, with a field for a token. The browser forgets it with the page's tab. */
function askForToken(why) {
  refused = true;
  byId('state').className = 'lost';
  byId('state').textContent = why;
  if (byId('token').childElementCount) return;
  const field = make('input', {type: 'password', autocomplete: 'off', 'aria-label': 'Token'});
  const button = make('button', {type: 'button'}, 'Use this token');
  button.addEventListener('click', () => {
    sessionStorage.setItem('token', field.value.trim());
    byId('token').replaceChildren();
    refused = false;
    watchOnce();
  });
  byId('token').replaceChildren(field, ' ', button);
}

async function ask() {
  const answer = await fetchFromServer('status');
  if (answer.status === 401 || answer.status === 403) return askForToken(await answer.text());
  if (!answer.ok) throw new Error(await answer.text());
  byId('token').replaceChildren();
  const status = await answer.json();
  mayCancel = status.may_cancel;
  const jobs = (...states) => status.jobs.filter((job) => states.includes(job.state));
  showTiles(status);
  showWaiting(jobs('pending'), status.time);
  showEnded(jobs('succeeded', 'failed', 'cancelled'), status.time);
  await showRunning(jobs('running', 'cancelling'), status.time);
  byId('state').className = 'quiet';
  byId('state').textContent = `As of ${instant(status.time)}.${mayCancel ? '' : ' This page is read-only.'}`;
}

async function watchOnce() {
  try {
    await ask();
  } catch (error) {
    byId('state').className = 'lost';
    byId('state').textContent = 'The server does not answer. Trying again …';
  }
  document.documentElement.dataset.ready = 'yes';
}

async function watch() {
  if (!document.hidden && !refused) await watchOnce();
  setTimeout(watch, EVERY);
}

watch();
