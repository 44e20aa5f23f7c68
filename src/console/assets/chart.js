// A chart of values with their standard deviation and the truth.

import { digits } from "./colours.js";

/** Space around the plot for its labels, in pixels: left, top, right, bottom. */
const MARGIN = [64, 22, 10, 22];

/** Returns the indices of the pixels along a line from one pixel to another, both included. */
export function along([x0, y0], [x1, y1], width) {
  const steps = Math.max(Math.abs(x1 - x0), Math.abs(y1 - y0));
  return Array.from({ length: steps + 1 }, (_, i) => {
    const part = steps ? i / steps : 0;
    return Math.round(y0 + part * (y1 - y0)) * width + Math.round(x0 + part * (x1 - x0));
  });
}

/** Draws `values` with a band of two `sigma`, and `truth`, which may each be missing. `at` says where on the axis
 * each value is, in order; `ends` labels both ends of it. `limit` is a line, and values where `bad` is set are on a
 * shaded ground. The title explains the lines unless it is to be `brief`. */
export function draw(canvas, { at, ends, values, sigma, truth, limit, bad, title, unit, brief }) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  // A canvas takes no variables, but the browser resolves them in a property.
  const colour = (name) => {
    canvas.style.color = `var(${name})`;
    return getComputedStyle(canvas).color;
  };
  const [left, top, right, bottom] = MARGIN;
  const band = values.flatMap((value, i) => (sigma ? [value - 2 * sigma[i], value + 2 * sigma[i]] : [value]));
  const all = [...band, ...(truth ?? []), limit].filter(Number.isFinite);
  context.font = "12px system-ui, sans-serif";
  context.fillStyle = colour("--faint");
  if (all.length === 0) {
    context.fillText("no values", left, height / 2);
    return;
  }
  let [low, high] = [Math.min(...all), Math.max(...all)];
  if (low === high) {
    [low, high] = [low - 0.5, high + 0.5];
  }
  const [first, last] = [at[0], at.at(-1)];
  const x = (i) => left + (last > first ? ((width - left - right) * (at[i] - first)) / (last - first) : 0);
  const y = (value) => top + ((height - top - bottom) * (high - value)) / (high - low);
  context.textAlign = "right";
  context.fillText(digits(high, [low, high]), left - 6, top + 8);
  context.fillText(digits(low, [low, high]), left - 6, height - bottom);
  context.fillText(ends[1], width - right, height - 6);
  context.textAlign = "left";
  context.fillText(ends[0], left, height - 6);
  context.fillStyle = colour("--shade");
  bad?.forEach((is, i) => {
    if (is) {
      // Until the next value.
      const [from, to] = [x(i), x(Math.min(i + 1, at.length - 1))];
      context.fillRect(from, top, Math.max(1, to - from), height - top - bottom);
    }
  });
  context.strokeStyle = colour("--line");
  context.strokeRect(left, top, width - left - right, height - top - bottom);
  // A missing value ends a piece of a line.
  const pieces = (ends) => {
    const runs = [];
    let open = null;
    ends.forEach((end, i) => {
      if (end.every(Number.isFinite)) {
        open ??= runs[runs.push([]) - 1];
        open.push([i, end]);
      } else {
        open = null;
      }
    });
    return runs;
  };
  if (sigma) {
    context.fillStyle = colour("--band");
    for (const run of pieces(values.map((value, i) => [value - 2 * sigma[i], value + 2 * sigma[i]]))) {
      context.beginPath();
      run.forEach(([i, [below]]) => context.lineTo(x(i), y(below)));
      run.reverse().forEach(([i, [, above]]) => context.lineTo(x(i), y(above)));
      context.fill();
    }
  }
  const line = (numbers, stroke, dash) => {
    context.strokeStyle = stroke;
    context.setLineDash(dash);
    context.lineWidth = 1.5;
    for (const run of pieces(numbers.map((value) => [value]))) {
      context.beginPath();
      run.forEach(([i, [value]]) => context.lineTo(x(i), y(value)));
      context.stroke();
    }
    context.setLineDash([]);
  };
  if (limit !== undefined) {
    line(values.map(() => limit), colour("--bad"), [2, 3]);
  }
  if (truth) {
    line(truth, colour("--truth"), [6, 3]);
  }
  line(values, colour("--mark"), []);
  context.fillStyle = colour("--text");
  const parts = [`${title}${unit && ` (${unit})`}`, !brief && sigma && "band: ± 2 standard deviations", !brief && truth && "dashed: truth"];
  context.fillText(parts.filter(Boolean).join(", "), left, top - 7);
}
