// What has been measured: maps, the cloud, a profile along a line; and the pattern being projected.

import { Picture } from "./picture.js";
import * as colours from "./colours.js";
import * as chart from "./chart.js";
import { savePicture } from "./save.js";

/** Layers in the list until the first measurement says what there is. */
const FIRST = [{ name: "depth", title: "Depth", unit: "mm", scale: "linear" }];
const [CLOUD, PATTERN] = ["cloud", "pattern"];
/** What the colours of the cloud may show. */
const POINT_LAYERS = ["depth", "depth_sigma", "error", "true_depth", "intensity", "modulation"];
/** Titles of colours of points that say more than those of the layers. */
const POINT_TITLES = { true_depth: "True surface" };

/** Time over which scans are counted. */
const COUNTED_MS = 5000;

const $ = (id) => document.getElementById(id);

/** Returns the parts of the address after the #, where a link keeps what is shown. */
const kept = () => new URLSearchParams(location.hash.slice(1));

function keep(name, value) {
  const all = kept();
  all.set(name, value);
  history.replaceState(null, "", `#${all}`);
}

export class Result {
  /** `want` is called with what the console is to send of each measurement, `seen` with the number of a
   * measurement that has been drawn. */
  constructor(want, seen) {
    this.want = want;
    this.seen = seen;
    this.view = kept().get("view") ?? CLOUD;
    this.colour = kept().get("colour") ?? "depth";
    this.picture = new Picture($("result-view"), $("result-picture"), () => this.moved(), (pixel) => this.showPixel(pixel));
    this.line = null;
    this.clear();
    $("view-select").addEventListener("change", () => this.select($("view-select").value, this.colour));
    $("colour-select").addEventListener("change", () => this.select(this.view, $("colour-select").value));
    $("fields").addEventListener("change", () => this.showCloud());
    $("save-picture").addEventListener("click", () => this.save());
    $("result-fit").addEventListener("click", () => this.fit());
    $("profile").addEventListener("click", () => this.setLine(this.line ? null : this.middleLine()));
    new ResizeObserver(() => this.showProfile()).observe($("profile-chart"));
  }

  /** Forgets the scanner that was shown. */
  clear() {
    this.measurement = null;
    this.layers = new Map();
    this.points = null;
    [this.shownAt, this.counted] = [[], null];
    this.incoming = null;
    this.sequence = null;
    [this.why, this.projected, this.pattern] = [null, undefined, undefined];
    this.cloud?.reset();
    this.setLine(null);
    $("figures").replaceChildren();
    $("notes").textContent = "";
    this.lists(FIRST);
    this.show();
  }

  /** Fills the lists of views and colours. */
  lists(layers) {
    const options = layers.map(({ name, title, unit }) => new Option(unit ? `${title} (${unit})` : title, name));
    const has = (name) => [CLOUD, PATTERN].includes(name) || layers.some((layer) => layer.name === name);
    const chosen = has(this.view) ? [] : [new Option(this.view, this.view)];
    const key = options.map((option) => option.value).join();
    if (this.listed !== key) {
      this.listed = key;
      $("view-select").replaceChildren(new Option("Cloud", CLOUD), ...options, ...chosen, new Option("Projected pattern", PATTERN));
      const points = layers.filter(({ name }) => POINT_LAYERS.includes(name));
      $("colour-select").replaceChildren(...points.map(({ name, title }) => new Option(POINT_TITLES[name] ?? title, name)));
    }
    $("view-select").value = this.view;
    $("colour-select").value = this.colour;
  }

  select(view, colour) {
    if (view !== this.view) {
      this.picture.clear();
      this.pattern = undefined;
    }
    [this.view, this.colour] = [view, colour];
    keep("view", view);
    keep("colour", colour);
    this.ask();
    this.show();
  }

  /** Says what is to be sent. */
  ask() {
    if (this.view === CLOUD) {
      this.want([], this.colour);
    } else if (this.view === PATTERN) {
      this.want([], null);
    } else {
      this.want(this.line && this.view === "depth" ? ["depth", "depth_sigma", "true_depth"] : [this.view], null);
    }
  }

