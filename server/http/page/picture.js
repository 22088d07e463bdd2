// Meshes of the server as MeshCells: a job that only judges a mesh writes its nodes, elements and groups, and the quality of
// its cells.

const PICTURE_FORMATS = ['MESH_FORMAT_PARTS', 'MESH_FORMAT_CELL_QUALITY'];
const judgeSpec = (mesh, labels = {}) => ({mesh, quality: {}, outputs: PICTURE_FORMATS, labels});

/** The cells that the results of a job have; null if it has not both of them. */
async function cellsOfResults(job, signal) {
  const formats = (job.results ?? []).map((result) => result.format);
  if (!PICTURE_FORMATS.every((format) => formats.includes(format))) return null;
  const [parts, quality] = await Promise.all(PICTURE_FORMATS.map(async (format) => new Uint8Array(await (await fetchResult(job, format, signal)).arrayBuffer())));
  return new MeshCells(readMesh(parts), readQuality(quality));
}

/** The cells of a mesh of the server, {digest, format}, which a job judges. */
const judge = (mesh, signal) => withTemporaryJob(judgeSpec(mesh, {page: 'picture'}), (job) => cellsOfResults(job, signal), signal);

const judged = new Map();  // By digest: jobs of this tab that have judged the mesh.

/** The mesh that a job was made for. */
async function cellsBefore(job, signal) {
  const {digest} = job.spec.mesh;
  const known = judged.get(digest);
  const found = known && await getJob(known, signal).then((one) => cellsOfResults(one, signal)).catch(() => null);
  signal.throwIfAborted();
  return found ?? judge(job.spec.mesh, signal);
}

/** The mesh that a job has made; null if it has none. */
async function cellsAfter(job, signal) {
  const found = await cellsOfResults(job, signal);
  const [result] = job.results ?? [];
  if (found || !result) return found;
  return judge({digest: result.digest, format: result.format}, signal);
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
async function download(job, format, stem, signal) {
  const saveOf = async (one) => save(await fetchResult(one, format, signal), `${stem}.${suffixOf(format)}`);
  if (job.results.some((result) => result.format === format)) return saveOf(job);
  const [{digest, format: has}] = job.results;
  return withTemporaryJob({mesh: {digest, format: has}, quality: {}, outputs: [format], labels: {page: 'download'}}, saveOf, signal);
}
