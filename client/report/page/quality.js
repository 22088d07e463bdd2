// Key figures, histograms, and the tables of quality, of the worst elements and of the unrepairable elements.

/** The quality reports in a document, in order: [[name of the snapshot, quality]]. */
function qualities(document) {
  return document.quality ? [['before', document.quality]] : [['before', document.before], ['after', document.after]];
}

/** Whether the last snapshot is valid, as ['good' or 'bad', a sentence]. */
function verdict(document) {
  const last = qualities(document).at(-1)[1];
  const {elements} = document.mesh;
  const left = elements - last.certified.valid;
  if (left === 0) return ['good', elements === 1 ? 'The element is certified valid.' : `All ${grouped(elements)} elements are certified valid.`];
  const {sentence, remedies} = document.left ?? {sentence: `${counted(left, 'element is', 'elements are')} not certified valid.`, remedies: []};
  return ['bad', [sentence, ...remedies.map((remedy) => remedy.sentence)].join(' ')];
}

/** The most important figures. */
function tiles(document) {
  const list = qualities(document);
  const [first, last] = [list[0][1], list.at(-1)[1]];
  const pair = (show, pick) => (list.length > 1 ? [make('small', {}, `${show(pick(first))} → `), show(pick(last))] : [show(pick(last))]);
  const tile = (name, ...content) => make('div', {class: 'tile'}, make('dt', {}, name), make('dd', {}, ...content));
  const explained = (node, meaning) => { node.append(make('dd', {class: 'meaning'}, meaning)); return node; };
  const {mesh} = document;
  const all = [
    ...(last.accuracy ? [explained(tile('Loss of accuracy', ...pair((one) => (one === undefined ? '–' : readable(one)), (one) => one.accuracy?.loss)),
        'of a solver; 0 is best')] : []),
    ...(last.in_layers ? [explained(tile('Error in layers', ...pair((one) => (one === undefined ? '–' : readable(one)), (one) => one.in_layers?.error)),
        'of what decays from the wall; 0 is best')] : []),
    explained(tile('Smallest scaled Jacobian', ...pair(jacobian, (one) => one.min_scaled_jacobian)), '1 is best; 0 or less: invalid'),
    tile('Mean scaled Jacobian', ...pair(jacobian, (one) => one.mean_scaled_jacobian)),
    tile('Invalid elements', ...pair(grouped, (one) => one.invalid_elements)),
    tile('Certified valid', ...pair(grouped, (one) => one.certified.valid)),
    tile('Mesh', grouped(mesh.elements), make('small', {}, ` elements of order ${mesh.order}, ${mesh.dimension}\u2011D`)),
  ];
  if (document.iterations !== undefined) {
    all.push(tile('Iterations', grouped(document.iterations), make('small', {}, ` in ${duration(document.seconds)}`)));
  }
  return make('dl', {class: 'tiles'}, ...all);
}

/** Histograms of the snapshots, on the same axes. */
function histograms(section, report) {
  const list = qualities(report.document).filter(([snapshot]) => report.histograms[snapshot]);
  const most = Math.max(...list.flatMap(([snapshot, quality]) => [...report.histograms[snapshot], quality.invalid_elements]), 1);
  let log = most > 50;
  const paint = [];
  const toggle = button('Logarithmic counts', () => {
    log = !log;
    toggle.setAttribute('aria-pressed', log);
    for (const one of paint) one();
  });
  toggle.setAttribute('aria-pressed', log);
  const columns = make('div', {class: 'columns'});
  section.append(make('div', {class: 'controls'}, toggle), columns);
  for (const [snapshot, quality] of list) {
    const title = list.length > 1 ? SNAPSHOT_TITLES[snapshot] : 'All elements';
    const place = make('div');
    columns.append(make('div', {}, make('h3', {}, title), place));
    let width = 0;
    const again = () => width && place.replaceChildren(histogramChart({width, counts: report.histograms[snapshot],
      below: quality.invalid_elements, most, log, fill: (js) => css(colourOf(js ?? -1)),
      names: {x: 'scaled Jacobian', y: 'elements', title: `Histogram of the scaled Jacobian, ${title.toLowerCase()}`}}));
    paint.push(again);
    darkTheme.addEventListener('change', again);
    followWidth(place, (now) => { width = now; again(); });
  }
}

