// Scales and ticks of a chart's axes.

/** About `wanted` ticks, in steps of 1, 2 or 5 times a power of ten. */
function linearTicks(low, high, wanted) {
  const raw = (high - low) / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= raw * 0.999);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) ticks.push(Number((k * step).toPrecision(12)));
  return ticks;
}

/** Powers of ten between low and high, at most about `wanted`. */
function logTicks(low, high, wanted) {
  const from = Math.ceil(Math.log10(low) - 1e-9);
  const to = Math.floor(Math.log10(high) + 1e-9);
  const every = Math.max(1, Math.ceil((to - from + 1) / wanted));
  const ticks = [];
  for (let k = from; k <= to; k += every) ticks.push(10 ** k);
  return ticks;
}

/** A linear scale: {at(value) in 0…1, ticks, label, unit}. Labels are multiples of `unit`, a power of ten or ''. */
function linearScale(low, high, wanted = 5) {
  const width = high - low || 1;
  const exponent = Math.floor(Math.log10(Math.max(Math.abs(low), Math.abs(high)) || 1));
  const shift = exponent < -2 || exponent > 5 ? exponent : 0;
  return {
    at: (value) => (value - low) / width,
    ticks: linearTicks(low, low + width, wanted),
    label: (value) => String(Number((value / 10 ** shift).toPrecision(10))).replace('-', '−'),
    unit: shift ? powerOfTen(shift) : '',
  };
}

/** A logarithmic scale over the whole decades that contain low and high, which are positive. */
function logScale(low, high, wanted = 5) {
  const from = Math.floor(Math.log10(low) + 1e-9);
  const to = Math.max(from + 1, Math.ceil(Math.log10(high) - 1e-9));
  return {
    at: (value) => (Math.log10(value) - from) / (to - from),
    ticks: logTicks(10 ** from, 10 ** to, wanted),
    label: (value) => powerOfTen(Math.round(Math.log10(value))),
  };
}

/** The range of the finite values, widened at both ends by `margin` times its length; [0, 1] if there are none. */
function rangeOf(values, margin = 0.05) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (!Number.isFinite(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  if (low > high) return [0, 1];
  if (margin === 0) return [low, high];
  // Differences of less than a millionth are noise. A constant curve is in the middle of an axis whose ticks are readable.
  const constant = high - low <= 1e-6 * Math.abs(high);
  const extra = constant ? Math.abs(high) * 0.1 || margin : (high - low) * margin;
  return [low - extra, high + extra];
}
