// From base64 text to typed arrays, and from the report's packed data to its values.

function bytes(text) {
  const binary = atob(text);
  const result = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) result[i] = binary.charCodeAt(i);
  return result;
}

/** Little-endian float32 values. */
export const floats = (text) => new Float32Array(bytes(text).buffer);

/** Little-endian uint32 values. */
export const indices = (text) => new Uint32Array(bytes(text).buffer);

/** The JSON value of gzipped base64 text. */
export async function unpack(text) {
  const unzipped = new Blob([bytes(text.trim())]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(unzipped).json();
}
