// Functions that make elements. Text from outside is added as a child and so stays text; nothing here parses markup.

const SVG = 'http://www.w3.org/2000/svg';

/** Sets attributes, except those whose value is undefined or false. */
function set(node, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== undefined && value !== false) node.setAttribute(name, value === true ? '' : value);
  }
  return node;
}

/** make('td', {class: 'number'}, 'text', otherNode) */
function make(name, attributes = {}, ...children) {
  const node = set(document.createElement(name), attributes);
  node.append(...children);
  return node;
}

/** The same for SVG. */
function draw(name, attributes = {}, ...children) {
  const node = set(document.createElementNS(SVG, name), attributes);
  node.append(...children);
  return node;
}

/** The text as children for make(), in which a line never breaks inside a flag such as --min-js. */
function prose(text) {
  return text.split(/(--[a-z][a-z-]*[a-z])/).map((part, i) => (i % 2 ? make('span', {class: 'flag'}, part) : part));
}

/**
 * A table with a caption. Rows are arrays of cells, and a cell is text, a node, or {text, value, class}. Each cell of the body has
 * the text of its column's head in data-head, for tables that become lists on narrow screens.
 */
function table(caption, head, rows) {
  const cell = (content, name, scope, column) => {
    if (content instanceof Node) return make(name, {scope, 'data-head': column}, content);
    const {text, ...attributes} = content !== null && typeof content === 'object' ? content : {text: content};
    return make(name, {class: attributes.class, 'data-value': attributes.value, 'data-head': column, scope}, ...prose(String(text ?? '')));
  };
  const headOf = (one) => (one !== null && typeof one === 'object' ? one.text : one) || undefined;
  const body = rows.map((row) => make('tr', {}, ...row.map((one, i) => cell(one, i ? 'td' : 'th', i ? undefined : 'row', headOf(head[i])))));
  const heads = make('tr', {}, ...head.map((one) => cell(one, 'th', 'col')));
  return make('div', {class: 'scrolls', tabindex: 0, role: 'region', 'aria-label': caption},
      make('table', {}, make('caption', {}, caption), make('thead', {}, heads), make('tbody', {}, ...body)));
}

/** A table cell with a number. The text may be rounded; data-value has all digits. */
function numberCell(value, text = readable(value)) {
  return {text, value: value === null || value === undefined ? undefined : String(value), class: 'number'};
}

/** A control with its label. */
function labelled(text, control) {
  return make('label', {class: 'control'}, make('span', {}, text), control);
}
