// How often each grey level occurs.

const BINS = 256;

/** Returns the counts of levels up to `white` in BINS equal bins, and how many pixels have at least
 * `white`. */
export function count(levels, white) {
  const bins = new Uint32Array(BINS);
  let saturated = 0;
  const shift = Math.max(0, Math.ceil(Math.log2(white + 1)) - 8);
  for (let i = 0; i < levels.length; i++) {
    const level = levels[i];
    bins[Math.min(level >> shift, BINS - 1)]++;
    saturated += level >= white;
  }
  return { bins, saturated };
}

/** Draws a histogram; the height is the logarithm of the count. */
export function draw(canvas, bins) {
  const context = canvas.getContext("2d");
  const { width, height } = canvas;
  const most = Math.log1p(bins.reduce((a, b) => Math.max(a, b), 1));
  context.clearRect(0, 0, width, height);
  context.fillStyle = getComputedStyle(canvas).color;
  bins.forEach((count, bin) => {
    const tall = (Math.log1p(count) / most) * height;
    context.fillRect((bin * width) / BINS, height - tall, width / BINS, tall);
  });
}
