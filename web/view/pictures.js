// The section with the views of the mesh, their legend and their controls.

const SNAPSHOT_TITLES = {before: 'Before', after: 'After'};

/** A box for each snapshot, side by side if there is room. */
function viewBoxes(snapshots) {
  const boxes = {};
  const columns = make('div', {class: 'columns'});
  for (const snapshot of snapshots) {
    boxes[snapshot] = make('div', {class: 'view view-size'});
    columns.append(make('figure', {},
        make('figcaption', {}, make('h3', {}, snapshots.length > 1 ? SNAPSHOT_TITLES[snapshot] : 'The mesh')), boxes[snapshot]));
  }
  return {boxes, columns};
}

function button(text, act) {
  const node = make('button', {type: 'button'}, text);
  node.addEventListener('click', act);
  return node;
}

/** A second pair of views, for meshes in which single elements are too small to be seen. */
function closeUp(section, scene, paths, table, crosses) {
  const one = scene.worst[scene.snapshots[0]][0];
  const viewport = new Viewport2d(scene.box[3] - scene.box[0], scene.box[4] - scene.box[1]);
  if (8 * one.size > viewport.span / 4) return [];
  const {boxes, columns} = viewBoxes(scene.snapshots);
  section.append(make('h2', {}, scene.snapshots.length > 1 ? 'Around the element that was worst' : 'Around the worst element'), columns);
  viewport.show(one.place[0] - scene.centre[0], one.place[1] - scene.centre[1], 8 * one.size);
  return scene.snapshots.map((snapshot) => new View2d(boxes[snapshot], scene, paths, table, snapshot, viewport, crosses));
}

/**
 * Adds the 2-D views. Returns {go(place, size), show(scene, arrays, table)}: shows a place in all of them, or a mesh that has moved
 * in place of the one before.
 */
function pictures2d(section, scene, arrays, table, crosses) {
  const {boxes, columns} = viewBoxes(scene.snapshots);
  const viewport = new Viewport2d(scene.box[3] - scene.box[0], scene.box[4] - scene.box[1]);
  const go = (place, size) => viewport.show(place[0] - scene.centre[0], place[1] - scene.centre[1], 8 * size);
  const last = scene.worst[scene.snapshots.at(-1)][0];
  section.append(legend(crosses.length > 0), columns, make('div', {class: 'controls'},
      button('Whole mesh', () => viewport.reset()), button('Worst element', () => go(last.place, last.size)),
      button('Zoom in', () => viewport.zoom(0.6)), button('Zoom out', () => viewport.zoom(1 / 0.6)),
      make('span', {class: 'quiet small'}, 'Drag to move. After a click on a view, the wheel and the keys + and − zoom, and the arrow keys move.')));
  const paths = new Paths2d(scene, arrays);
  const views = scene.snapshots.map((snapshot) => new View2d(boxes[snapshot], scene, paths, table, snapshot, viewport, crosses));
  views.push(...closeUp(section, scene, paths, table, crosses));
  const show = (moved, movedArrays, movedTable) => {
    const movedPaths = new Paths2d(moved, movedArrays);
    for (const view of views) view.show(moved, movedPaths, movedTable);
  };
  return {go, show};
}

function choice(names, chosen, act) {
  const select = make('select', {}, ...names.map((name, i) => make('option', {value: i, selected: i === chosen}, name)));
  select.addEventListener('change', () => act(Number(select.value)));
  return select;
}

function slider({min, max, step, value}, show, act) {
  const input = make('input', {type: 'range', min, max, step, value});
  const output = make('output', {}, show(value));
  input.addEventListener('input', () => {
    output.textContent = show(Number(input.value));
    act(Number(input.value));
  });
  return make('span', {class: 'control'}, input, output);
}

const SKINS = ['solid', 'through', 'none'];

/** The controls that choose what is shown of a 3-D mesh. */
function controls3d(scene, shared) {
  const {axis, at, threshold, skin} = shared.choice;
  let side = 0.5;
  const move = (to) => {
    side = to;
    const along = shared.choice.axis;
    shared.select({at: along < 0 ? 0 : (2 * side - 1) * shared.half[along] * 1.001});
  };
  const flip = button('Other side', () => {
    shared.select({flip: !shared.choice.flip});
    flip.setAttribute('aria-pressed', shared.choice.flip);
  });
  const up = Math.max(0.01, Math.min(1, scene.whole_up_to));
  return make('div', {class: 'controls'},
      labelled('Boundary', choice(['solid', 'see-through', 'hidden'], SKINS.indexOf(skin), (i) => shared.select({skin: SKINS[i]}))),
      labelled('Cut', choice(['none', 'across x', 'across y', 'across z'], axis + 1, (i) => { shared.select({axis: i - 1}); move(side); })),
      labelled('at', slider({min: 0, max: 1, step: 0.01, value: 0.5}, (to) => `${Math.round(100 * to)} %`, move)), flip,
      labelled('Elements below', slider({min: 0, max: up, step: up / 100, value: threshold}, (js) => js.toFixed(2),
          (js) => shared.select({threshold: js}))),
      labelled('Only element', onlyElement(shared)), button('All elements', () => shared.isolate(null)));
}

