// The mesh of a running job, which moves while somebody looks at the page.

const MOVES_EVERY = 1;  // seconds between two looks at the mesh
const LOOKS_UNTIL_A_WORD = 15;  // looks at a job that runs and shows nothing

/** Asks for the mesh of a job (GET /v1/jobs/ID/mesh); null: there is nothing to see now. */
async function meshOnTheWay(name, signal) {
  const answer = await request(`${name}/mesh`, {signal});
  if (answer.status === 204) return null;
  const bytes = new Uint8Array(await answer.arrayBuffer());
  return new MeshCells(readMesh(bytes), readQuality(bytes));
}

const runs = async (name, signal) => (await getJob(name, signal)).state === 'JOB_STATE_RUNNING' && !signal.aborted;

/** The section with the mesh as it is now. */
class MovingMesh {
  constructor(place) {
    Object.assign(this, {place, views: null, box: null});
  }

  /** Shows the cells, where they are now. */
  show(cells) {
    this.box ??= cells.box();
    const {scene, arrays} = makeScene(cells, null, new Set(), this.box);
    const table = new CellTable(scene, arrays);
    if (this.views) return this.views.show?.(scene, arrays, table);
    const section = make('section', {id: 'moving'}, make('h2', {}, 'The mesh now, coloured by scaled Jacobian'));
    this.place.replaceChildren(section);
    this.views = (scene.dimension === 2 ? pictures2d : pictures3d)(section, scene, arrays, table, [], []);
  }

  /** Says why there is no picture. */
  explain() {
    this.place.replaceChildren(make('p', {class: 'quiet small'}, 'The mesh is shown when the job has ended: it has more than 100,000 nodes, or another server of the farm runs the job.'));
  }

  remove() {
    this.views?.dispose?.();
    this.place.replaceChildren();
  }
}

/** Follows the mesh of a job, in `place`, until `signal` says that the job has ended. */
async function followMesh(name, place, signal) {
  const moving = new MovingMesh(place);
  signal.addEventListener('abort', () => moving.remove(), {once: true});
  let looks = 0;
  while (!signal.aborted) {
    try {
      const cells = document.hidden ? null : await meshOnTheWay(name, signal);
      if (cells && !signal.aborted) moving.show(cells);
      if (!document.hidden && !moving.views && ++looks === LOOKS_UNTIL_A_WORD && await runs(name, signal)) moving.explain();
    } catch (error) {
      if (!isPassing(error)) return;  // The page does without it; the curves go on.
    }
    await pause(MOVES_EVERY);
  }
}
