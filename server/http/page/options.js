// The form of options, made from the description of the port (/v1/openapi.json).

const FIRST_OPTIONS = ['objective', 'timeLimit', 'until', 'repair'];
const LEFT_OUT_OPTIONS = ['targetField'];  // Values for each cell do not fit into a form.

/** time_limit and --time-limit for timeLimit. */
const withUnderscores = (name) => name.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`);
const flagOf = (name) => `--${withUnderscores(name).replaceAll('_', '-')}`;

/** auto for OBJECTIVE_AUTO, if the values of the enumeration are `all`. */
function spelledValue(value, all) {
  const prefix = all[0].replace(/UNSPECIFIED$/, '');
  return value.slice(prefix.length).toLowerCase().replaceAll('_', '-');
}

/** The first sentence of a comment of the contract, in one line. */
function firstSentence(text = '') {
  const line = text.replace(/\s+/g, ' ');
  return (/^.*?[.;](?=\s|$)/.exec(line)?.[0] ?? line).replace(/;$/, '.');
}

/** What the values of an enumeration mean, by their names: the description has a paragraph NAME: TEXT for each. */
function meanings(schema) {
  const found = {};
  let last = null;
  for (const line of (schema.description ?? '').split('\n')) {
    const begun = /^([A-Z][A-Z0-9_]*): (.*)$/.exec(line);
    if (begun && schema.enum.includes(begun[1])) found[last = begun[1]] = begun[2];
    else if (last) found[last] += ` ${line}`;
  }
  return found;
}

class OptionField {
  /** `prefix`: of the id in the page. */
  constructor(name, schema, schemas, prefix = 'option') {
    this.name = name;
    const resolved = schema.$ref ? schemas[schema.$ref.split('/').at(-1)] : schema;
    this.choices = resolved.enum;
    this.kind = this.choices ? 'choice' : schema.type === 'array' ? 'list' : schema.type === 'boolean' ? 'switch' : 'number';
    this.ofNumbers = schema.items?.format === 'int64' || schema.items?.type === 'number';
    this.whole = schema.type === 'integer';
    this.meanings = this.choices ? meanings(resolved) : {};
    this.hint = make('p', {class: 'quiet small', id: `${prefix}-hint-${name}`}, firstSentence(schema.description));
    this.input = this.makeInput();
    set(this.input, {id: `${prefix}-${name}`, 'aria-describedby': this.hint.id});
    this.input.addEventListener('input', () => this.explain());
    this.node = make('div', {class: 'option'}, make('label', {for: this.input.id}, withUnderscores(name).replaceAll('_', ' ')), this.input, this.hint);
  }

  /** Says what the chosen value means. */
  explain() {
    if (!this.choices) return;
    const chosen = this.input.value || this.choices.find((value) => spelledValue(value, this.choices) === this.usual);
    this.hint.textContent = firstSentence(this.meanings[chosen]).replace(/[A-Z]+(_[A-Z]+)+/g, (word) => (this.choices.includes(word) ? spelledValue(word, this.choices) : word));
  }

  makeInput() {
    if (this.kind === 'choice') {
      // The first value says which one is the default: "The default, auto."
      this.usual = /default, ([a-z-]+)/.exec(this.meanings[this.choices[0]])?.[1];
      return make('select', {}, make('option', {value: ''}, this.usual ? `${this.usual} (default)` : 'default'),
          ...this.choices.slice(1).filter((value) => spelledValue(value, this.choices) !== this.usual).map((value) => make('option', {value}, spelledValue(value, this.choices))));
    }
    if (this.kind === 'switch') return make('select', {}, ...['default', 'on', 'off'].map((value) => make('option', {value: value === 'default' ? '' : value}, value)));
    if (this.kind === 'list') return make('input', {type: 'text', placeholder: 'none; commas between several', autocomplete: 'off'});
    return make('input', {type: 'number', step: this.whole ? 1 : 'any', placeholder: 'default', autocomplete: 'off'});
  }

  /** The value for a JobSpec; undefined: the default. */
  get value() {
    const text = this.input.value.trim();
    if (text === '') return undefined;
    if (this.kind === 'choice') return text;
    if (this.kind === 'switch') return text === 'on';
    if (this.kind === 'number') return Number(text);
    return text.split(',').map((part) => part.trim()).filter(Boolean);
  }

  set value(value) {
    if (value === undefined) this.input.value = '';
    else if (this.kind === 'switch') this.input.value = value ? 'on' : 'off';
    else this.input.value = this.kind === 'list' ? value.join(', ') : String(value);
    this.explain();
  }

  /** The option as words of the command, and as an argument in Python. */
  words() {
    const {value} = this;
    if (value === undefined) return [];
    if (this.name === 'orient') return [value ? '--orient' : '--keep-orientation'];
    if (this.name === 'keepOrders') return value ? ['--keep-orders'] : [];
    if (this.ofNumbers) return [flagOf(this.name), value.join(',')];
    if (this.kind === 'list') return value.flatMap((one) => [flagOf(this.name), one]);
    if (this.kind === 'switch') return [flagOf(this.name), value ? 'on' : 'off'];
    return [flagOf(this.name), this.kind === 'choice' ? spelledValue(value, this.choices) : String(value)];
  }

  argument() {
    const {value} = this;
    if (value === undefined) return [];
    const text = this.kind === 'switch' ? (value ? 'True' : 'False') : this.kind === 'number' ? String(value) :
      this.kind === 'choice' ? JSON.stringify(spelledValue(value, this.choices)) : `[${value.map((one) => (this.ofNumbers ? one : JSON.stringify(one))).join(', ')}]`;
    const keyword = this.name === 'lambda' ? 'lambda_' : withUnderscores(this.name);
    return [`${keyword}=${text}`];
  }
}

let knownDescription = null;

/** The schemas of the messages, by the names that the contract gives them. */
async function schemasOfMessages() {
  knownDescription ??= await askFor('openapi.json');
  return knownDescription.components.schemas;
}

/** All options: four at once, the others behind a click. `beside`: fields of the spec that stand with them. `hasDevice`: whether jobs may have a device here; else that option is neither shown nor kept. */
class OptionForm {
  constructor(schemas, options, beside = [], hasDevice = false) {
    const {properties} = schemas['varimesh.v1.Options'];
    const names = Object.keys(properties).filter((name) => !LEFT_OUT_OPTIONS.includes(name) && (hasDevice || name !== 'device'));
    this.fields = [...FIRST_OPTIONS, ...names.filter((name) => !FIRST_OPTIONS.includes(name))].map((name) => new OptionField(name, properties[name], schemas));
    this.kept = Object.fromEntries(LEFT_OUT_OPTIONS.filter((name) => options[name] !== undefined).map((name) => [name, options[name]]));
    for (const field of this.fields) field.value = options[field.name];
    const first = this.fields.slice(0, FIRST_OPTIONS.length);
    const others = [...this.fields.slice(FIRST_OPTIONS.length), ...beside];
    this.node = make('div', {}, make('div', {class: 'options'}, ...first.map((field) => field.node)),
        make('details', {open: others.some((field) => field.value !== undefined)}, make('summary', {}, `All options (${others.length} more)`),
            make('div', {class: 'options'}, ...others.map((field) => field.node))));
  }

  options() {
    return {...this.kept, ...Object.fromEntries(this.fields.map((field) => [field.name, field.value]).filter(([, value]) => value !== undefined))};
  }
}