  /** Takes a message; the last one of a measurement shows it. */
  told(message, payload) {
    const { kind } = message;
    if (kind === "sequence") {
      this.sequence = message;
      this.rows = new Uint8Array(payload);
      this.pattern = undefined;
    } else if (kind === "measurement") {
      this.incoming = { measurement: message, layers: new Map(), points: null, why: null };
    } else if (kind === "unmeasured") {
      this.incoming ??= { measurement: null, layers: new Map(), points: null };
      this.incoming.why = message.why;
    } else if (kind === "layer") {
      this.incoming?.layers.set(message.name, new Float32Array(payload));
    } else if (kind === "cloud") {
      this.incoming && (this.incoming.points = { ...message, values: new Float32Array(payload) });
    } else if (kind === "complete") {
      requestAnimationFrame(() => this.complete(message.number));
    } else {
      return false;
    }
    return true;
  }

  async complete(number) {
    const { incoming } = this;
    this.incoming = null;
    try {
      if (incoming) {
        const { measurement, layers, points, why } = incoming;
        [this.measurement, this.layers, this.points, this.why] = [measurement, layers, points, why];
        this.count();
        this.showFigures();
        // Another scanner may lack the layer.
        this.colour = points?.name ?? this.colour;
        this.lists(measurement?.layers ?? FIRST);
        this.line = this.line && measurement && this.line.map((end) => this.inside(end));
        await this.show();
      }
    } finally {
      this.seen(number);
    }
  }

  /** Notes that a scan is shown, unless it is the same one in another view. */
  count() {
    const now = performance.now();
    if (this.measurement && this.measurement.number !== this.counted) {
      this.counted = this.measurement.number;
      this.shownAt.push(now);
    }
    this.shownAt = this.shownAt.filter((at) => now - at <= COUNTED_MS);
  }

  layer(name) {
    return this.measurement?.layers.find((layer) => layer.name === name);
  }

  notice(text) {
    $("result-notice").textContent = text;
  }

  /** Draws the chosen view. */
  async show() {
    const [cloud, pattern] = [this.view === CLOUD, this.view === PATTERN];
    $("result-picture").hidden = cloud;
    $("cloud").hidden = !cloud;
    $("cloud-choices").hidden = !cloud;
    $("legend").hidden = pattern;
    $("profile").hidden = cloud || pattern;
    this.draggable();
    if (this.cloud) {
      this.cloud.controls.enabled = cloud && !this.isMoving();
    }
    if (this.model) {
      this.model.handles.enabled = cloud;
    }
    $("result-view").setAttribute("aria-label", cloud
      ? "Point cloud. Drag to turn, the wheel zooms, arrows move."
      : "Map. Plus and minus zoom, arrows move, 0 fits.");
    if (pattern) {
      this.notice(this.sequence ? "" : "No sequence yet.\nIts patterns appear here when a program starts it.");
      this.showPattern(this.projected);
    } else if (cloud) {
      await this.showCloud();
    } else {
      this.showMap();
    }
    this.showProfile();
    this.showLine();
  }

  /** Says why there is nothing to show, or what is wrong with it. */
  explain(shown) {
    const { measurement } = this;
    const pending = measurement && (this.view === CLOUD ? measurement.cloud : this.layer(this.view));
    const lacking = pending ? "Computing." : measurement
      ? `This scan has no ${this.view === CLOUD ? "points: they need a calibration" : this.view}.`
      : "No scan yet.\nIt appears here when a program has run a sequence.";
    this.notice(this.why ?? (shown ? "" : lacking));
    $("legend").hidden = !shown;
  }

  showMap() {
    const [layer, values] = [this.layer(this.view), this.layers.get(this.view)];
    this.explain(layer && values);
    if (!layer || !values) {
      this.picture.clear();
      return;
    }
    const { width, height } = this.measurement;
    const range = colours.range(layer, values);
    const steps = new Uint16Array(values.length);
    colours.quantise(layer, values, range, steps);
    this.picture.show(width, height, steps, colours.samples(layer));
    this.showLegend(layer, values, range);
  }

