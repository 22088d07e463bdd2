// The card of a running job: its name, its progress and its curves.

const JOB_CURVES = [
  {column: 3, title: 'Residual', log: true},
  {column: 2, title: 'Energy', log: false},
  {column: 4, title: 'Smallest scaled Jacobian', log: false, zero: true},
];

const MOST_ROWS = 10000;

/** The name of a job for people: that of its file, and the job's own below it. */
function nameOf(job) {
  const {file} = job.labels;
  return file ? make('span', {}, make('span', {class: 'file'}, file), make('br'), make('span', {class: 'quiet small'}, job.job)) : job.job;
}

/** Returns the labels of a job as elements, without the name of its file. */
function labelsOf(job) {
  return Object.entries(job.labels).filter(([key]) => key !== 'file').map(([key, value]) => make('span', {class: 'label'}, value ? `${key}=${value}` : key));
}

class JobCard {
  constructor(job) {
    this.name = job.job;
    this.sequence = 0;
    this.rows = [];
    this.line = make('p', {class: 'small'});
    this.buttons = make('p', {class: 'small'});
    this.charts = make('div', {class: 'columns'});
    this.node = make('div', {class: 'job', 'data-job': job.job},
        make('h3', {}, nameOf(job)), make('div', {}, ...labelsOf(job)), this.line, this.buttons, this.charts);
  }

  /** Shows what the list of jobs says about the job. */
  tell(job, now) {
    const parts = [job.state];
    if (job.attempt > 1) parts.push(`attempt ${job.attempt}`);
    if (job.energy) parts.push(job.energy);
    if (job.began) parts.push(`for ${duration((now - job.began) / 1000)}`);
    const last = this.rows.at(-1) ?? job.iteration;
    if (last) parts.push(`${last[1]} ${last[0]}`, `residual ${readable(last[3])}`, `smallest Js at most ${jacobian(last[4])}`);
    if (job.invalid !== undefined) parts.push(`${grouped(job.invalid)} not certified`);
    this.line.textContent = parts.join(' · ');
    this.buttons.replaceChildren(...cancelButton(job));
  }

  /** Fetches the new iterations and draws the curves. */
  async follow() {
    const answer = await fetchFromServer(`iterations?job=${encodeURIComponent(this.name)}&after=${this.sequence}`);
    if (!answer.ok) return;
    const {sequence, iterations} = await answer.json();
    this.sequence = sequence;
    if (!iterations.length) return;
    // An attempt that starts from the beginning counts from 1 again.
    const first = iterations[0][0];
    this.rows = this.rows.filter((row) => row[0] < first).concat(iterations);
    // For a job that runs for days, every other iteration is enough.
    if (this.rows.length > MOST_ROWS) this.rows = this.rows.filter((row, i) => i % 2 === 0 || i === this.rows.length - 1);
    this.draw();
  }

  draw() {
    const x = this.rows.map((row) => row[0]);
    const bands = phases({iteration: x, phase: this.rows.map((row) => row[1])});
    // Each chart is placed before it is drawn, since its place decides its width. The screen is painted after that.
    const places = JOB_CURVES.map(() => make('div'));
    this.charts.replaceChildren(...places);
    JOB_CURVES.forEach(({column, title, log, zero}, i) => {
      lineChart(places[i], {x, y: this.rows.map((row) => row[column]), log, zero, bands, height: 130,
        names: {x: 'iteration', y: '', title}});
    });
  }
}
