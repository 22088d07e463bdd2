// Calls of the port that serves this page, with the token of the tab.

const ENDED = ['JOB_STATE_SUCCEEDED', 'JOB_STATE_FAILED', 'JOB_STATE_CANCELLED'];
const hasEnded = (job) => ENDED.includes(job.state);

/** Whoever opens the page with #token=TEXT gives it that token, which the address then shows no more. A token that the tab has stays. */
function takeToken() {
  const found = /^#token=([\x21-\x7e]+)$/.exec(location.hash);
  if (!found) return;
  if (!sessionStorage.getItem('token')) sessionStorage.setItem('token', found[1]);
  history.replaceState(null, '', location.pathname);
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
const getJob = async (name) => (await askFor(name)).job;
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

/** The bytes of a job's result. */
async function fetchResult(job, format) {
  return new Uint8Array(await (await request(`${job.name}/result?format=${format}`)).arrayBuffer());
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
  for (;;) {
    try {
      const answer = await request(`${name}/events?after=${last}`, {signal});
      if (answer.status !== 204) {
        await readEvents(answer, (id, event) => {
          last = id || last;
          take(event);
        });
      }
    } catch (error) {
      if (error.name === 'AbortError' || (error instanceof Refused && !isPassing(error))) throw error;
    }
    signal?.throwIfAborted();
    const job = await getJob(name).catch((error) => {
      if (isPassing(error)) return null;
      throw error;
    });
    if (job && hasEnded(job)) return job;
    await pause(1);
  }
}
