// The same work for a terminal and for Python.

/** A word for a POSIX shell. */
const shellWord = (text) => (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

/** "wing" and "msh" of "wing.msh". */
function partsOfName(name) {
  const dot = name.lastIndexOf('.');
  return dot > 0 ? [name.slice(0, dot), name.slice(dot + 1)] : [name, 'msh'];
}

const stemOf = (name) => partsOfName(name)[0];
const betterName = (name) => `${stemOf(name)}-better.${partsOfName(name)[1]}`;

function commandLine(file, form) {
  return ['varimesh', 'optimise', file, '-o', betterName(file), ...form.fields.flatMap((field) => field.words())].map(shellWord).join(' ');
}

function pythonText(file, form) {
  const words = [file, betterName(file)].map((name) => JSON.stringify(name));
  const options = form.fields.flatMap((field) => field.argument());
  return `import varimesh\n\nresult = varimesh.optimise(${[...words, ...options].join(', ')})\nprint(result)`;
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

/** The command and the Python of what the form says; they follow the form. */
function commandTexts(file, form) {
  const place = make('div', {class: 'columns'});
  const show = () => place.replaceChildren(copyable('In a terminal', commandLine(file, form)), copyable('In Python', pythonText(file, form)));
  form.onChange(show);
  show();
  return place;
}
