// Reads meshes and the quality of their cells from sequences of MeshPart messages (MESH_FORMAT_PARTS and
// MESH_FORMAT_CELL_QUALITY), whose fields proto/varimesh/v1/mesh.proto numbers.

const PART = {header: 1, coordinates: 2, elements: 3, group: 4, quality: 6};
const CELL_VALID = 1;
const MOST_ORDER = 10;

/** Reads the fields of one message, which lies in `bytes` from `at` to `end`. */
class Wire {
  constructor(bytes, at = 0, end = bytes.length) {
    Object.assign(this, {bytes, at, end});
  }

  /** A number of 64 bits, exact up to 2⁵³. A negative int32 comes as such. */
  varint() {
    let value = 0;
    for (let shift = 1; ; shift *= 128) {
      if (this.at >= this.end) throw new Error('The mesh that the server has sent is cut off; try again.');
      const byte = this.bytes[this.at++];
      value += (byte & 127) * shift;
      if (byte < 128) return value >= 2 ** 63 ? value - 2 ** 64 : value;
    }
  }

  /** The next field as {number, type}; null at the end. */
  field() {
    if (this.at >= this.end) return null;
    const key = this.varint();
    return {number: Math.floor(key / 8), type: key % 8};
  }

  /** The message, text or packed numbers of a field that has a length. */
  inner() {
    const size = this.varint();
    const inner = new Wire(this.bytes, this.at, this.at + size);
    if (inner.end > this.end) throw new Error('The mesh that the server has sent is cut off; try again.');
    this.at = inner.end;
    return inner;
  }

  skip(type) {
    if (type === 0) this.varint();
    else if (type === 2) this.inner();
    else this.at += type === 1 ? 8 : 4;
  }

  rest() {
    return this.bytes.subarray(this.at, this.end);
  }

  text() {
    return new TextDecoder().decode(this.rest());
  }

  /** All of it as packed doubles. */
  doubles() {
    return new Float64Array(this.bytes.slice(this.at, this.end).buffer);
  }

  /** All of it as packed varints, in an array of this type. Each has a byte at least. */
  varints(Type) {
    const values = new Type(this.end - this.at);
    let count = 0;
    while (this.at < this.end) values[count++] = this.varint();
    return values.subarray(0, count);
  }
}

/** Calls take[number](value) for the fields of a message: a Wire for those that have a length, a number for the others. */
function readFields(wire, take) {
  for (let field = wire.field(); field; field = wire.field()) {
    if (!take[field.number]) wire.skip(field.type);
    else take[field.number](field.type === 2 ? wire.inner() : wire.varint());
  }
}

/** Calls take[number](wire) for each of the MeshPart messages. */
function readParts(bytes, take) {
  const all = new Wire(bytes);
  while (all.at < all.end) readFields(all.inner(), take);
}

/** The arrays one after another. */
function joinedArrays(Type, arrays) {
  const whole = new Type(arrays.reduce((sum, array) => sum + array.length, 0));
  let at = 0;
  for (const array of arrays) {
    whole.set(array, at);
    at += array.length;
  }
  return whole;
}

/** Physical groups come before or after the numbers that follow them, so a tag may be a single number or packed ones. */
const numbersOf = (value) => (value instanceof Wire ? [...value.varints(Float64Array)] : [value]);

function readElements(wire) {
  const part = {shape: 0, entity: 0, physical: [], nodes: new Int32Array(0)};
  readFields(wire, {
    1: (value) => { part.shape = value; },
    2: (value) => { part.entity = value; },
    3: (value) => part.physical.push(...numbersOf(value)),
    4: (value) => { part.nodes = value.varints(Int32Array); },
  });
  return part;
}

/** The mesh: {dimension, order, xyz, blocks: [{shape, entity, physical, nodes}], groups: [{dimension, tag, name}]}. */
function readMesh(bytes) {
  const mesh = {dimension: 0, order: 0, blocks: [], groups: []};
  const xyz = [];
  readParts(bytes, {
    [PART.header]: (wire) => readFields(wire, {1: (value) => { mesh.dimension = value; }, 2: (value) => { mesh.order = value; }}),
    [PART.coordinates]: (wire) => readFields(wire, {1: (inner) => xyz.push(inner.doubles())}),
    [PART.elements]: (wire) => mesh.blocks.push(readElements(wire)),
    [PART.group]: (wire) => {
      const group = {dimension: 0, tag: 0, name: ''};
      readFields(wire, {1: (value) => { group.dimension = value; }, 2: (value) => { group.tag = value; }, 3: (value) => { group.name = value.text(); }});
      mesh.groups.push(group);
    },
  });
  // A hostile mesh may have taken over the process that has written this.
  if (![2, 3].includes(mesh.dimension) || !(mesh.order >= 1 && mesh.order <= MOST_ORDER)) throw new Error('The server has sent what is no mesh.');
  mesh.xyz = joinedArrays(Float64Array, xyz);
  return mesh;
}

/** The quality of all cells in their order: {numbers, js, answers}. */
function readQuality(bytes) {
  const [numbers, js, answers] = [[], [], []];
  readParts(bytes, {
    [PART.quality]: (wire) => readFields(wire, {
      1: (inner) => numbers.push(inner.varints(Float64Array)),
      2: (inner) => js.push(inner.doubles()),
      3: (inner) => answers.push(inner.varints(Uint8Array)),
    }),
  });
  return {numbers: joinedArrays(Float64Array, numbers), js: joinedArrays(Float64Array, js), answers: joinedArrays(Uint8Array, answers)};
}
