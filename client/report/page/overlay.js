// Marks over a view, of the same size however near it is: rings round the worst elements, crosses where nothing helps.

const RINGS = 5;

class Overlay {
  /** rings: [{place}], worst first; crosses: [{place}]; places as the view's project() takes them. */
  constructor(view, rings, crosses) {
    this.svg = draw('svg', {class: 'marks', 'aria-hidden': 'true'});
    this.tip = make('div', {class: 'tip', hidden: true});
    view.append(this.svg, this.tip);
    this.marks = [];
    for (const {place} of crosses) this.add(place, [crossMark()]);
    rings.slice(0, RINGS).forEach(({place}, i) => this.add(place, [
      draw('circle', {class: 'halo', r: 9}), draw('circle', {class: 'ring', r: 9}), draw('text', {x: 12, y: -6}, String(i + 1)),
    ]));
  }

  add(place, shapes) {
    const node = draw('g', {}, ...shapes);
    this.svg.append(node);
    this.marks.push({place, node});
  }

  /** project(place) → [x, y] in pixels, or null where it is out of sight. */
  follow(project) {
    for (const {place, node} of this.marks) {
      const at = project(place);
      if (at) set(node, {transform: `translate(${at[0].toFixed(1)} ${at[1].toFixed(1)})`, visibility: 'visible'});
      else set(node, {visibility: 'hidden'});
    }
  }

  /** Text beside the pointer; none hides it. */
  say(text, x = 0, y = 0) {
    this.tip.hidden = !text;
    if (!text) return;
    this.tip.textContent = text;
    const room = this.svg.clientWidth - this.tip.offsetWidth;
    this.tip.style.left = `${Math.max(0, Math.min(x + 12, room - 4))}px`;
    this.tip.style.top = `${Math.max(0, y - 34)}px`;
  }
}
