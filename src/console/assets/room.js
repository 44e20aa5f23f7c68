// A treatment room: the patient in 3D, the results of the scans as curves, the beam, and the pods.

import * as chart from "./chart.js";
import { css, digits, range, STEPS } from "./colours.js";
import { rows } from "./rows.js";

/** Maximum number of results that are kept. */
const MAX_ROWS = 3000;
/** Number of results over which a chart is drawn; more are thinned out. */
const MAX_DRAWN = 600;
/** Minimum silence after which the beam's state is unknown, and number of intervals between results by which it is
 * longer. */
const [SILENCE_MS, GAPS] = [2000, 5];
const DISTANCE = { scale: "signed" };
/** Charts: title, unit, and the numbers of a result that they show. */
const CHARTS = [
  ["Skin, lateral (x)", "mm", "skin", 0],
  ["Tumour, lateral (x)", "mm", "tumour", 0],
  ["Skin, longitudinal (y)", "mm", "skin", 1],
  ["Tumour, longitudinal (y)", "mm", "tumour", 1],
  ["Skin, vertical (z)", "mm", "skin", 2],
  ["Tumour, vertical (z)", "mm", "tumour", 2],
  ["Skin, pitch", "°", "skin", 3],
  ["Tumour, distance from plan", "mm", "tumour", 3],
  ["Skin, roll", "°", "skin", 4],
  ["Skin, yaw", "°", "skin", 5],
];

const $ = (id) => document.getElementById(id);

const stated = (value, digitsShown, unit) => (value?.every(Number.isFinite) ? `${value[0].toFixed(digitsShown)} ± ${value[1].toFixed(digitsShown)} ${unit}` : "lost");

export class Room {
  /** `seen` is called with the number of results that have been drawn. */
  constructor(seen) {
    this.seen = seen;
    this.charts = CHARTS.map(([title]) => {
      const [box, canvas] = [document.createElement("div"), document.createElement("canvas")];
      canvas.setAttribute("aria-label", title);
      box.append(canvas);
      $("charts").append(box);
      return canvas;
    });
    this.clear();
    for (const id of ["show-planned", "show-tracked", "show-points", "show-pods"]) {
      $(id).addEventListener("change", () => this.drawScene());
    }
    $("room-seconds").addEventListener("change", () => this.drawCharts());
    $("room-fit").addEventListener("click", () => this.scene?.fit());
    new ResizeObserver(() => this.drawCharts()).observe($("charts"));
    setInterval(() => this.listen(), SILENCE_MS / 4);
  }

  clear() {
    [this.plan, this.scan, this.rows] = [null, null, []];
    [this.gaps, this.heardAt] = [[], undefined];
    $("beam").textContent = "no scan yet";
    $("beam").className = "";
    for (const id of ["beam-why", "room-figures", "pod-rows", "room-warnings", "room-notice"]) {
      $(id).replaceChildren();
    }
  }

  /** The connection is lost: nobody knows whether the beam is on. */
  lost() {
    if (this.plan) {
      $("beam").textContent = "unknown";
      $("beam").className = "";
      $("beam-why").textContent = "the connection to the console is lost";
    }
  }

  /** Notes when results come, and how far they are apart at most. */
  heard() {
    const now = performance.now();
    this.gaps = [...this.gaps, now - (this.heardAt ?? now)].slice(-GAPS);
    this.heardAt = now;
  }

  /** Says so if no result has come for long while the beam was on. */
  listen() {
    const silence = performance.now() - (this.heardAt ?? Infinity);
    if (this.plan && $("beam").className === "on" && silence > Math.max(SILENCE_MS, 5 * Math.max(...this.gaps))) {
      $("beam").textContent = "unknown";
      $("beam").className = "";
      $("beam-why").textContent = `no result for ${(silence / 1000).toFixed(0)} s`;
    }
  }

  async told(message, payload) {
    if (message.kind === "room") {
      this.plan = message;
      let at = 0;
      const take = (Type, count) => {
        const part = new Type(payload, at, count);
        at += 4 * count;
        return part;
      };
      this.surfaces = message.sizes.map(([vertices, triangles]) => [take(Float32Array, 3 * vertices), take(Uint32Array, 3 * triangles)]);
      await this.drawPlan();
      return;
    }
    const [points, skin, tumour] = message.sizes;
    const numbers = new Float32Array(payload);
    const ends = [4 * points, 4 * points + 3 * skin, 4 * points + 3 * (skin + tumour)];
    this.scan = { points: numbers.slice(0, ends[0]), skin: numbers.slice(ends[0], ends[1]), tumour: numbers.slice(ends[1], ends[2]) };
    // Those that are known get the truth, or come again on a new connection.
    const known = new Map(this.rows.map((row) => [row.id, row]));
    if (message.rows.some(({ id }) => !known.has(id))) {
      this.heard();
    }
    message.rows.forEach((row) => known.set(row.id, row));
    this.rows = [...known.values()].sort((a, b) => a.id - b.id).slice(-MAX_ROWS);
    requestAnimationFrame(() => {
      try {
        this.drawScene();
        this.drawCharts();
        this.showFigures();
      } finally {
        this.seen(message.number);
      }
    });
  }

