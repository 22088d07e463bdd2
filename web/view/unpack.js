// Unpacks the arrays of numbers that packing.cpp packed.

const ARRAY_TYPES = {Float32: Float32Array, Float64: Float64Array, Int8: Int8Array, Int16: Int16Array, Int32: Int32Array, Uint8: Uint8Array};

function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** Returns {name: typed array} from the base64 text and the directory of the arrays. */
async function unpack(base64, directory) {
  const packed = new Blob([bytesOf(base64)]).stream().pipeThrough(new DecompressionStream('deflate'));
  const bytes = new Uint8Array(await new Response(packed).arrayBuffer());
  const arrays = {};
  for (const [name, {type, offset, length}] of Object.entries(directory)) {
    const values = new ARRAY_TYPES[type](length);
    const size = values.BYTES_PER_ELEMENT;
    const target = new Uint8Array(values.buffer);
    for (let byte = 0; byte < size; ++byte) {
      const from = offset + byte * length;
      for (let i = 0; i < length; ++i) target[i * size + byte] = bytes[from + i];
    }
    if (type === 'Int32') for (let i = 1; i < length; ++i) values[i] += values[i - 1];
    arrays[name] = values;
  }
  return arrays;
}