  async showCloud() {
    const [layer, { points }] = [this.layer(this.points?.name), this];
    if (this.view !== CLOUD) {
      return;
    }
    this.explain(layer && points);
    $("cloud").hidden = !layer || !points;
    if (!layer || !points) {
      return;
    }
    try {
      // Only a viewer of the cloud needs to load what draws it.
      const { Cloud } = await import("./cloud.js");
      this.cloud ??= new Cloud($("result-view"), $("cloud"));
      await this.placeScene();
    } catch (error) {
      this.notice(`The cloud cannot be drawn: ${error.message}`);
      return;
    }
    // Another view or scanner may have been chosen meanwhile.
    if (this.view !== CLOUD || this.points !== points) {
      this.cloud.controls.enabled = this.view === CLOUD && !this.isMoving();
      return;
    }
    this.cloud.controls.enabled = !this.isMoving();
    const range = colours.range(layer, points.values, 4, 3);
    const fields = $("fields").checked;
    this.cloud.show({ about: this.measurement, values: points.values, every: points.every, layer, range, fields });
    const count = points.values.length / 4;
    $("result-pixel").textContent = points.every > 1
      ? `${count} points, of every ${points.every} rows and columns`
      : `${count} points`;
    this.showLegend(layer, points.values, range, 4, 3);
  }

  /** Draws an emulated scene in the cloud's view from now on; `moved` is called when an object was moved there. */
  showScene(scene, moved) {
    [this.scene, this.moveObject] = [scene, moved];
    if (this.cloud && this.view === CLOUD) {
      this.placeScene().then((news) => news && this.cloud.draw());
    }
  }

  /** Returns whether an object is being moved by its handle. */
  isMoving() {
    return Boolean(this.model?.handles.dragging);
  }

  /** Returns whether there is something to draw of a scene. */
  async placeScene() {
    if (!this.scene?.scene && !this.model) {
      return false;
    }
    const { SceneModel } = await import("./scene.js");
    this.model ??= new SceneModel(this.cloud, (place) => this.moveObject(place));
    return this.model.show(this.scene);
  }

  /** Shows a pattern of the sequence, by its number; null if none is projected. */
  showPattern(number) {
    this.projected = number;
    if (this.view !== PATTERN || !this.sequence || this.pattern === number) {
      return;
    }
    this.pattern = number;
    const pattern = this.sequence.patterns[number];
    if (!pattern || (pattern.axis === null && pattern.level === null)) {
      this.picture.clear();
      this.notice(pattern ? `Pattern ${number}: ${pattern.name}. Its levels are known to the device alone.` : "No pattern of the sequence is projected.");
      return;
    }
    const { width, height, patterns } = this.sequence;
    const length = ({ axis }) => (axis === null ? 0 : axis === "x" ? width : height);
    const start = patterns.slice(0, number).reduce((sum, other) => sum + length(other), 0);
    const row = this.rows.subarray(start, start + length(pattern));
    const levels = new Uint8Array(width * height);
    if (pattern.axis === null) {
      levels.fill(pattern.level);
    }
    for (let y = 0; y < height && pattern.axis !== null; y++) {
      if (pattern.axis === "x") {
        levels.set(row, y * width);
      } else {
        levels.fill(row[y], y * width, (y + 1) * width);
      }
    }
    this.notice("");
    this.picture.show(width, height, levels, colours.greys(255, false));
    $("result-pixel").textContent = `Pattern ${number} of ${patterns.length}: ${pattern.name}`;
  }

  showFigures() {
    const { measurement } = this;
    const rows = measurement ? [["Sequence", measurement.sequence ?? "unknown"], ...measurement.figures] : [];
    const at = this.shownAt;
    if (at.length > 1) {
      rows.push(["Shown", `${((1000 * (at.length - 1)) / (at.at(-1) - at[0])).toFixed(1)} scans/s`]);
    }
    $("figures").replaceChildren(...rows.flatMap(([name, value]) => {
      const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
      [dt.textContent, dd.textContent] = [name, value];
      return [dt, dd];
    }));
    $("notes").textContent = measurement?.notes.join("\n") ?? "";
  }

  showLegend(layer, values, range, stride = 1, offset = 0) {
    const [bar, classes] = [$("legend-bar"), $("legend-classes")];
    const isClasses = layer.scale === "classes";
    for (const id of ["legend-bar", "legend-low", "legend-high"]) {
      $(id).hidden = isClasses;
    }
    $("legend-title").textContent = layer.unit ? `${layer.title} (${layer.unit})` : layer.title;
    classes.replaceChildren();
    if (isClasses) {
      const counts = layer.names.map(() => 0);
      for (let i = offset; i < values.length; i += stride) {
        counts[values[i]]++;
      }
      classes.replaceChildren(...layer.names.map((name, i) => {
        const item = document.createElement("span");
        item.style.setProperty("--class", colours.css(layer, i));
        item.textContent = `${name} ${((100 * counts[i] * stride) / values.length).toFixed(1)} %`;
        return item;
      }));
      return;
    }
    bar.width = colours.STEPS;
    bar.height = 1;
    const strip = new ImageData(colours.STEPS, 1);
    new Uint32Array(strip.data.buffer).set(colours.samples(layer).subarray(0, colours.STEPS));
    bar.getContext("2d").putImageData(strip, 0, 0);
    $("legend-low").textContent = colours.digits(range[0], range);
    $("legend-high").textContent = colours.digits(range[1], range);
  }

