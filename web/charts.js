// Line charts and histograms as SVG. They are drawn again when the width available to them changes.

// On the left there is room for the name of the axis beside numbers such as −0.0115.
const CHART_MARGIN = {left: 68, right: 12, top: 20, bottom: 34};

/** Calls `paint(width)` now and whenever the width of `host` changes. */
function followWidth(host, paint) {
  let last = 0;
  const check = () => {
    const width = Math.floor(host.clientWidth);
    if (width > 0 && width !== last) paint(last = width);
  };
  new ResizeObserver(check).observe(host);
  check();
}

/** Draws the ticks, grid and names of both axes. Returns the functions that turn values into pixels. */
function frame(svg, width, height, x, y, xName, yName) {
  const inner = {width: width - CHART_MARGIN.left - CHART_MARGIN.right, height: height - CHART_MARGIN.top - CHART_MARGIN.bottom};
  const px = (value) => CHART_MARGIN.left + x.at(value) * inner.width;
  const py = (value) => CHART_MARGIN.top + (1 - y.at(value)) * inner.height;
  const base = CHART_MARGIN.top + inner.height;
  for (const tick of y.ticks) {
    svg.append(draw('line', {class: 'grid', x1: CHART_MARGIN.left, x2: width - CHART_MARGIN.right, y1: py(tick), y2: py(tick)}));
    svg.append(draw('text', {x: CHART_MARGIN.left - 6, y: py(tick) + 4, 'text-anchor': 'end'}, y.label(tick)));
  }
  for (const tick of x.ticks) {
    svg.append(draw('line', {class: 'axis', x1: px(tick), x2: px(tick), y1: base, y2: base + 4}));
    svg.append(draw('text', {x: px(tick), y: base + 16, 'text-anchor': 'middle'}, x.label(tick)));
  }
  svg.append(draw('line', {class: 'axis', x1: CHART_MARGIN.left, x2: width - CHART_MARGIN.right, y1: base, y2: base}));
  svg.append(draw('text', {x: CHART_MARGIN.left + inner.width / 2, y: base + 30, 'text-anchor': 'middle'}, xName));
  if (yName) {
    if (y.unit) yName += `, ${y.unit}`;
    svg.append(draw('text', {x: 0, y: 0, transform: `translate(11 ${CHART_MARGIN.top + inner.height / 2}) rotate(-90)`,
      'text-anchor': 'middle'}, yName));
  }
  return {px, py, base, inner};
}

/** Indices of at most about `most` points that keep the shape of a long curve: the extremes of each stretch. */
function thinned(x, y, most) {
  if (x.length <= most) return x.map((_, i) => i);
  const stretch = Math.ceil((2 * x.length) / most);
  const kept = [];
  for (let begin = 0; begin < x.length; begin += stretch) {
    let low = begin;
    let high = begin;
    for (let i = begin; i < Math.min(begin + stretch, x.length); ++i) {
      if (y[i] < y[low]) low = i;
      if (y[i] > y[high]) high = i;
    }
    kept.push(...new Set([Math.min(low, high), Math.max(low, high)]));
  }
  kept.push(x.length - 1);
  return kept;
}

/** The path of a curve, with gaps where y is not a number. */
function pathOf(x, y, px, py, log) {
  let path = '';
  let pen = false;
  for (const i of thinned(x, y, 2000)) {
    const there = Number.isFinite(y[i]) && (!log || y[i] > 0);
    if (there) path += `${pen ? 'L' : 'M'}${px(x[i]).toFixed(1)} ${py(y[i]).toFixed(1)}`;
    pen = there;
  }
  return path;
}

/**
 * A line chart with one curve.
 *   x, y     numbers, of the same length; x ascending
 *   log      logarithmic y axis
 *   bands    [{from, to, name}]: stretches of x shaded by .band-NAME, labelled
 *   zero     draw the line y = 0 if it is in range
 *   names    {x, y, title}
 *   say      (index) → text about the point under the pointer
 */
