// The page, from top to bottom.

/** A section with a heading, added to the page. */
function addSection(id, title, note) {
  const section = make('section', {id}, make('h2', {}, title));
  if (note) section.append(make('p', {class: 'quiet small'}, note));
  document.getElementById('main').append(section);
  return section;
}

function addHead(report) {
  const [kind, sentence] = verdict(report.document);
  document.title = `${report.title} – VariMesh report`;
  document.getElementById('head').append(
      make('h1', {}, report.title), make('p', {class: `verdict ${kind}`}, sentence), tiles(report.document));
}

/** The views; returns what shows a place in them. */
async function addPictures(report) {
  if (!report.scene) {
    if (report.no_picture) addSection('pictures', 'The mesh', report.no_picture);
    return null;
  }
  const section = addSection('pictures', 'The mesh, coloured by scaled Jacobian', report.no_picture);
  const arrays = await unpack(document.getElementById('arrays').textContent, report.scene.arrays);
  const cells = new CellTable(report.scene, arrays);
  const crosses = report.document.unrepairable;
  return (report.scene.dimension === 2 ? pictures2d : pictures3d)(section, report.scene, arrays, cells, crosses);
}

function addTables(report, go) {
  const section = addSection('tables', 'Figures');
  section.append(make('div', {class: 'columns'}, qualityTable(report.document), meshTable(report.document)));
  if (report.scene) {
    const worst = addSection('worst', 'The worst elements', 'Rings in the views are numbered as these rows are.');
    worst.append(make('div', {class: 'columns'}, ...report.scene.stages.map((stage) => worstTable(report.scene, stage, go))));
  }
  if (report.document.unrepairable.length) {
    addSection('unrepairable', 'Beyond repair').append(unrepairableTable(report.document.unrepairable));
  }
}

function addOrigin(report) {
  const section = addSection('origin', 'Where this comes from');
  section.append(table('Origin', ['', ''], report.origin.map(([name, text]) => [name, {text, class: 'text'}])));
  if (!report.options.length) return;
  const rows = report.options.map(({name, value, help}) => [name, value || 'default', help]);
  section.append(make('details', {open: rows.some((row) => row[1] !== 'default')}, make('summary', {}, 'Options'), table('Options', ['Flag', 'Value', 'What it is'], rows)));
}

async function main() {
  const report = JSON.parse(document.getElementById('report').textContent);
  addHead(report);
  const go = await addPictures(report);
  histograms(addSection('histograms', 'Elements by scaled Jacobian', 'Js = min J / max J in each element, 1 at best.'), report);
  if (report.history.iteration?.length) {
    convergence(addSection('convergence', 'Convergence', 'Shaded: the phases of the method.'), report.history);
  }
  addTables(report, go);
  addOrigin(report);
  // Two frames on, all of it has been drawn.
  requestAnimationFrame(() => requestAnimationFrame(() => { document.documentElement.dataset.ready = 'yes'; }));
}

await main();
