// Calls of the port that serves this page, with the token of the tab.

const ENDED = ['JOB_STATE_SUCCEEDED', 'JOB_STATE_FAILED', 'JOB_STATE_CANCELLED'];
const hasEnded = (job) => ENDED.includes(job.state);

/** Whether a text can be a token, which a header of HTTP can have. */
const isToken = (text) => /^[\x21-\x7e]+$/.test(text);

/** The token of an address with #token=TEXT, which the address then shows no more; null if it has none, or the tab has one. */
function takeToken() {
  const found = /^#token=(.+)$/.exec(location.hash);
  if (!found) return null;
  history.replaceState(null, '', location.pathname);
  return isToken(found[1]) && !sessionStorage.getItem('token') ? found[1] : null;
}

/** Why the server refused a call: its sentence, with the code of HTTP. */
class Refused extends Error {
  constructor(code, sentence) {
    super(sentence);
    this.code = code;
  }
}

/** Whether the same request may be answered later. */
const isPassing = (error) => error instanceof Refused && (error.code === 0 || error.code === 429 || error.code >= 500);

/** What is done when the server asks for a token. The page sets it. */
let onTokenNeeded = () => {};

/** Sends a request, and returns the answer if it is a good one. */
async function request(path, {method = 'GET', headers = {}, body, signal} = {}) {
  const token = sessionStorage.getItem('token');
  const all = token ? {...headers, Authorization: `Bearer ${token}`} : headers;
  let answer;
  try {
    answer = await fetch(`/v1/${path}`, {method, headers: all, body, signal, cache: 'no-store'});
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new Refused(0, 'The server does not answer.');
  }
  if (answer.ok) return answer;
  const status = await answer.json().catch(() => ({}));
  if (answer.status === 401) onTokenNeeded(status.message);
  throw new Refused(answer.status, status.message ?? `The server answers with ${answer.status}.`);
}

async function askFor(path, options) {
  return (await request(path, options)).json();
}

const postJson = (path, document) => askFor(path, {method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(document)});
const getJob = async (name, signal) => (await askFor(name, {signal})).job;
const cancelJob = async (name) => (await askFor(`${name}/cancel`, {method: 'POST'})).job;
const deleteJob = (name) => askFor(name, {method: 'DELETE'});
const submitSpec = async (spec) => (await postJson('jobs', spec)).job;

/** Sends a mesh and makes a job of it, in one request. */
async function submitFile(file, spec) {
  const form = new FormData();
  form.append('spec', JSON.stringify(spec));
  form.append('mesh', file);
  return (await askFor('jobs', {method: 'POST', body: form})).job;
}

/** Cancels a job, waits for its end and deletes it. */
async function removeJob(name) {
  let job = await cancelJob(name);
  while (!hasEnded(job)) {
    await pause(0.5);
    job = await getJob(name);
  }
  await deleteJob(name);
}

/** Has the server do a job that only this page needs, returns what use(job) makes of it once it has ended, and removes it. */
async function withTemporaryJob(spec, use, signal) {
  const {name} = await submitSpec(spec);
  try {
    const job = await follow(name, () => {}, signal);
    if (job.error) throw new Refused(400, job.error.message);
    return await use(job);
  } finally {
    await removeJob(name).catch(() => {});
  }
}

const MOST_RESULT_BYTES = 2 ** 31 - 1;

/** A result of a job, as a Blob. */
async function fetchResult(job, format, signal) {
  const size = Number(job.results.find((result) => result.format === format).size ?? 0);
  if (size > MOST_RESULT_BYTES) throw new Refused(413, `The result has ${grouped(size)} bytes, too many for a browser; use varimesh result.`);
  const answer = await request(`${job.name}/result?format=${format}`, {signal});
  const blob = await answer.blob().catch((error) => {
    signal?.throwIfAborted();
    throw new Refused(0, `The result does not come: ${error.message}`);
  });
  if (blob.size !== size) throw new Refused(0, 'The result did not come whole; try again.');
  return blob;
}

/** Reads server-sent events from the body of an answer, and calls take(id, document) for each. */
async function readEvents(answer, take) {
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let [text, id, data] = ['', '', ''];
  for (;;) {
    const {value, done} = await reader.read();
    if (done) return;
    text += value;
    const lines = text.split('\n');
    text = lines.pop();
    for (const line of lines) {
      if (line.startsWith('id:')) id = line.slice(3).trim();
      else if (line.startsWith('data:')) data += line.slice(5);
      else if (line === '' && data) {
        take(id, JSON.parse(data));
        data = '';
      }
    }
  }
}

const pause = (seconds) => new Promise((resume) => setTimeout(resume, 1000 * seconds));

/** Calls take(event) for each event of a job up to its end, over as many connections as it takes, and returns the job. */
async function follow(name, take, signal) {
  let last = '0';
  let fault = null;  // What take() threw.
  const takeOne = (id, event) => {
    last = id || last;
    try {
      take(event);
    } catch (error) {
      fault = error;
      throw error;
    }
  };
  for (;;) {
    try {
      const answer = await request(`${name}/events?after=${last}`, {signal});
      if (answer.status !== 204) await readEvents(answer, takeOne);
    } catch (error) {
      if (error === fault || error.name === 'AbortError' || (error instanceof Refused && !isPassing(error))) throw error;
    }
    signal?.throwIfAborted();
    const job = await getJob(name, signal).catch((error) => {
      if (isPassing(error)) return null;
      throw error;
    });
    signal?.throwIfAborted();
    if (job && hasEnded(job)) return job;
    await pause(1);
  }
}
