// What is known of each cell that is shown: its number, quality and marks.

const MARK_UNCERTIFIED = {before: 1, after: 2};
const MARK_UNREPAIRABLE = 4;

class CellTable {
  constructor(scene, arrays) {
    this.count = scene.shown;
    this.js = {};
    for (const stage of scene.stages) this.js[stage] = arrays[`js_${stage}`];
    this.marks = arrays.marks;
    this.numbers = new Float64Array(this.count);
    let number = 0;
    for (let i = 0; i < this.count; ++i) this.numbers[i] = number += arrays.numbers[i];
  }

  invalid(stage, cell) {
    return !(this.js[stage][cell] > 0) || (this.marks[cell] & MARK_UNCERTIFIED[stage]) !== 0;
  }

  unrepairable(cell) {
    return (this.marks[cell] & MARK_UNREPAIRABLE) !== 0;
  }

  /** A line of text about a cell. */
  say(stage, cell) {
    const value = this.js[stage][cell];
    let text = `element ${this.numbers[cell]}: scaled Jacobian ${jacobian(value)}`;
    if (!(value > 0)) text += ', invalid';
    else if (this.invalid(stage, cell)) text += ', not certified';
    if (this.unrepairable(cell)) text += ', cannot be repaired';
    return text;
  }
}
