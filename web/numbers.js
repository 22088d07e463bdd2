// Numbers and times in readable form.

const SUPERSCRIPTS = {'-': '⁻', 0: '⁰', 1: '¹', 2: '²', 3: '³', 4: '⁴', 5: '⁵', 6: '⁶', 7: '⁷', 8: '⁸', 9: '⁹'};

/** 10⁻⁶ for -6. */
function powerOfTen(exponent) {
  if (exponent === 0) return '1';
  return '10' + [...String(exponent)].map((digit) => SUPERSCRIPTS[digit]).join('');
}

/** Whole numbers as 1,234,567. Thin spaces would be lost when the text is copied. */
const GROUPS = new Intl.NumberFormat('en-GB', {maximumFractionDigits: 0});

function grouped(whole) {
  return GROUPS.format(whole);
}

/** "1 element", "3 elements". `many`: the plural, if it is not `one` with an s. */
const counted = (count, one, many = `${one}s`) => `${grouped(count)} ${Number(count) === 1 ? one : many}`;

/** Whole numbers with all digits, others with four significant digits, very large or small ones with a power of ten. */
function readable(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (Number.isInteger(value) && Math.abs(value) < 1e15) return grouped(value).replace('-', '−');
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) {
    const exponent = Math.floor(Math.log10(size));
    return `${(value / 10 ** exponent).toFixed(2)} × ${powerOfTen(exponent)}`.replace(/^-/, '−');
  }
  return String(Number(value.toPrecision(4))).replace('-', '−');
}

/** A scaled Jacobian, always with four decimal places, so that columns line up. */
function jacobian(value) {
  return value === null || value === undefined ? '–' : value.toFixed(4).replace('-', '−');
}

/** 0.42 s, 12.3 s, 4 min 07 s, 2 h 05 min. */
function duration(seconds) {
  if (seconds === null || seconds === undefined) return '–';
  if (seconds < 60) return `${seconds < 10 ? seconds.toFixed(2) : seconds.toFixed(1)} s`;
  const two = (number) => String(Math.floor(number)).padStart(2, '0');
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${two(seconds % 60)} s`;
  return `${Math.floor(seconds / 3600)} h ${two((seconds % 3600) / 60)} min`;
}

/** 2026-11-21 14:05:09 UTC, from anything that Date accepts. */
function instant(time) {
  const date = new Date(time);
  return Number.isNaN(date.valueOf()) ? '–' : `${date.toISOString().slice(0, 19).replace('T', ' ')} UTC`;
}
