// Charts of the residual, the energy and the smallest scaled Jacobian by iteration, with the phases of the method shaded.

const CURVES = [
  ['residual', 'Residual', 'relative step', true],
  ['energy', 'Energy', 'per area or volume', null],
  ['min_scaled_jacobian', 'Smallest scaled Jacobian', 'at quadrature points', false],
];

function convergence(section, history) {
  const bands = phases(history);
  const columns = make('div', {class: 'columns'});
  for (const [key, title, y, log] of CURVES) {
    const values = history[key];
    const positive = values.every((value) => value > 0);
    // A linear axis would not show an energy that falls by orders of magnitude.
    const decades = positive && Math.max(...values.slice(0, 5000)) > 50 * Math.min(...values.slice(-5000));
    const place = make('div');
    columns.append(place);
    lineChart(place, {x: history.iteration, y: values, log: log ?? decades, bands, zero: key === 'min_scaled_jacobian',
      names: {x: 'iteration', y, title},
      say: (i) => `${history.phase[i]} ${history.iteration[i]}: ${readable(values[i])}, ${duration(history.seconds[i])}, ` +
        `${grouped(history.invalid_elements[i])} not certified`});
  }
  section.append(columns);
}
