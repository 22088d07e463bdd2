// Builds the page from top to bottom.

/** A section with a heading, added to the page. */
function addSection(id, title, note) {
  const section = make('section', {id}, make('h2', {}, title));
  if (note) section.append(make('p', {class: 'quiet small'}, ...prose(note)));
  document.getElementById('main').append(section);
  return section;
}

function addHead(report) {
  const [kind, sentence] = verdict(report.document);
  document.title = `${report.title} – VariMesh report`;
  document.getElementById('head').append(
      make('h1', {}, report.title), make('p', {class: `verdict ${kind}`}, ...prose(sentence)),
      ...(report.document.aims ?? []).map((text) => make('p', {class: 'aim'}, ...prose(text.replace(/^objective/, 'Objective').replace(/->/g, '→')))),
      tiles(report.document));
}

/**
 * Adds the views. Returns {go, goToSurface}: functions (place, size), and (surface), that show a place, or where the boundary is
 * farthest from a surface of the CAD model. They are missing if nothing can be shown.
 */
async function addPictures(report) {
  if (!report.scene) {
    if (report.picture_note) addSection('pictures', 'The mesh', report.picture_note);
    return {};
  }
  const section = addSection('pictures', 'The mesh, coloured by scaled Jacobian', report.picture_note);
  const arrays = await unpack(document.getElementById('arrays').textContent, report.scene.arrays);
  const cells = new CellTable(report.scene, arrays);
  const crosses = report.document.unrepairable;
  return (report.scene.dimension === 2 ? pictures2d : pictures3d)(section, report.scene, arrays, cells, crosses, report.document.geometry?.surfaces ?? []);
}

function addTables(report, {go, goToSurface}) {
  const section = addSection('tables', 'Numbers');
  section.append(make('div', {class: 'columns'}, qualityTable(report.document), meshTable(report.document)));
  if (report.scene) {
    const worst = addSection('worst', 'The worst elements', 'The numbers of the rows are those of the rings in the views.');
    worst.append(make('div', {class: 'columns'}, ...report.scene.snapshots.map((snapshot) => worstTable(report.scene, snapshot, go))));
  }
  if (report.document.geometry) {
    const {geometry} = report.document;
    const section = addSection('geometry', 'The boundary and the CAD model', geometry.sentences.join(' '));
    section.append(geometryTable(geometry));
    if (geometry.surfaces.length) section.append(surfacesTable(geometry, goToSurface && ((surface) => {
      goToSurface(surface);
      document.getElementById('pictures').scrollIntoView({block: 'start'});
    })));
  }
  if (report.document.layers_text) {
    addSection('layers', 'Layers').append(...report.document.layers_text.map((line) => make('p', {}, ...prose(line))));
  }
  if (report.document.notes) addSection('notes', 'Notes', report.document.notes.join(' '));
  if (report.document.substitute_targets) {
    const substitutes = report.document.substitute_targets;
    const more = substitutes.count > substitutes.elements.length ? ` and ${grouped(substitutes.count - substitutes.elements.length)} more` : '';
    addSection('substitutes', 'Elements with another target', substitutes.sentence).append(make('p', {}, `Elements ${substitutes.elements.join(', ')}${more}.`));
  }
  if (report.document.unrepairable.length) {
    addSection('unrepairable', 'Elements that cannot be repaired').append(unrepairableTable(report.document.unrepairable));
  }
}

function addOrigin(report) {
  const section = addSection('origin', 'Origin of this report');
  section.append(table('Origin', ['', ''], report.origin.map(([name, text]) => [name, {text, class: 'text'}])));
  if (!report.options.length) return;
  const rows = report.options.map(({name, value, help}) => [name, value || 'default', help]);
  section.append(make('details', {open: rows.some((row) => row[1] !== 'default')}, make('summary', {}, 'Options'), table('Options', ['Flag', 'Value', 'Meaning'], rows)));
}

async function main() {
  const report = JSON.parse(document.getElementById('report').textContent);
  addHead(report);
  const views = await addPictures(report);
  histograms(addSection('histograms', 'Elements by scaled Jacobian', 'The scaled Jacobian of an element is min J / max J; 1 is the best value.'), report);
  if (report.history.iteration?.length) {
    convergence(addSection('convergence', 'Convergence', 'Shading shows the phases of the method.'), report.history);
  }
  addTables(report, views);
  addOrigin(report);
  // After two frames, everything has been drawn.
  requestAnimationFrame(() => requestAnimationFrame(() => { document.documentElement.dataset.ready = 'yes'; }));
}

await main();
