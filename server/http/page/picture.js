// Meshes of the server as MeshCells: a job that only judges a mesh writes its nodes, elements and groups, and the quality of
// its cells.

const PICTURE_FORMATS = ['MESH_FORMAT_PARTS', 'MESH_FORMAT_CELL_QUALITY'];
const judgeSpec = (mesh, labels = {}) => ({mesh, quality: {}, outputs: PICTURE_FORMATS, labels});

/** The cells that the results of a job have; null if it has not both of them. */
async function cellsOfResults(job) {
  const formats = (job.results ?? []).map((result) => result.format);
  if (!PICTURE_FORMATS.every((format) => formats.includes(format))) return null;
  const [parts, quality] = await Promise.all(PICTURE_FORMATS.map((format) => fetchResult(job, format)));
  return new MeshCells(readMesh(parts), readQuality(quality));
}

/** Has the server judge a mesh, {digest, format}, and returns {cells, job}. The job is deleted. */
async function judge(mesh, signal) {
  const {name} = await submitSpec(judgeSpec(mesh, {page: 'picture'}));
  try {
    const job = await follow(name, () => {}, signal);
    if (job.error) throw new Refused(400, job.error.message);
    return {cells: await cellsOfResults(job), job};
  } finally {
    await cancelJob(name).then((job) => hasEnded(job) && deleteJob(name)).catch(() => {});
  }
}

const judged = new Map();  // By digest: jobs of this tab that have judged the mesh.

/** The mesh that a job was made for. */
async function cellsBefore(job, signal) {
  const {digest} = job.spec.mesh;
  const known = judged.get(digest);
  const found = known && await getJob(known).then(cellsOfResults).catch(() => null);
  return found ?? (await judge(job.spec.mesh, signal)).cells;
}

/** The mesh that a job has made; null if it has none. */
async function cellsAfter(job, signal) {
  const found = await cellsOfResults(job);
  const [result] = job.results ?? [];
  if (found || !result) return found;
  return (await judge({digest: result.digest, format: result.format}, signal)).cells;
}

/** Which files of a mesh have which format, for names of downloads. */
const SUFFIXES = {MSH22: 'msh', MSH22_BINARY: 'msh', MSH41: 'msh', MSH41_BINARY: 'msh', VTU: 'vtu', MFEM: 'mesh', NEKTAR: 'xml', ISM: 'mesh',
  SU2: 'su2', HOPR: 'h5', CGNS: 'cgns', PYFR: 'pyfrm', PARTS: 'parts', CELL_QUALITY: 'quality'};
const shortFormat = (format) => format.replace('MESH_FORMAT_', '');
const suffixOf = (format) => SUFFIXES[shortFormat(format)] ?? 'mesh';

/** Saves bytes as a file of the person who looks at the page. */
function save(blob, name) {
  const address = URL.createObjectURL(blob);
  make('a', {href: address, download: name}).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}

/** Saves the result of a job in a format. If the job has it not, another job writes the result again. */
async function download(job, format, stem) {
  const name = `${stem}.${suffixOf(format)}`;
  if (job.results.some((result) => result.format === format)) {
    return save(await (await request(`${job.name}/result?format=${format}`)).blob(), name);
  }
  const [{digest, format: has}] = job.results;
  const made = await submitSpec({mesh: {digest, format: has}, quality: {}, outputs: [format], labels: {page: 'download'}});
  try {
    const done = await follow(made.name, () => {});
    if (done.error) throw new Refused(400, done.error.message);
    save(await (await request(`${made.name}/result?format=${format}`)).blob(), name);
  } finally {
    await deleteJob(made.name).catch(() => {});
  }
}
