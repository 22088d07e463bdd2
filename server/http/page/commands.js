// The same work for a terminal and for Python.

/** A word for a POSIX shell. */
const shellWord = (text) => (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

/** The name of a file as a word of a command, which must not be taken for a flag. */
const fileWord = (name) => shellWord(name.startsWith('-') ? `./${name}` : name);

/** "wing" and "msh" of "wing.msh". */
function partsOfName(name) {
  const dot = name.lastIndexOf('.');
  return dot > 0 ? [name.slice(0, dot), name.slice(dot + 1)] : [name, 'msh'];
}

const stemOf = (name) => partsOfName(name)[0];
const betterName = (name) => `${stemOf(name)}-better.${partsOfName(name)[1]}`;

/** `fields` have words() and argument(). A straight mesh with a model is curved. */
function commandLine(file, fields, straight) {
  const words = fields.flatMap((field) => field.words());
  const command = straight && words.includes('--geometry') ? 'curve' : 'optimise';
  return ['varimesh', command, fileWord(file), '-o', fileWord(betterName(file)), ...words.map(shellWord)].join(' ');
}

function pythonText(file, fields) {
  const words = [file, betterName(file)].map((name) => JSON.stringify(name));
  return `import varimesh\n\nresult = varimesh.optimise(${[...words, ...fields.flatMap((field) => field.argument())].join(', ')})\nprint(result)`;
}

/** Text to copy, under a title. */
function copyable(title, text) {
  const copy = button('Copy', async () => {
    await navigator.clipboard.writeText(text);
    copy.textContent = 'Copied';
    setTimeout(() => { copy.textContent = 'Copy'; }, 2000);
  });
  copy.setAttribute('aria-label', `Copy: ${title}`);
  return make('div', {class: 'copyable'}, make('div', {class: 'controls'}, make('h3', {}, title), copy),
      make('pre', {tabindex: 0, role: 'region', 'aria-label': title}, text));
}

/** What the texts do not say, of what a run with this spec does; empty if they say all. `model`: the fields for a model; may be null. */
function notInTexts(spec, model) {
  const parts = [spec.options?.targetField && 'the target field', spec.priority && 'the priority', spec.webhook && 'the webhook',
    spec.geometry && !model && 'the sliding of boundary nodes'].filter(Boolean);
  return parts.length ? [make('p', {class: 'quiet small'}, `The next run keeps ${parts.join(', ')} of this job, which these texts do not have.`)] : [];
}

/** The command and the Python of what the form says; they follow the form. */
function commandTexts(file, form, fields, straight) {
  const place = make('div', {class: 'columns'});
  const show = () => place.replaceChildren(copyable('In a terminal', commandLine(file, fields, straight)), copyable('In Python', pythonText(file, fields)));
  form.addEventListener('input', show);
  show();
  return place;
}