  /** The 3D view is loaded when there is a room. */
  async drawPlan() {
    if (this.scene === undefined) {
      this.scene = null;
      try {
        const { POD_COLOURS, RoomScene } = await import("./room_scene.js");
        this.colours = POD_COLOURS;
        this.scene = new RoomScene($("room-view"), $("room-canvas"));
      } catch (error) {
        $("room-notice").textContent = `The room cannot be drawn: ${error.message}`;
      }
    }
    if (this.plan) {
      this.scene?.plan(this.surfaces, this.plan.fields);
      this.drawScene();
      this.showFigures();
    }
  }

  drawScene() {
    const { plan, scan } = this;
    if (!plan) {
      return;
    }
    const points = scan?.points ?? new Float32Array(0);
    const most = points.length ? range(DISTANCE, points, 4, 3)[1] : plan.tolerance_mm;
    [$("room-low").textContent, $("room-high").textContent] = [-most, most].map((end) => `${end.toFixed(1)} mm`);
    const bar = $("room-bar");
    bar.width = STEPS;
    bar.height = 1;
    const context = bar.getContext("2d");
    for (let step = 0; step < STEPS; step += 4) {
      context.fillStyle = css(DISTANCE, step);
      context.fillRect(step, 0, 4, 1);
    }
    const shown = Object.fromEntries(["planned", "tracked", "points", "pods"].map((name) => [name, $(`show-${name}`).checked]));
    this.scene?.track({ ...(scan ?? { points, skin: points, tumour: points }), most, shown });
  }

  drawCharts() {
    const [seconds, last] = [Number($("room-seconds").value), this.rows.at(-1)];
    if (!last || !this.plan) {
      return;
    }
    const recent = this.rows.filter(({ time_s: time }) => time >= last.time_s - seconds);
    const every = Math.ceil(recent.length / MAX_DRAWN);
    const groups = Array.from({ length: Math.ceil(recent.length / every) }, (_, i) => recent.slice(every * i, every * (i + 1)));
    // The one farthest from the plan stands for its group, and a held beam is always seen.
    const drawn = groups.map((group) => group.reduce((a, b) => ((b.tumour?.[3][0] ?? 0) > (a.tumour?.[3][0] ?? 0) ? b : a)));
    const held = groups.map((group) => group.some((row) => row.held !== null));
    const at = drawn.map(({ time_s: time }) => time);
    const ends = [`${at[0].toFixed(1)} s`, `${at.at(-1).toFixed(1)} s`];
    CHARTS.forEach(([title, unit, of, index], i) => {
      const isDistance = of === "tumour" && index === 3;
      const truth = of === "tumour" && drawn.some((row) => row.truth) ? drawn.map((row) => row.truth?.[index]) : null;
      chart.draw(this.charts[i], {
        at,
        ends,
        values: drawn.map((row) => row[of]?.[index][0]),
        sigma: drawn.map((row) => row[of]?.[index][1]),
        truth,
        limit: isDistance ? this.plan.tolerance_mm : undefined,
        bad: isDistance ? held : null,
        title,
        unit,
        brief: true,
      });
    });
  }

  showFigures() {
    const row = this.rows.at(-1);
    if (!row || !this.plan) {
      return;
    }
    $("beam").textContent = row.held === null ? "● on" : "■ held";
    $("beam").className = row.held === null ? "on" : "held";
    $("beam-why").textContent = row.held ?? "";
    $("room-warnings").textContent = row.warnings.filter((why) => why !== row.held).join("\n") || "none";
    const percent = (part) => (typeof part === "number" ? `${(100 * part).toFixed(0)} %` : "unknown");
    const [values, { truth }] = [row.tumour, row];
    const error = values && truth ? Math.hypot(...[0, 1, 2].map((i) => values[i][0] - truth[i])) : null;
    $("room-figures").replaceChildren(...rows([
      ["Scan", row.scan],
      ["Time", `${row.time_s.toFixed(2)} s`],
      ["Tumour off by", stated(values?.[3], 2, "mm")],
      ...(truth ? [["in truth", `${truth[3].toFixed(2)} mm`]] : []),
      ...(error === null ? [] : [["Error of the tumour", `${digits(error, [0, 1])} mm`]]),
      ["Tolerance", `${this.plan.tolerance_mm} mm`],
      ["Skin seen by all", percent(row.covered)],
      ["Latency", row.latency_ms === null ? "unknown" : `${row.latency_ms.toFixed(0)} ms`],
    ]));
    $("pod-rows").replaceChildren(...this.plan.pods.map((name, i) => {
      const line = document.createElement("tr");
      const cells = [name, row.points[i] ?? "", row.coverage[i] === undefined ? "" : percent(row.coverage[i])];
      line.append(...cells.map((text) => Object.assign(document.createElement("td"), { textContent: text })));
      const mark = document.createElement("i");
      mark.style.background = this.colours?.[i % this.colours.length] ?? "";
      line.firstChild.prepend(mark);
      return line;
    }));
  }
}
