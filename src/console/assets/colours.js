// Colours of values: tables that people with any colour vision can read.

/** Number of steps of a table; the colour after the last is that of missing values. */
export const STEPS = 1024;
/** Share of values outside the range that is chosen, at each end. */
const TAIL = 0.01;
/** Maximum number of values that the range is chosen by. */
const SAMPLES = 20_000;
const MISSING = [58, 62, 66];
const SATURATED = [255, 158, 51];

/** Viridis by S. van der Walt and N. Smith (CC0), eleven of its colours. */
const LINEAR = [
  [68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140],
  [34, 168, 132], [68, 191, 112], [122, 209, 81], [189, 223, 38], [253, 231, 37],
];
/** Blue, white, orange: apart also without red or green. */
const SIGNED = [[5, 48, 97], [67, 147, 195], [209, 229, 240], [247, 247, 247], [253, 219, 199], [230, 138, 60], [127, 59, 8]];
/** A closed circle, light at a half turn and dark at none. */
const TURN = [[48, 18, 59], [84, 91, 181], [120, 160, 205], [226, 217, 226], [205, 150, 110], [150, 60, 70], [48, 18, 59]];
/** Palette of M. Okabe and K. Ito. The first is that of pixels without fault. */
const CLASSES = [[200, 204, 208], [230, 159, 0], [0, 92, 160], [240, 228, 66], [204, 121, 167], [86, 180, 233], [213, 94, 0], [0, 158, 115]];

const pack = (bytes) => new Uint32Array(Uint8ClampedArray.from(bytes).buffer);

/** Returns the colour of each grey level as a sample of an image. Levels from `white` on are marked if `marks`. */
export function greys(white, marks) {
  const levels = Math.min(white, 0xffff);
  const bytes = new Uint8ClampedArray(4 * (levels + 1));
  for (let level = 0; level <= levels; level++) {
    const grey = (255 * level) / white;
    bytes.set(level < white || !marks ? [grey, grey, grey, 255] : [...SATURATED, 255], 4 * level);
  }
  return new Uint32Array(bytes.buffer);
}

/** Returns the table of a layer's scale as RGBA. */
function table({ scale }) {
  const stops = { signed: SIGNED, turn: TURN, classes: CLASSES }[scale] ?? LINEAR;
  const bytes = [];
  for (let step = 0; step < STEPS; step++) {
    if (scale === "classes") {
      bytes.push(...stops[Math.min(step, stops.length - 1)], 255);
      continue;
    }
    const at = (step / (STEPS - 1)) * (stops.length - 1);
    const left = Math.min(Math.floor(at), stops.length - 2);
    bytes.push(...[0, 1, 2].map((c) => stops[left][c] + (at - left) * (stops[left + 1][c] - stops[left][c])), 255);
  }
  return bytes;
}

/** Returns the colour of each step as a sample of an image, and of missing values after the last. */
export function samples(layer) {
  return pack([...table(layer), ...MISSING, 255]);
}

/** Returns the same colours for a texture. */
export function texture(layer) {
  return Uint8Array.from(table(layer));
}

export function css(layer, step) {
  const [red, green, blue] = table(layer).slice(4 * step, 4 * step + 3);
  return `rgb(${red} ${green} ${blue})`;
}

/** Returns the range of values that the colours span: without the extreme hundredths, and with zero in the
 * middle for deviations. `stride` and `offset` select the values. */
export function range({ scale, names }, values, stride = 1, offset = 0) {
  if (scale === "turn") {
    return [0, 2 * Math.PI];
  }
  if (scale === "classes") {
    return [0, names.length - 1];
  }
  const count = Math.floor(values.length / stride);
  const taken = Math.min(count, SAMPLES);
  const some = [];
  for (let k = 0; k < taken; k++) {
    // Spread over rows and columns alike by the golden ratio, whatever the width.
    const i = offset + stride * (taken === count ? k : Math.floor(((k * 0.6180339887498949) % 1) * count));
    if (Number.isFinite(values[i])) {
      some.push(scale === "signed" ? Math.abs(values[i]) : values[i]);
    }
  }
  if (some.length === 0) {
    return [0, 1];
  }
  some.sort((a, b) => a - b);
  const at = (part) => some[Math.round(part * (some.length - 1))];
  const [low, high] = scale === "signed" ? [-at(1 - TAIL), at(1 - TAIL)] : [at(TAIL), at(1 - TAIL)];
  return low < high ? [low, high] : [low - 0.5, high + 0.5];
}

/** Writes the step of each value. */
export function quantise({ scale }, values, [low, high], steps) {
  const factor = scale === "classes" ? 1 : (STEPS - 1) / (high - low);
  for (let i = 0; i < values.length; i++) {
    const step = (values[i] - low) * factor + 0.5;
    // A comparison with NaN is false.
    steps[i] = step >= STEPS ? STEPS - 1 : step >= 0 ? step : step < 0 ? 0 : STEPS;
  }
}

/** Returns a number with as many digits as the range calls for. */
export function digits(value, [low, high]) {
  const places = Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(high - low))));
  return value.toFixed(places);
}