const QUALITY_ROWS = [
  ['Loss of accuracy', (one) => one.accuracy?.loss, readable, 'accuracy.loss'],
  ['Error in layers', (one) => one.in_layers?.error, (value) => (value === undefined ? '–' : readable(value)), 'in_layers.error'],
  ['Smallest scaled Jacobian', (one) => one.min_scaled_jacobian, jacobian, 'min_scaled_jacobian'],
  ['Mean scaled Jacobian', (one) => one.mean_scaled_jacobian, jacobian, 'mean_scaled_jacobian'],
  ['Smallest distortion Jacobian', (one) => one.min_distortion_jacobian, jacobian, 'min_distortion_jacobian'],
  ['Invalid elements, sampled', (one) => one.invalid_elements, grouped, 'invalid_elements'],
  ['Certified valid', (one) => one.certified.valid, grouped, 'certified.valid'],
  ['Certified invalid', (one) => one.certified.invalid, grouped, 'certified.invalid'],
  ['Undecided', (one) => one.certified.undecided, grouped, 'certified.undecided'],
  ['Proved lower bound of the smallest scaled Jacobian', (one) => one.certified.min_scaled_jacobian_lower_bound, jacobian,
    'certified.min_scaled_jacobian_lower_bound'],
];

function qualityTable(document) {
  const list = qualities(document);
  const titles = list.map(([snapshot]) => (list.length > 1 ? SNAPSHOT_TITLES[snapshot] : 'Value'));
  if (document.layers?.thick) {
    list.splice(1, 0, ['thick', document.layers.thick]);
    titles.splice(1, 0, 'Before the split into layers');
  }
  const heads = titles.map((text) => ({text, class: 'number'}));
  const shown = QUALITY_ROWS.filter(([name, pick]) => name !== 'Error in layers' || list.some(([, one]) => pick(one) !== undefined));
  const rows = shown.map(([name, pick, show]) => [name, ...list.map(([, one]) => numberCell(pick(one), show(pick(one))))]);
  const node = table('Quality', ['', ...heads], rows);
  node.id = 'quality-table';
  return node;
}

function meshTable(document) {
  const rows = Object.entries(document.mesh).map(([name, value]) => [name.replace('_', ' '), numberCell(value)]);
  for (const name of ['energy', 'method', 'stop_reason', 'device']) {
    if (document[name]) rows.push([name.replace('_', ' '), {text: document[name], class: 'number'}]);
  }
  for (const [name, show] of [['iterations', grouped], ['seconds', (value) => value.toPrecision(4)], ['residual', readable]]) {
    if (document[name] !== undefined) rows.push([name, numberCell(document[name], show(document[name]))]);
  }
  if (document.converged !== undefined) rows.push(['converged', {text: document.converged ? 'yes' : 'no', class: 'number'}]);
  const node = table(document.energy ? 'Mesh and optimisation' : 'Mesh', ['', {text: 'Value', class: 'number'}], rows);
  node.id = 'mesh-table';
  return node;
}

/** How far the curved boundary lies from its CAD model, before and after its nodes slid. */
function geometryTable({nodes, farthest, folded, distance}) {
  const cells = (pick, show) => ['before', 'after'].map((snapshot) => numberCell(pick(snapshot), show(pick(snapshot))));
  const rows = [
    ['rms distance', ...cells((snapshot) => distance[snapshot].rms, readable)],
    ['Largest distance', ...cells((snapshot) => distance[snapshot].largest, readable)],
    ['Folded boundary elements', ...cells((snapshot) => folded[snapshot], grouped)],
    ['Nodes that slid', '', numberCell(nodes, grouped(nodes))],
    ['Largest movement of a node', '', numberCell(farthest, readable(farthest))],
  ];
  const heads = Object.values(SNAPSHOT_TITLES).map((text) => ({text, class: 'number'}));
  const node = table('Distance between the boundary and the CAD model', ['', ...heads], rows);
  node.id = 'geometry-table';
  return node;
}

/** The table of the worst elements of a snapshot. go(place, size) shows a place in the views. */
function worstTable(scene, snapshot, go) {
  const rows = scene.worst[snapshot].map((one, i) => {
    const show = go ? button('show', () => {
      go(one.place, one.size);
      document.getElementById('pictures').scrollIntoView({block: 'start'});
    }) : '';
    const place = one.place.slice(0, scene.dimension).map((x) => readable(Number(x.toPrecision(3)))).join(', ');
    return [String(i + 1), numberCell(one.number, String(one.number)), one.shape, numberCell(one.scaled_jacobian, jacobian(one.scaled_jacobian)), show, {text: place, class: 'place'}];
  });
  return table(scene.snapshots.length > 1 ? `The worst elements ${snapshot}` : 'The worst elements',
      ['', {text: 'Element', class: 'number'}, 'Shape', {text: 'Scaled Jacobian', class: 'number'}, '', 'Centre'], rows);
}

function unrepairableTable(groups) {
  const most = 50;
  const rows = groups.slice(0, most).map((group, i) =>
    [String(i + 1), group.kind, group.elements.join(', '), numberCell(group.determinant), group.sentence]);
  const more = groups.length > most ? ` (the first ${most} of ${grouped(groups.length)})` : '';
  return table(`Elements that no movement of interior nodes can repair${more}`,
      ['', 'Kind', 'Elements', {text: 'Determinant', class: 'number'}, 'Reason and remedy'], rows);
}
