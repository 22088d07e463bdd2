// The number, quality and marks of each cell that is shown.

const MARK_UNCERTIFIED = {before: 1, after: 2};
const MARK_UNREPAIRABLE = 4;

class CellTable {
  constructor(scene, arrays) {
    this.count = scene.shown;
    this.js = {};
    for (const snapshot of scene.snapshots) this.js[snapshot] = arrays[`js_${snapshot}`];
    this.marks = arrays.marks;
    this.numbers = new Float64Array(this.count);
    let number = 0;
    for (let i = 0; i < this.count; ++i) this.numbers[i] = number += arrays.numbers[i];  // They arrive as differences.
  }

  invalid(snapshot, cell) {
    return !(this.js[snapshot][cell] > 0) || (this.marks[cell] & MARK_UNCERTIFIED[snapshot]) !== 0;
  }

  unrepairable(cell) {
    return (this.marks[cell] & MARK_UNREPAIRABLE) !== 0;
  }

  /** One line of text about a cell. */
  describe(snapshot, cell) {
    const value = this.js[snapshot][cell];
    let text = `element ${this.numbers[cell]}: scaled Jacobian ${jacobian(value)}`;
    if (!(value > 0)) text += ', invalid';
    else if (this.invalid(snapshot, cell)) text += ', not certified';
    if (this.unrepairable(cell)) text += ', cannot be repaired';
    return text;
  }
}
