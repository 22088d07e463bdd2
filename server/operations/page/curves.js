// A running job: what it is, how far it is, and its curves.

const JOB_CURVES = [
  {column: 3, title: 'Residual', log: true},
  {column: 2, title: 'Energy', log: false},
  {column: 4, title: 'Smallest scaled Jacobian', log: false, zero: true},
];

const MOST_ROWS = 10000;

/** Labels as text. */
function labelsOf(job) {
  return Object.entries(job.labels).map(([key, value]) => make('span', {class: 'label'}, value ? `${key}=${value}` : key));
}

class JobCard {
  constructor(job) {
    this.name = job.job;
    this.sequence = 0;
    this.rows = [];
    this.line = make('p', {class: 'small'});
    this.charts = make('div', {class: 'columns'});
    this.node = make('div', {class: 'job', 'data-job': job.job},
        make('h3', {}, job.job), make('div', {}, ...labelsOf(job)), this.line, this.charts);
  }

  /** What the list says of the job. */
  tell(job, now) {
    const parts = [job.state];
    if (job.attempt > 1) parts.push(`attempt ${job.attempt}`);
    if (job.energy) parts.push(job.energy);
    if (job.began) parts.push(`for ${duration((now - job.began) / 1000)}`);
    const last = this.rows.at(-1) ?? job.iteration;
    if (last) parts.push(`${last[1]} ${last[0]}`, `residual ${readable(last[3])}`, `smallest Js ${jacobian(last[4])}`);
    if (job.invalid !== undefined) parts.push(`${grouped(job.invalid)} not certified`);
    this.line.textContent = parts.join(' · ');
  }

  /** Fetches the iterations that are new, and draws. */
  async follow() {
    const answer = await fetch(`api/iterations?job=${encodeURIComponent(this.name)}&after=${this.sequence}`);
    if (!answer.ok) return;
    const {sequence, iterations} = await answer.json();
    this.sequence = sequence;
    if (!iterations.length) return;
    // An attempt that begins again counts from 1 again.
    const first = iterations[0][0];
    this.rows = this.rows.filter((row) => row[0] < first).concat(iterations);
    // Of a job that runs for days, every other iteration will do.
    if (this.rows.length > MOST_ROWS) this.rows = this.rows.filter((row, i) => i % 2 === 0 || i === this.rows.length - 1);
    this.draw();
  }

  draw() {
    const x = this.rows.map((row) => row[0]);
    const bands = phases({iteration: x, phase: this.rows.map((row) => row[1])});
    // Each has its place before it is drawn, since that decides its width: all of it is there when the screen is painted.
    const places = JOB_CURVES.map(() => make('div'));
    this.charts.replaceChildren(...places);
    JOB_CURVES.forEach(({column, title, log, zero}, i) => {
      lineChart(places[i], {x, y: this.rows.map((row) => row[column]), log, zero, bands, height: 130,
        names: {x: 'iteration', y: '', title}});
    });
  }
}
