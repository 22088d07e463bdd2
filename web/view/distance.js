// The distance of the boundary from the CAD model: its colours, their legend, and the table of the surfaces.

const SURFACES_SHOWN = 20;
const DECADES = 4;  // Shown below the largest distance.

/** How a surface of the model is called. */
function surfaceName({surface, name}) {
  return name ? `surface ${surface} ‘${name}’` : `surface ${surface}`;
}

/** Colours of distances on a logarithmic scale, the same in all views. Far places stand out as poor elements do. */
class DistanceScale {
  constructor(sets, snapshots) {
    this.most = 0;
    for (const faces of sets) for (const snapshot of snapshots) for (const one of faces.distances(snapshot)) this.most = Math.max(this.most, one);
    this.least = this.most / 10 ** DECADES;
  }

  /** 1 at the largest distance, 0 at the least that has a colour of its own and below. */
  position(distance) {
    if (!(distance > this.least)) return 0;
    return Math.min(1, Math.log10(distance / this.least) / DECADES);
  }

  colour(distance) {
    return distance < 0 ? themeColour('--line') : RAMP[colourIndex(1 - this.position(distance))];
  }
}

/** The colours of all points of a face set, in the linear colour space of the library. */
function distanceColours(faces, scale, snapshot) {
  const colours = new Uint16Array(3 * faces.cells.length * faces.pattern.count);
  let next = 0;
  for (const distance of faces.distances(snapshot)) {
    const colour = scale.colour(distance).map((value) => linearPart(value) * 65535);
    for (let i = 0; i < faces.pattern.count; ++i) for (let c = 0; c < 3; ++c) colours[next++] = colour[c];
  }
  return colours;
}

/** The legend of distances. */
function distanceLegend(scale) {
  const ramp = make('canvas', {class: 'ramp', width: COLOURS, height: 1, 'aria-hidden': 'true'});
  const other = make('canvas', {class: 'swatch', width: 1, height: 1, 'aria-hidden': 'true'});
  const paint = () => {
    const pen = ramp.getContext('2d');
    for (let i = 0; i < COLOURS; ++i) {
      pen.fillStyle = css(RAMP[colourIndex(1 - (i + 0.5) / COLOURS)]);
      pen.fillRect(i, 0, 1, 1);
    }
    const one = other.getContext('2d');
    one.fillStyle = css(themeColour('--line'));
    one.fillRect(0, 0, 1, 1);
  };
  paint();
  followTheme(ramp, paint);
  const text = (distance) => readable(Number(distance.toPrecision(2)));
  return make('div', {class: 'legend'},
      make('span', {}, 'largest distance of a boundary element from the CAD model, in the mesh’s unit of length, on a logarithmic scale'),
      make('span', {}, `≤ ${text(scale.least)}`, ramp, text(scale.most)),
      make('span', {}, other, 'not on the boundary, or its surface is not known'));
}

/** What is known about a face on the boundary, as a part of a sentence; empty if nothing is. */
function describeDistance(faces, face, snapshot, surfaces) {
  const distance = faces.distances(snapshot)?.[face];
  if (!(distance >= 0)) return '';
  const surface = surfaces[faces.surfaces[face]];
  return `, on ${surface ? surfaceName(surface) : 'a surface'}, up to ${readable(Number(distance.toPrecision(3)))} from it`;
}

/**
 * The direction from which a face with these points is seen if nothing but its surface is shown: along its normal, away from the
 * middle of the surface, but never along the vertical axis, about which views turn.
 */
function seenFrom(places, pattern, middle) {
  const corner = (point) => new THREE.Vector3(...places.subarray(3 * point, 3 * point + 3));
  const [first, second, third] = [0, pattern.intervals, pattern.count - 1].map(corner);
  const away = first.clone().sub(middle);
  const normal = second.sub(first).cross(third.sub(first)).normalize();
  if (normal.dot(away) < -1e-6 * away.length()) normal.negate();
  const {x, y, z} = normal;
  return Math.abs(z) > 0.9 ? [x - 0.3, y - 0.4, z] : [x, y, z];
}

/**
 * The face of a surface that is farthest from it: {place, size, from}, the place relative to the centre of the scene, and the
 * direction from which it is seen; null if none is shown.
 */
function farthestFace(sets, surface, snapshot) {
  let found = null;
  let count = 0;
  const middle = new THREE.Vector3();
  for (const faces of sets) {
    faces.distances(snapshot)?.forEach((distance, face) => {
      if (faces.surfaces[face] !== surface) return;
      if (!(found?.distance >= distance)) found = {faces, face, distance};
      const first = 3 * face * faces.pattern.count;
      middle.add(new THREE.Vector3(...faces.positions(snapshot).subarray(first, first + 3)));
      ++count;
    });
  }
  if (!found) return null;
  middle.divideScalar(count);
  const each = 3 * found.faces.pattern.count;
  const places = found.faces.positions(snapshot).subarray(found.face * each, (found.face + 1) * each);
  const low = [0, 1, 2].map((d) => places.reduce((least, value, i) => (i % 3 === d ? Math.min(least, value) : least), Infinity));
  const high = [0, 1, 2].map((d) => places.reduce((most, value, i) => (i % 3 === d ? Math.max(most, value) : most), -Infinity));
  return {place: low.map((value, d) => (value + high[d]) / 2), size: Math.hypot(...low.map((value, d) => high[d] - value)),
    from: seenFrom(places, found.faces.pattern, middle)};
}

/** The surfaces from which the boundary is farthest. show(surface) shows a row's surface in the views; null: there are none. */
function surfacesTable({surfaces}, show) {
  const columns = [];
  for (const [title, pick] of [['Largest', (one) => one?.largest], ['rms', (one) => one?.rms]]) {
    for (const snapshot of ['before', 'after']) {
      columns.push([`${title} ${snapshot}`, (one) => pick(one.distance[snapshot]), readable]);
    }
  }
  for (const snapshot of ['before', 'after']) columns.push([`Folded ${snapshot}`, (one) => one.folded[snapshot], grouped]);
  const shown = columns.filter(([, pick]) => pick(surfaces[0]) !== undefined);
  const rows = surfaces.slice(0, SURFACES_SHOWN).map((one, i) => [
    {text: surfaceName(one), class: 'text'}, numberCell(one.elements, grouped(one.elements)),
    ...shown.map(([, pick, text]) => numberCell(pick(one), text(Number(pick(one).toPrecision(3))))),
    show ? button('show', () => show(i)) : '',
  ]);
  const more = surfaces.length > SURFACES_SHOWN ? ` (the first ${SURFACES_SHOWN} of ${grouped(surfaces.length)})` : '';
  const node = table(`Surfaces of the CAD model, the one from which the boundary is farthest first${more}`,
      ['Surface', {text: 'Elements', class: 'number'}, ...shown.map(([name]) => ({text: name, class: 'number'})), ''], rows);
  node.id = 'surfaces-table';
  return node;
}
