// Builds the page for the address after "#": a place to drop a mesh, the list of jobs, or one job.

/** The field for a CAD model that the page shows now; null: there is none. */
let modelField = null;

/** A section with a heading, added to the page. */
function addSection(id, title) {
  const section = make('section', {id}, make('h2', {}, title));
  document.getElementById('main').append(section);
  return section;
}

/** Says something to whoever looks at the page; `isWrong`: that something went wrong. */
function tell(text, isWrong = false) {
  const line = document.getElementById('told');
  line.className = isWrong ? 'lost' : 'quiet';
  line.textContent = text;
}

/** For tests: what can be shown at once is there. */
function ready() {
  document.documentElement.dataset.ready = 'yes';
}

/** {job, model}: the CAD model that was dropped together with a mesh, until the form of the mesh's job is there; null: there is none. */
let waitingModel = null;

/** Takes files that were dropped or chosen: a mesh, a CAD model, or one of each. */
async function take(files) {
  if (files.length === 0) return;
  const models = [...files].filter(({name}) => CAD_FILE.test(name));
  const others = [...files].filter(({name}) => !CAD_FILE.test(name));
  if (models.length > 1 || others.length > 1) return tell(`These are ${files.length} files. Drop one mesh, one CAD model, or one of each.`, true);
  if (modelField && !others.length) return modelField.take(models[0]);
  if (others.length) await send(others[0], models[0]);
  else await send(models[0]);
}

/** Sends a mesh or a CAD model to the server and shows it. `model`: what the mesh's form gets as its CAD model, if there is one. */
async function send(file, model) {
  waitingModel = null;
  const isCad = CAD_FILE.test(file.name);
  if (!location.hash.match(/^(#\/?)?$/)) location.hash = '#/';
  tell(`Sending ${file.name} …`);
  try {
    if (isCad && !(await askFor('info')).takesGeometries) {
      tell(`This server reads no CAD models, so there is no picture of ${file.name}.`);
      return document.getElementById('advice')?.replaceChildren(...modelAdvice(file.name, 5));
    }
    const labels = {file: labelOf(file.name)};
    const job = await submitFile(file, isCad ? modelSpec(labels) : judgeSpec({}, labels));
    waitingModel = model ? {job: job.name, model} : null;
    tell('');
    location.hash = `#/${job.name}`;
  } catch (error) {
    tell(error.message, true);
  }
}

/** The place to drop a mesh, with a field for those who choose it. */
function showStart() {
  document.title = 'VariMesh';
  const section = addSection('start', 'Look at a mesh');
  const input = make('input', {type: 'file', id: 'file', multiple: true});
  input.addEventListener('change', () => take(input.files));
  section.append(make('label', {class: 'drop', for: 'file'}, make('strong', {}, 'Drop a mesh or a CAD model here, or choose a file'),
      make('span', {class: 'quiet'}, 'Gmsh, VTK, MFEM, Nektar++, HOPR, CGNS and others; STEP, IGES and BREP. It is sent to the server that this page comes from, and to nobody else.'), input),
  make('div', {id: 'advice'}));
  ready();
}

/** Drops anywhere in the window count. */
function acceptDrops() {
  const zone = document.documentElement;
  zone.addEventListener('dragover', (event) => {
    event.preventDefault();
    zone.classList.add('dragged');
  });
  zone.addEventListener('dragleave', (event) => { if (!event.relatedTarget) zone.classList.remove('dragged'); });
  zone.addEventListener('drop', (event) => {
    event.preventDefault();
    zone.classList.remove('dragged');
    take(event.dataTransfer.files);
  });
}

/** Asks for a token, which the browser forgets with the tab. */
function askForToken(why) {
  const place = document.getElementById('token');
  if (place.childElementCount) return;
  sessionStorage.removeItem('token');
  const field = make('input', {type: 'password', autocomplete: 'off', 'aria-label': 'Token'});
  const node = make('form', {class: 'controls'}, make('span', {}, why), field, make('button', {type: 'submit'}, 'Use this token'));
  node.addEventListener('submit', (event) => {
    event.preventDefault();
    if (!isToken(field.value.trim())) return tell('A token is one line of letters, digits and signs, without spaces.', true);
    sessionStorage.setItem('token', field.value.trim());
    place.replaceChildren();
    tell('');
    show();
  });
  place.replaceChildren(node);
  field.focus();
}

/** Asks before a token from the address is used: anybody can link to the page, and the jobs would be those of the token's owner. */
function offerToken(token) {
  if (!token) return;
  const place = document.getElementById('token');
  const answer = (isTaken) => {
    if (isTaken) sessionStorage.setItem('token', token);
    place.replaceChildren();
    tell('');
    show();
  };
  place.replaceChildren(make('div', {class: 'controls'},
      make('span', {}, 'The address has a token. Whoever made the token sees the meshes and jobs that you send with it. Use it only if the address ' +
          'comes from varimesh ui on your machine, or from somebody whom you trust.'),
      button('Use this token', () => answer(true)), button('Do not use it', () => answer(false))));
}

let looking = new AbortController();

async function show() {
  looking.abort();
  looking = new AbortController();
  const {signal} = looking;
  modelField = null;
  document.getElementById('main').replaceChildren();
  delete document.documentElement.dataset.ready;
  const path = location.hash.replace(/^#\/?/, '');
  for (const link of document.querySelectorAll('nav a')) {
    if (link.hash.replace(/^#\/?/, '') === path) link.setAttribute('aria-current', 'page');
    else link.removeAttribute('aria-current');
  }
  try {
    if (path === 'jobs') await showJobs(signal);
    else if (/^jobs\/[0-9a-f]+$/.test(path)) await showJob(path, signal);
    else showStart();
  } catch (error) {
    if (signal.aborted) return;
    tell(error.message, true);
    ready();
  }
}

offerToken(takeToken());
onTokenNeeded = askForToken;
acceptDrops();
addEventListener('hashchange', () => {
  offerToken(takeToken());
  tell('');
  show();
  document.getElementById('main').focus({preventScroll: true});  // The next Tab leads into what is new.
});
show();