function lineChart(host, {x, y, log = false, bands = [], zero = false, names, say, height = 190}) {
  const readout = make('div', {class: 'readout', 'aria-live': 'off'});
  const place = make('div');
  host.append(make('h3', {}, names.title), place, readout);
  const positive = y.filter((value) => value > 0);
  const scaleX = (width) => linearScale(x.length > 1 ? x[0] : 0, x.length > 1 ? x[x.length - 1] : 1, width < 420 ? 4 : 8);
  const scaleY = () => (log && positive.length ? logScale(...rangeOf(positive, 0)) : linearScale(...rangeOf(y)));
  followWidth(place, (width) => {
    const svg = draw('svg', {class: 'chart', height, viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': names.title});
    const inX = scaleX(width);
    inX.ticks = inX.ticks.filter(Number.isInteger);
    const under = draw('g');
    svg.append(under);
    const {px, py, base, inner} = frame(svg, width, height, inX, scaleY(), names.x, names.y);
    for (const band of bands) {
      const left = px(band.from);
      const wide = Math.max(1, px(band.to) - left);
      under.append(draw('rect', {class: `band band-${band.name}`, x: left, width: wide, y: CHART_MARGIN.top, height: inner.height}));
      if (wide > 8 * band.name.length) svg.append(draw('text', {x: left + 4, y: CHART_MARGIN.top - 6}, band.name));
    }
    if (zero && py(0) > CHART_MARGIN.top && py(0) < base) {
      svg.append(draw('line', {class: 'rule', x1: CHART_MARGIN.left, x2: width - CHART_MARGIN.right, y1: py(0), y2: py(0)}));
    }
    svg.append(draw('path', {class: 'curve', d: pathOf(x, y, px, py, log)}));
    if (x.length === 1) svg.append(draw('circle', {class: 'dot', cx: px(x[0]), cy: py(y[0]), r: 3}));
    if (say) addPointer(svg, {x, px, base, readout, say});
    place.replaceChildren(svg);
  });
}

/** Adds a vertical line that follows the pointer, and text about the point nearest to it. */
function addPointer(svg, {x, px, base, readout, say}) {
  const rule = draw('line', {class: 'rule', y1: CHART_MARGIN.top, y2: base, visibility: 'hidden'});
  svg.append(rule);
  svg.addEventListener('pointermove', (event) => {
    const at = event.clientX - svg.getBoundingClientRect().left;
    let low = 0;
    let high = x.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (px(x[middle]) < at) low = middle + 1;
      else high = middle;
    }
    if (low > 0 && at - px(x[low - 1]) < px(x[low]) - at) --low;
    set(rule, {x1: px(x[low]), x2: px(x[low]), visibility: 'visible'});
    readout.textContent = say(low);
  });
  svg.addEventListener('pointerleave', () => {
    set(rule, {visibility: 'hidden'});
    readout.textContent = '';
  });
}

/** Consecutive iterations of the same phase: [{from, to, name}]. */
function phases(history) {
  const bands = [];
  history.iteration.forEach((number, i) => {
    const name = history.phase[i];
    if (bands.length && bands.at(-1).name === name) bands.at(-1).to = number;
    else bands.push({from: bands.length ? bands.at(-1).to : number, to: number, name});
  });
  return bands;
}

/**
 * A histogram of equal bins of [0, 1], with one more bar on the left for values of 0 or less.
 *   counts, below   counts of the bins, and of the bar on the left
 *   most            the largest count on the axis, so that two histograms can share one
 *   log             give bars the height log(1 + count)
 *   fill            (middle of the bin, or null for the bar on the left) → colour
 */
function histogramChart({width, counts, below, most, log, fill, names, height = 220}) {
  const svg = draw('svg', {class: 'chart', height, viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': names.title});
  const size = (count) => (log ? Math.log10(1 + count) : count);
  const y = linearScale(0, size(most) || 1);
  if (log) {
    y.ticks = [0, ...logTicks(1, Math.max(10, most), 5)].map(size).filter((tick) => tick <= size(most));
    y.label = (tick) => grouped(Math.round(10 ** tick - 1));
  } else {
    y.ticks = y.ticks.filter(Number.isInteger);
    y.label = grouped;
  }
  const x = linearScale(-0.14, 1);
  x.ticks = [0, 0.2, 0.4, 0.6, 0.8, 1];
  const {px, py, base} = frame(svg, width, height, x, y, names.x, names.y);
  const bar = (from, to, count, text, colour) => {
    if (count === 0) return;
    const top = Math.min(py(size(count)), base - 1.5);
    svg.append(draw('rect', {x: px(from) + 0.5, width: Math.max(1, px(to) - px(from) - 1), y: top, height: base - top, fill: colour},
        draw('title', {}, `${text}: ${grouped(count)}`)));
  };
  bar(-0.12, -0.05, below, '0 or less', fill(null));
  svg.append(draw('text', {x: px(-0.085), y: base + 16, 'text-anchor': 'middle'}, '≤ 0'));
  counts.forEach((count, bin) => {
    const from = bin / counts.length;
    const to = (bin + 1) / counts.length;
    bar(from, to, count, `${from.toFixed(2)} to ${to.toFixed(2)}`, fill((from + to) / 2));
  });
  return svg;
}
