// The colours of scaled Jacobians. Equal steps look equal, and the colours differ in lightness, so colour vision is not needed.

const COLOURS = 64;

/** sRGB from OKLCH (B. Ottosson, A perceptual color space for image processing, 2020), each 0…255. */
function srgb(lightness, chroma, hue) {
  const a = chroma * Math.cos(hue);
  const b = chroma * Math.sin(hue);
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  const linear = [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
  return linear.map((value) => {
    const clipped = Math.min(1, Math.max(0, value));
    return Math.round(255 * (clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * clipped ** (1 / 2.4) - 0.055));
  });
}

/** Colours from dark violet through blue and green to pale yellow, in equal steps of lightness. */
function colourTable() {
  return Array.from({length: COLOURS}, (_, i) => {
    const t = i / (COLOURS - 1);
    const hue = ((305 - 200 * t) * Math.PI) / 180;
    return srgb(0.3 + 0.64 * t, 0.1 - 0.02 * t + 0.12 * t * (1 - t), hue);
  });
}

const RAMP = colourTable();
const darkTheme = matchMedia('(prefers-color-scheme: dark)');
const themed = new Set();  // WeakRefs of nodes, so that what has left the page can be forgotten.
const paints = new WeakMap();  // By node.

/** Calls paint() whenever the theme changes, as long as the node is in use. A node has one such function. */
function followTheme(node, paint) {
  themed.add(new WeakRef(node));
  paints.set(node, paint);
}

darkTheme.addEventListener('change', () => {
  for (const one of themed) {
    const node = one.deref();
    if (node) paints.get(node)();
    else themed.delete(one);
  }
});

/** The index of the colour of Js. Poor elements stand out: they are dark in the light theme and light in the dark theme. */
function colourIndex(js) {
  const bin = Math.min(COLOURS - 1, Math.max(0, Math.floor(js * COLOURS)));
  return darkTheme.matches ? COLOURS - 1 - bin : bin;
}

/** A colour of the theme, by the name of its custom property, as [r, g, b]. */
function themeColour(name) {
  const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
}

/** The colour of Js as [r, g, b]. Elements whose Js is not positive have a colour that is not in the ramp. */
function colourOf(js) {
  return js > 0 ? RAMP[colourIndex(js)] : themeColour('--invalid');
}

const css = ([r, g, b]) => `rgb(${r} ${g} ${b})`;

/** The legend of colours and marks. */
function legend(hasUnrepairable) {
  const ramp = make('canvas', {class: 'ramp', width: COLOURS, height: 1, 'aria-hidden': 'true'});
  const invalid = make('canvas', {class: 'swatch', width: 1, height: 1, 'aria-hidden': 'true'});
  const paint = () => {
    const pen = ramp.getContext('2d');
    for (let i = 0; i < COLOURS; ++i) {
      pen.fillStyle = css(colourOf((i + 0.5) / COLOURS));
      pen.fillRect(i, 0, 1, 1);
    }
    const one = invalid.getContext('2d');
    one.fillStyle = css(colourOf(-1));
    one.fillRect(0, 0, 1, 1);
  };
  paint();
  followTheme(ramp, paint);
  const sign = (shape) => draw('svg', {width: 16, height: 16, viewBox: '-8 -8 16 16', 'aria-hidden': 'true'}, ...shape);
  const parts = [
    make('span', {}, 'scaled Jacobian 0', ramp, '1'),
    make('span', {}, invalid, 'invalid: Jacobian not positive everywhere'),
    make('span', {}, sign([draw('circle', {class: 'ring', r: 6})]), 'worst elements, numbered'),
  ];
  if (hasUnrepairable) parts.push(make('span', {}, sign([crossMark()]), 'cannot be repaired by moving nodes'));
  return make('div', {class: 'legend'}, ...parts);
}

/** The mark of an unrepairable element. */
function crossMark() {
  return draw('path', {class: 'cross', d: 'M-5 -5L5 5M-5 5L5 -5'});
}
