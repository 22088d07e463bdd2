// The list of jobs: filtered by state, in pages, kept up to date while somebody looks.

const PAGE_SIZE = 20;
const LIST_EVERY = 2;  // seconds
const STATE_FILTERS = {'all states': [], 'waiting': ['PENDING'], 'running': ['RUNNING', 'CANCELLING'], 'succeeded': ['SUCCEEDED'], 'failed': ['FAILED'],
  'cancelled': ['CANCELLED']};

/** Gives a row what is new in another one for the same job. What has the focus or was clicked once stays, unless it acts otherwise. */
function updateRow(row, fresh) {
  const news = [...fresh.cells];
  [...row.cells].forEach((cell, i) => {
    const [before, after] = [cell, news[i]].map((one) => one.querySelector('button')?.getAttribute('aria-label'));
    if (before ? before === after && !cell.querySelector('button').disabled : cell.isEqualNode(news[i])) return;
    const hasFocus = cell.contains(document.activeElement);
    cell.replaceWith(news[i]);
    if (hasFocus) news[i].querySelector('a, button')?.focus();
  });
}

/** Makes the rows of a list those of another. Rows for the same job stay where they are. */
function updateRows(body, fresh) {
  const jobOf = (row) => row.querySelector('a').hash;
  const known = new Map([...body.rows].map((row) => [jobOf(row), row]));
  const wanted = [...fresh.rows].map((row) => {
    const before = known.get(jobOf(row));
    if (before) updateRow(before, row);
    return before ?? row;
  });
  for (const row of known.values()) if (!wanted.includes(row)) row.remove();
  wanted.forEach((row, i) => { if (body.rows[i] !== row) body.insertBefore(row, body.rows[i] ?? null); });
}

class JobList {
  constructor(section, signal) {
    Object.assign(this, {signal, pages: [''], filter: 'all states'});
    const names = Object.keys(STATE_FILTERS);
    this.place = make('div');
    this.newer = button('Newer', () => this.turn(-1));
    this.older = button('Older', () => this.turn(1));
    section.append(make('div', {class: 'controls'}, labelled('Show', choice(names, 0, (i) => {
      this.look({filter: names[i], pages: ['']});
    }))), this.place, make('div', {class: 'controls'}, this.newer, this.older));
  }

  turn(by) {
    this.look({pages: by > 0 ? [...this.pages, this.next] : this.pages.slice(0, -1)});
  }

  /** Shows something else. The buttons wait until it is there. */
  look(choice) {
    Object.assign(this, choice);
    this.newer.disabled = this.older.disabled = true;
    this.show().catch((error) => { if (!this.signal.aborted) tell(error.message, true); });
  }

  async show() {
    const query = new URLSearchParams({pageSize: PAGE_SIZE});
    if (this.pages.at(-1)) query.set('pageToken', this.pages.at(-1));
    for (const state of STATE_FILTERS[this.filter]) query.append('states', `JOB_STATE_${state}`);
    const asked = this.asked = Symbol('question');
    const {jobs = [], nextPageToken = ''} = await askFor(`jobs?${query}`, {signal: this.signal});
    if (asked !== this.asked) return;  // Somebody has chosen something else meanwhile.
    this.next = nextPageToken;
    this.newer.disabled = this.pages.length === 1;
    this.older.disabled = !this.next;
    const [old] = this.place.children;
    const fresh = jobs.length ? this.table(jobs) : make('p', {class: 'quiet'}, 'There are no such jobs.');
    if (old?.querySelector('tbody') && jobs.length) updateRows(old.querySelector('tbody'), fresh.querySelector('tbody'));
    else this.place.replaceChildren(fresh);
  }

  table(jobs) {
    const rows = jobs.map((job) => {
      const short = job.name.slice(5, 13);
      const link = make('a', {href: `#/${job.name}`}, job.spec.labels?.file ?? short);
      const act = hasEnded(job) ? sureButton('Delete', `Delete ${short}`, async () => { await deleteJob(job.name); await this.show(); }) :
        sureButton('Cancel', `Cancel ${short}`, async () => { await cancelJob(job.name); await this.show(); });
      return [make('span', {}, link, make('br'), make('span', {class: 'quiet small'}, short)), workWord(job),
        {text: stateWord(job), class: job.error ? 'failed' : ''}, progressOf(job), {text: outcomeOf(job), class: 'text'}, {text: instant(job.createTime), class: 'place'},
        {text: duration(secondsRun(job)), class: 'number'}, act];
    });
    return table('Jobs, newest first', ['Mesh', 'Work', 'State', 'Progress', 'Outcome', 'Submitted', {text: 'Took', class: 'number'}, 'Action'], rows);
  }
}

async function showJobs(signal) {
  const section = addSection('jobs', 'Jobs');
  const list = new JobList(section, signal);
  const kept = showKeeping(section, signal).catch(() => {});  // The list says what is wrong.
  let isLost = false;
  while (!signal.aborted) {
    try {
      if (!document.hidden) await list.show();
      if (isLost) tell('');
      isLost = false;
    } catch (error) {
      if (!isPassing(error)) throw error;
      isLost = true;
      tell(`${error.message} Trying again …`, true);
    }
    await kept;
    ready();
    await pause(LIST_EVERY);
  }
}
