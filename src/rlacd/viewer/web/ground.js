// What gives a sense of size: a grid on the ground, and round lengths for its cells and for the scale bar.
const { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments } = THREE;

const REACH = 2.6; // of the grid from its middle; the input's longest side is 2
const PIECES = 26; // of a line, so that it can fade

/** The largest of 1, 2 and 5 times a power of ten that is no larger than `length`. */
export function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * ([5, 2].find((step) => step * power <= length) ?? 1);
}

/** A grid of cells of a round length of the file, `scale` frame units each, that fades outward; y is up. */
export function makeGrid(scale) {
  const cell = roundLength(0.4 / scale) * scale;
  const count = Math.floor(REACH / cell);
  const places = [];
  const colors = [];
  const add = (x, z) => {
    places.push(x, 0, z);
    colors.push(1, 1, 1, Math.max(0, 1 - Math.hypot(x, z) / REACH) ** 1.4);
  };
  for (let line = -count; line <= count; line++) {
    for (let piece = 0; piece < PIECES; piece++) {
      const from = REACH * ((2 * piece) / PIECES - 1);
      const to = REACH * ((2 * piece + 2) / PIECES - 1);
      for (const along of [from, to]) add(along, line * cell);
      for (const along of [from, to]) add(line * cell, along);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(places), 3));
  geometry.setAttribute("color", new BufferAttribute(new Float32Array(colors), 4));
  const lines = new LineSegments(
    geometry,
    new LineBasicMaterial({ color: "#7d8896", vertexColors: true, transparent: true, opacity: 0.42, depthWrite: false }),
  );
  lines.renderOrder = -1;
  return lines;
}