/** A field for the number of the one element that is shown. */
function onlyElement(shared) {
  const input = make('input', {type: 'number', min: 0, step: 1, placeholder: 'number', class: 'element-number'});
  input.addEventListener('change', () => shared.isolate(input.value === '' ? null : Number(input.value)));
  shared.onIsolate = (number, found) => {
    input.value = number ?? '';
    input.setCustomValidity(found ? '' : 'The page has no element with this number.');
    input.reportValidity();
  };
  return input;
}

/** Saves the picture of each view as a file: mesh-before.png and mesh-after.png for mesh.msh. */
function savePictures(shared) {
  const mesh = document.title.split(' – ')[0].replace(/\.[^.]+$/, '');
  for (const view of shared.views) make('a', {href: view.picture(), download: `${mesh}-${view.snapshot}.png`}).click();
}

const COLOURINGS = ['jacobian', 'distance'];

/** Lets one choose what the colours mean, and shows the legend of the choice in `place`. */
function colourControl(place, shared, hasCrosses) {
  const legends = {jacobian: legend(hasCrosses), distance: distanceLegend(shared.scale)};
  const select = choice(['scaled Jacobian', 'distance from the CAD model'], 0, (i) => shared.colourBy(COLOURINGS[i]));
  select.id = 'colouring';
  shared.onColour = (colour) => {
    place.replaceChildren(legends[colour]);
    select.value = COLOURINGS.indexOf(colour);
    place.closest('section').querySelector('h2').textContent = `The mesh, coloured by ${select.selectedOptions[0].textContent}`;
  };
  place.replaceChildren(legends.jacobian);
  return labelled('Colours', select);
}

/** Adds the 3-D views, or a sentence if they cannot be drawn. Returns {go, show, goToSurface(surface), dispose()}, as pictures2d() and addPictures(). */
function pictures3d(section, scene, arrays, table, crosses, surfaces) {
  const painter = Painter3d.create();
  if (!painter) {
    section.append(make('p', {}, 'This browser cannot draw in three dimensions (WebGL 2), so there are no views. The rest of the report is complete.'));
    return {};
  }
  const {boxes, columns} = viewBoxes(scene.snapshots);
  const whole = scene.whole === scene.cells;
  const shared = new Shared3d(scene, painter, scene.corners && !scene.makeMore ? new CornerCells(arrays, scene.more ? 'cut' : 'all') : null, {axis: scene.first_cut, at: 0, flip: true, threshold: 0, skin: 'solid', only: null, surface: -1, colour: 'jacobian'});
  const go = (place, size) => {
    shared.look(place.map((value, d) => value - scene.centre[d]), 6 * size);
  };
  const last = scene.worst[scene.snapshots.at(-1)][0];
  const sets = scene.sets.map((description) => new FaceSet(description, arrays));
  const bar = controls3d(scene, shared);
  const place = make('div', {}, legend(crosses.length > 0));
  if (scene.distances) {
    Object.assign(shared, {surfaces, scale: new DistanceScale(sets, scene.snapshots)});
  }
  section.append(place, columns, bar, make('div', {class: 'controls'},
      button('Whole mesh', () => shared.reset()), button('Worst element', () => go(last.place, last.size)),
      button('Zoom in', () => shared.zoom(0.7)), button('Zoom out', () => shared.zoom(1 / 0.7)),
      button('Save as PNG', () => savePictures(shared)),
      make('span', {class: 'quiet small'}, 'Drag to turn. A double click shows only the element under it, or all again. After a click on a view, the wheel and the keys + and − zoom, and the arrow keys turn.')));
  if (!whole) {
    section.append(make('p', {class: 'quiet small'}, `The mesh has ${grouped(scene.cells)} elements. Those on the boundary, and the ` +
        `${grouped(scene.whole)} with the smallest scaled Jacobians, are drawn curved, the others that a cut goes through with straight edges.`));
  }
  if (scene.distances) bar.prepend(colourControl(place, shared, crosses.length > 0));
  for (const snapshot of scene.snapshots) {
    shared.views.push(new View3d(boxes[snapshot], scene, arrays, sets, table, snapshot, shared, crosses));
  }
  shared.follow();
  const goToSurface = (surface) => {
    const face = farthestFace(sets.filter((faces) => faces.set === 'skin'), surface, scene.snapshots.at(-1));
    if (!face) return;
    shared.select({surface, only: null});
    shared.colourBy('distance');
    shared.look(face.place, 8 * face.size, face.from);
  };
  const dispose = () => {
    for (const view of shared.views) view.dispose();
    painter.dispose();
  };
  const show = (moved, movedArrays, movedTable) => {
    const movedSets = moved.sets.map((description) => new FaceSet(description, movedArrays));
    shared.forget(moved);
    for (const view of shared.views) view.show(moved, movedArrays, movedSets, movedTable);
    shared.select({});
  };
  return {go, show, goToSurface: scene.distances ? goToSurface : null, dispose};
}
