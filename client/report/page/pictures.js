// The section with the views of the mesh, their legend and their controls.

const STAGE_TITLES = {before: 'Before', after: 'After'};

/** A box for each stage, side by side where there is room. */
function viewBoxes(stages) {
  const boxes = {};
  const columns = make('div', {class: 'columns'});
  for (const stage of stages) {
    boxes[stage] = make('div', {class: 'view view-size'});
    columns.append(make('figure', {},
        make('figcaption', {}, make('h3', {}, stages.length > 1 ? STAGE_TITLES[stage] : 'The mesh')), boxes[stage]));
  }
  return {boxes, columns};
}

function button(text, act) {
  const node = make('button', {type: 'button'}, text);
  node.addEventListener('click', act);
  return node;
}

/** A second pair of views of a mesh in which single elements are too small to be seen. */
function closeUp(section, scene, paths, table, crosses) {
  const one = scene.worst[scene.stages[0]][0];
  const viewport = new Viewport2d(scene.box[3] - scene.box[0], scene.box[4] - scene.box[1]);
  if (8 * one.size > viewport.span / 4) return;
  const {boxes, columns} = viewBoxes(scene.stages);
  section.append(make('h2', {}, scene.stages.length > 1 ? 'Round the element that was worst' : 'Round the worst element'), columns);
  viewport.show(one.place[0] - scene.centre[0], one.place[1] - scene.centre[1], 8 * one.size);
  for (const stage of scene.stages) new View2d(boxes[stage], scene, paths, table, stage, viewport, crosses);
}

/** The 2-D views; returns go(place, size), which shows a place in all of them. */
function pictures2d(section, scene, arrays, table, crosses) {
  const {boxes, columns} = viewBoxes(scene.stages);
  const viewport = new Viewport2d(scene.box[3] - scene.box[0], scene.box[4] - scene.box[1]);
  const go = (place, size) => viewport.show(place[0] - scene.centre[0], place[1] - scene.centre[1], 8 * size);
  const last = scene.worst[scene.stages.at(-1)][0];
  section.append(legend(crosses.length > 0), columns, make('div', {class: 'controls'},
      button('Whole mesh', () => viewport.reset()), button('Worst element', () => go(last.place, last.size)),
      button('Nearer', () => viewport.zoom(0.6)), button('Further', () => viewport.zoom(1 / 0.6)),
      make('span', {class: 'quiet small'}, 'Drag to move; click, then turn the wheel, or + − and arrow keys, to zoom.')));
  const paths = new Paths2d(scene, arrays);
  for (const stage of scene.stages) new View2d(boxes[stage], scene, paths, table, stage, viewport, crosses);
  closeUp(section, scene, paths, table, crosses);
  return go;
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

/** What can be chosen of a 3-D mesh. */
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
      slider({min: 0, max: 1, step: 0.01, value: 0.5}, (to) => `${Math.round(100 * to)} %`, move), flip,
      labelled('Elements under', slider({min: 0, max: up, step: up / 100, value: threshold}, (js) => js.toFixed(2),
          (js) => shared.select({threshold: js}))));
}

/** The 3-D views, or a sentence where they cannot be drawn. */
function pictures3d(section, scene, arrays, table, crosses) {
  if (!document.createElement('canvas').getContext('webgl2')) {
    section.append(make('p', {}, 'This browser does not draw in three dimensions (WebGL 2), so the views are left out; all that follows is here.'));
    return null;
  }
  const {boxes, columns} = viewBoxes(scene.stages);
  const whole = scene.whole === scene.cells;
  const shared = new Shared3d(scene, {axis: whole ? 1 : -1, at: 0, flip: false,
    threshold: Math.min(whole ? 0 : 0.5, Math.max(0.01, scene.whole_up_to)), skin: whole ? 'solid' : 'through'});
  shared.choice.flip = whole;
  const go = (place, size) => {
    shared.look(place.map((value, d) => value - scene.centre[d]), 6 * size);
  };
  const last = scene.worst[scene.stages.at(-1)][0];
  const bar = controls3d(scene, shared);
  section.append(legend(crosses.length > 0), columns, bar, make('div', {class: 'controls'},
      button('Whole mesh', () => shared.reset()), button('Worst element', () => go(last.place, last.size)),
      button('Nearer', () => shared.zoom(0.7)), button('Further', () => shared.zoom(1 / 0.7)),
      make('span', {class: 'quiet small'}, 'Drag to turn; click, then turn the wheel, or + − and arrow keys.')));
  if (!whole) {
    section.append(make('p', {class: 'quiet small'}, `Of ${grouped(scene.cells)} elements the page holds those with a face on the ` +
        `boundary, and, whole, the ${grouped(scene.whole)} with the smallest scaled Jacobians.`));
  }
  const sets = scene.sets.map((facts) => new FaceSet(facts, arrays));
  for (const stage of scene.stages) {
    shared.views.push(new View3d(boxes[stage], scene, arrays, sets, table, stage, shared, crosses));
  }
  shared.follow();
  return go;
}