  showPixel(pixel) {
    const [layer, values] = [this.layer(this.view), this.layers.get(this.view)];
    if (!layer || !values) {
      return;
    }
    const value = pixel && values[pixel.index];
    const text = Number.isNaN(value)
      ? "none"
      : layer.scale === "classes" ? layer.names[value] : `${value?.toPrecision(6)} ${layer.unit}`;
    $("result-pixel").textContent = pixel ? `x ${pixel.x} px, y ${pixel.y} px: ${text}` : "\u00a0";
  }

  fit() {
    if (this.view === CLOUD) {
      this.cloud?.reset();
      this.showCloud();
    } else {
      this.picture.fit();
    }
  }

  /** Saves what is drawn as a picture. */
  save() {
    if (this.view === CLOUD) {
      // What was drawn last is gone by now.
      this.cloud?.draw();
    }
    savePicture($(this.view === CLOUD ? "cloud" : "result-picture"), this.view);
  }

  moved() {
    this.showLine();
  }

  middleLine() {
    const { width, height } = this.measurement ?? { width: 1, height: 1 };
    const y = Math.floor(height / 2);
    return [[0, y], [width - 1, y]];
  }

  /** Lets the pointer and the arrow keys move the line, where there is one. */
  draggable() {
    const moves = this.line && this.view !== PATTERN && this.view !== CLOUD;
    this.picture.drawn = moves ? (from, to) => this.setLine([from, to]) : null;
    this.picture.nudged = moves ? (x, y) => this.setLine(this.line.map(([px, py]) => [px + x, py + y])) : null;
  }

  /** Returns the pixel at a position, or the nearest one. */
  inside([x, y]) {
    const { width, height } = this.measurement;
    return [Math.floor(Math.min(Math.max(x, 0), width - 1)), Math.floor(Math.min(Math.max(y, 0), height - 1))];
  }

  /** Draws a profile along a line between two pixels, or none. */
  setLine(line) {
    const wasOff = this.line === null || this.line === undefined;
    this.line = line && this.measurement ? line.map((end) => this.inside(end)) : null;
    this.draggable();
    $("profile").setAttribute("aria-pressed", this.line !== null);
    $("profile-chart").hidden = this.line === null;
    if (wasOff !== (this.line === null)) {
      this.ask();
    }
    this.showLine();
    this.showProfile();
  }

  showLine() {
    const shown = this.line && this.picture.image && !$("profile").hidden;
    $("line").style.display = shown ? "" : "none";
    if (shown) {
      // The middles of the pixels.
      const [from, to] = this.line.map(([x, y]) => this.picture.onScreen([x + 0.5, y + 0.5]));
      for (const [name, value] of Object.entries({ x1: from[0], y1: from[1], x2: to[0], y2: to[1] })) {
        $("line-ends").setAttribute(name, value);
      }
    }
  }

  showProfile() {
    const [layer, values] = [this.layer(this.view), this.layers.get(this.view)];
    $("profile-chart").hidden = !this.line || $("profile").hidden;
    if (!this.line || !layer || !values) {
      return;
    }
    const pixels = chart.along(...this.line, this.measurement.width);
    const pick = (name) => (this.layers.has(name) ? pixels.map((i) => this.layers.get(name)[i]) : null);
    const isDepth = this.view === "depth";
    const parts = {
      values: pick(this.view),
      sigma: isDepth ? pick("depth_sigma") : null,
      truth: isDepth ? pick("true_depth") : null,
    };
    this.profiled = parts;
    const at = [...pixels.keys()];
    chart.draw($("profile-chart"), { ...layer, ...parts, at, ends: ["0", `${pixels.length - 1} px`] });
  }
}
