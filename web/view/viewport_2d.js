// The visible part of the plane, which the views before and after share.

class Viewport2d {
  /** width, height: the size of the mesh. */
  constructor(width, height) {
    this.whole = {width, height};
    this.views = [];
    this.shape = 0.75;
    this.reset();
  }

  reset() {
    this.show(0, 0, Math.max(this.whole.width, this.whole.height / this.shape) * 1.04);
  }

  /** Shows the point (x, y) in the middle; `span` is the visible range of x. */
  show(x, y, span) {
    this.x = x;
    this.y = y;
    this.span = Math.max(span, this.whole.width * 1e-6);
    this.follow();
  }

  follow() {
    for (const view of this.views) view.follow(this);
  }

  /** Changes the span by a factor. The point (x, y) stays where it is on the screen. */
  zoom(factor, x = this.x, y = this.y) {
    this.show(x + (this.x - x) * factor, y + (this.y - y) * factor, this.span * factor);
  }

  pan(x, y) {
    this.show(this.x + x, this.y + y, this.span);
  }

  /** The point of the plane at a pixel of an element. */
  under(element, clientX, clientY) {
    const box = element.getBoundingClientRect();
    const unit = this.span / box.width;
    return [this.x + (clientX - box.left - box.width / 2) * unit, this.y - (clientY - box.top - box.height / 2) * unit];
  }
}

/** Connects the mouse, fingers and keys in a view to the viewport. The wheel scrolls the page unless the view has the focus. */
function steer(element, viewport) {
  const fingers = new Map();
  const unit = () => viewport.span / element.clientWidth;
  element.tabIndex = 0;
  element.addEventListener('focus', () => element.classList.add('active'));
  element.addEventListener('blur', () => element.classList.remove('active'));
  element.addEventListener('pointerdown', (event) => {
    fingers.set(event.pointerId, event);
    element.setPointerCapture(event.pointerId);
  });
  element.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    if (fingers.size === 2) {
      const other = [...fingers.values()].find((one) => one.pointerId !== event.pointerId);
      const gap = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      viewport.zoom(gap(before) / Math.max(1, gap(event)), ...viewport.under(element, other.clientX, other.clientY));
    } else {
      viewport.pan((before.clientX - event.clientX) * unit(), (event.clientY - before.clientY) * unit());
    }
    fingers.set(event.pointerId, event);
  });
  for (const end of ['pointerup', 'pointercancel']) element.addEventListener(end, (event) => fingers.delete(event.pointerId));
  element.addEventListener('wheel', (event) => {
    if (!element.classList.contains('active') && !event.ctrlKey) return;
    event.preventDefault();
    viewport.zoom(1.0015 ** event.deltaY, ...viewport.under(element, event.clientX, event.clientY));
  }, {passive: false});
  element.addEventListener('dblclick', (event) => viewport.zoom(0.5, ...viewport.under(element, event.clientX, event.clientY)));
  element.addEventListener('keydown', (event) => {
    const step = viewport.span / 10;
    const moves = {ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step]};
    if (moves[event.key]) viewport.pan(...moves[event.key]);
    else if (event.key === '+' || event.key === '=') viewport.zoom(0.7);
    else if (event.key === '-') viewport.zoom(1 / 0.7);
    else if (event.key === '0') viewport.reset();
    else return;
    event.preventDefault();
  });
}
