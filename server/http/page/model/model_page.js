// A CAD model that was dropped without a mesh: its picture, what it consists of, and the commands that make a mesh of it.

const MODEL_OUTPUTS = ['MESH_FORMAT_PARTS'];
const MOST_FACE_ROWS = 200;

/** The spec of a job that draws the model in place of a mesh. */
const modelSpec = (labels) => ({quality: {}, outputs: MODEL_OUTPUTS, labels});
/** Whether a job draws a model. Its mesh has no elements; as long as nothing is known about that, the ending of its file says it. */
const isModel = (job) => isJudged(job) && (job.spec.outputs ?? []).join() === MODEL_OUTPUTS.join() &&
    (job.metrics?.mesh ? !Number(job.metrics.mesh.elements) : CAD_FILE.test(fileOf(job)));

/** 60 of 1234 / 20: a round number near it. */
function roundNumber(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return Number((Math.round(value / power) * power).toPrecision(1));
}

/** How a mesh is made of a model. `length`: of an edge of the mesh. */
function modelAdvice(name, length) {
  const mesh = fileWord(`${stemOf(name)}.msh`);
  return [
    make('p', {}, 'A model has no elements yet, and this server makes no meshes. The first command makes a mesh of it with Gmsh; the second curves a straight ' +
        'mesh that another program has made. Drop the mesh here then. Drop the model beside it, or choose it in the form, and the boundary slides on it.'),
    copyable('Mesh the model', `varimesh mesh ${fileWord(name)} --size ${length} --order 3 -o ${mesh}`),
    copyable('Curve a straight mesh of the model', `varimesh curve linear.msh --geometry ${fileWord(name)} --order 3 -o ${mesh}`),
  ];
}

/** The faces of a model, each with a button that hides the other faces. */
function faceTable(model, isolate) {
  const rows = model.faces.slice(0, MOST_FACE_ROWS).map(({tag, name, area}) => [numberCell(tag, String(tag)), name || '–', numberCell(area),
    isolate ? button('Show', () => isolate(tag)) : '']);
  const more = model.faces.length - rows.length;
  return [table('Faces', [{text: 'Face', class: 'number'}, 'Name', {text: 'Area, about', class: 'number'}, 'Action'], rows),
    ...(more > 0 ? [make('p', {class: 'quiet small'}, `${counted(more, 'more face is', 'more faces are')} not listed.`)] : [])];
}

/** Shows what came of a job that draws a model. */
async function showModel(job, signal) {
  let length = 5;
  if (job.results?.length) {
    const parts = await fetchResult(job, MODEL_OUTPUTS[0], signal);
    const model = new CadModel(readMesh(new Uint8Array(await parts.arrayBuffer())));
    signal.throwIfAborted();
    length = roundNumber(Math.hypot(...model.sizes) / 20);
    const section = addSection('pictures', 'The model');
    const tile = (name, text) => make('div', {class: 'tile'}, make('dt', {}, name), make('dd', {}, text));
    section.append(make('p', {}, (job.metrics?.notes ?? []).join(' ')), make('dl', {class: 'tiles'}, tile('Faces', grouped(model.faces.length)), tile('Size', model.sizes.map((value) => readable(value)).join(' × '))));
    const picture = modelPicture(section, model);
    if (picture) signal.addEventListener('abort', () => picture.dispose());
    section.append(make('div', {}, ...faceTable(model, picture?.isolate)));
  }
  addSection('advice', 'Make a mesh of it').append(...modelAdvice(meshFileOf(job), length));
}
