// The list of jobs: filtered by state, in pages, kept up to date while somebody looks.

const PAGE_SIZE = 20;
const LIST_EVERY = 2;  // seconds
const STATE_FILTERS = {'all states': [], 'waiting': ['PENDING'], 'running': ['RUNNING', 'CANCELLING'], 'succeeded': ['SUCCEEDED'], 'failed': ['FAILED'],
  'cancelled': ['CANCELLED']};

class JobList {
  constructor(section, signal) {
    Object.assign(this, {signal, pages: [''], filter: 'all states'});
    const names = Object.keys(STATE_FILTERS);
    this.place = make('div');
    this.newer = button('Newer', () => this.turn(-1));
    this.older = button('Older', () => this.turn(1));
    section.append(make('div', {class: 'controls'}, labelled('Show', choice(names, 0, (i) => {
      Object.assign(this, {filter: names[i], pages: ['']});
      this.show();
    }))), this.place, make('div', {class: 'controls'}, this.newer, this.older));
  }

  turn(by) {
    if (by > 0) this.pages.push(this.next);
    else this.pages.pop();
    this.show();
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
    const text = JSON.stringify(jobs);
    if (text === this.shown && !jobs.some((job) => !hasEnded(job))) return;
    this.shown = text;
    if (this.place.contains(document.activeElement) && document.activeElement.matches('button')) return;  // Somebody is about to click.
    this.place.replaceChildren(jobs.length ? this.table(jobs) : make('p', {class: 'quiet'}, 'There are no such jobs.'));
  }

  table(jobs) {
    const rows = jobs.map((job) => {
      const short = job.name.slice(5, 13);
      const link = make('a', {href: `#/${job.name}`}, job.spec.labels?.file ?? short);
      const act = hasEnded(job) ? sureButton('Delete', `Delete ${short}`, async () => { await deleteJob(job.name); document.activeElement.blur(); await this.show(); }) :
        sureButton('Cancel', `Cancel ${short}`, async () => { await cancelJob(job.name); document.activeElement.blur(); await this.show(); });
      return [make('span', {}, link, make('br'), make('span', {class: 'quiet small'}, short)), isJudged(job) ? 'quality' : 'optimise',
        {text: stateWord(job), class: job.error ? 'failed' : ''}, progressOf(job), {text: outcomeOf(job), class: 'text'}, {text: instant(job.createTime), class: 'place'},
        {text: duration(secondsRun(job)), class: 'number'}, act];
    });
    return table('Jobs, newest first', ['Mesh', 'Work', 'State', 'Progress', 'Outcome', 'Submitted', {text: 'Took', class: 'number'}, 'Action'], rows);
  }
}

async function showJobs(signal) {
  const section = addSection('jobs', 'Jobs');
  const list = new JobList(section, signal);
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
    ready();
    await pause(LIST_EVERY);
  }
}
