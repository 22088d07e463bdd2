// Marks over a view, whose size does not change with the zoom: rings round the worst elements, crosses on unrepairable ones.

const RINGS = 5;

class Overlay {
  /** rings: [{place}], worst first; crosses: [{place}]. Places are arguments of project() below. */
  constructor(view, rings, crosses) {
    this.svg = draw('svg', {class: 'marks', 'aria-hidden': 'true'});
    this.tip = make('div', {class: 'tip', hidden: true});
    view.append(this.svg, this.tip);
    this.marks = [];
    this.axes = ['x', 'y', 'z'].map((name) => draw('g', {visibility: 'hidden'}, draw('line', {class: 'ring'}), draw('text', {}, name)));
    this.svg.append(...this.axes);
    this.show(rings, crosses);
  }

  /** Shows these marks in place of those before. */
  show(rings, crosses) {
    for (const {node} of this.marks) node.remove();
    this.marks = [];
    for (const {place} of crosses) this.add(place, [crossMark()]);
    rings.slice(0, RINGS).forEach(({place}, i) => this.add(place, [
      draw('circle', {class: 'halo', r: 9}), draw('circle', {class: 'ring', r: 9}), draw('text', {x: 12, y: -6}, String(i + 1)),
    ]));
  }

  add(place, shapes) {
    const node = draw('g', {class: 'mark'}, ...shapes);
    this.svg.append(node);
    this.marks.push({place, node});
  }

  /** Moves the marks. project(place) returns [x, y] in pixels, or null if the place cannot be seen. */
  follow(project) {
    for (const {place, node} of this.marks) {
      const at = project(place);
      if (at) set(node, {transform: `translate(${at[0].toFixed(1)} ${at[1].toFixed(1)})`, visibility: 'visible'});
      else set(node, {visibility: 'hidden'});
    }
  }

  /** Draws the axes in the corner at the bottom left. directions: [x, y] on the screen for each axis, at most 1 long. */
  showAxes(directions) {
    const [size, left, bottom] = [26, 40, this.svg.clientHeight - 40];
    directions.forEach(([x, y], axis) => {
      const [line, text] = this.axes[axis].children;
      set(line, {x1: left, y1: bottom, x2: left + size * x, y2: bottom + size * y});
      set(text, {x: left + 1.35 * size * x - 3, y: bottom + 1.35 * size * y + 4});
      set(this.axes[axis], {visibility: 'visible'});
    });
  }

  /** Shows text beside the pointer, or hides it if the text is empty. */
  showText(text, x = 0, y = 0) {
    this.tip.hidden = !text;
    if (!text) return;
    this.tip.textContent = text;
    const room = this.svg.clientWidth - this.tip.offsetWidth;
    this.tip.style.left = `${Math.max(0, Math.min(x + 12, room - 4))}px`;
    this.tip.style.top = `${Math.max(0, y - this.tip.offsetHeight - 8)}px`;
  }
}
