// The page: what the console tells, on the screen; what the viewer does, to the console.

import { Connection } from "./connection.js";
import { Picture } from "./camera.js";
import * as histogram from "./histogram.js";

/** Time between two histograms. */
const HISTOGRAM_MS = 100;
/** Part of saturated pixels from which there is a warning. */
const MANY = 0.001;
/** Name under which a tab keeps that it is in control, for a connection that is opened again. */
const CONTROL = "control";
/** Time over which shown frames are counted. */
const COUNTED_MS = 2000;

const $ = (id) => document.getElementById(id);

let state = { sources: [] };
let source = 0;
/** The latest frame that is not drawn yet. */
let next = null;
let shownAt = [];
let histogramAt = -Infinity;
/** White of frames whose format does not tell the sensor's bits: the lowest possible one so far. */
let lowestWhite = 255;

const picture = new Picture($("view"), $("picture"), showZoom, showPixel);
const connection = new Connection(told, connected);

// The token is in the cookie now, and need not be seen.
if (location.search) {
  history.replaceState(null, "", location.pathname + location.hash);
}

function connected(how) {
  const texts = { open: "connected", lost: "connection lost, trying again", refused: "console ended" };
  $("connection").textContent = texts[how];
  $("connection").className = how;
  if (how === "open") {
    next = null;
    connection.ask({ kind: "watch", source });
  } else if (how === "lost") {
    state.controls = false;
  } else if (how === "refused") {
    notice("The console has been started again, or has ended.\nOpen the address that it prints.");
  }
}

function told(message, payload) {
  if (message.kind === "state") {
    showState(message);
  } else if (message.source !== source) {
    return;
  } else if (message.kind === "frame") {
    const waiting = next !== null;
    next = { message, payload };
    if (!waiting) {
      requestAnimationFrame(showFrame);
    }
  } else if (message.kind === "damaged") {
    notice(`Frame ${message.id} is damaged: ${message.why}.`);
    connection.ask({ kind: "drawn", source, number: message.number });
  }
}

function showState(now) {
  const names = now.sources.map((one) => one.name);
  if (String(names) !== String(state.sources.map((one) => one.name))) {
    $("source").replaceChildren(...names.map((name, index) => new Option(name, index)));
    $("source").value = source;
  }
  if (now.controls) {
    sessionStorage.setItem(CONTROL, "");
  } else if (now.other_controls) {
    // Another viewer has taken it over, unless it is this tab's earlier connection that has not ended yet.
    if (state.controls) {
      sessionStorage.removeItem(CONTROL);
    }
  } else if (sessionStorage.getItem(CONTROL) !== null) {
    connection.ask({ kind: "control", take: true });
  }
  state = now;
  const here = now.sources[source];
  const parts = [];
  if (here?.unplugged.control) {
    parts.push("control port unplugged");
  }
  if (here?.unplugged.camera) {
    parts.push("camera is gone, waiting for it");
  }
  parts.push(`${here?.readers ?? 0} ${here?.readers === 1 ? "program reads" : "programs read"} the camera`);
  $("device").textContent = parts.join(", ");
  $("role").textContent = now.controls ? "in control" : now.other_controls ? "watching, another viewer is in control" : "watching";
  $("control").hidden = !now.may_control;
  $("control").textContent = now.controls ? "Give up control" : "Take control";
  if (!shownAt.length) {
    notice(here?.readers
      ? "The camera has not sent a frame yet."
      : "No program reads the camera yet.\nIts frames appear here as soon as one does.");
  }
}

function notice(text) {
  $("notice").textContent = text;
}

function showFrame() {
  const { message, payload } = next;
  next = null;
  const levels = message.bits === 8 ? new Uint8Array(payload) : new Uint16Array(payload);
  message.shownWhite = message.format === "Y16" ? lowestWhite : message.white;
  notice("");
  picture.show(message, levels);
  connection.ask({ kind: "drawn", source, number: message.number });
  const now = performance.now();
  shownAt.push(now);
  shownAt = shownAt.filter((at) => now - at <= COUNTED_MS);
  if (now - histogramAt >= HISTOGRAM_MS) {
    histogramAt = now;
    showFigures(message, levels);
  }
}

function showFigures(frame, levels) {
  const counted = histogram.count(levels, frame.shownWhite);
  if (counted.highest > lowestWhite) {
    lowestWhite = 2 ** Math.ceil(Math.log2(counted.highest + 1)) - 1;
  }
  histogram.draw($("histogram"), counted);
  $("white").textContent = frame.shownWhite;
  const part = counted.saturated / levels.length;
  $("saturation").textContent = counted.saturated
    ? `${counted.saturated} px saturated (${(100 * part).toFixed(2)} %)`
    : "no pixel saturated";
  $("saturation").className = part >= MANY ? "bad" : "";
  const rate = shownAt.length > 1 ? (1000 * (shownAt.length - 1)) / (shownAt.at(-1) - shownAt[0]) : 0;
  const rows = {
    Number: frame.id,
    Pattern: frame.pattern ?? "none, free-running",
    Size: `${frame.width} × ${frame.height} px`,
    Format: `${frame.format}, up to ${frame.white} DN`,
    Exposure: `${frame.exposure_ms.toFixed(3)} ms`,
    "Device time": `${frame.time_s.toFixed(3)} s`,
    Shown: `${rate.toFixed(1)} frames/s`,
    Delay: frame.delay_ms === null ? "" : `${frame.delay_ms.toFixed(0)} ms`,
  };
  $("frame").replaceChildren(...Object.entries(rows).flatMap(([name, value]) => {
    const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
    dt.textContent = name;
    dd.textContent = value;
    return [dt, dd];
  }));
}

function showZoom() {
  $("zoom").textContent = picture.frame ? `${(picture.scale() * 100).toFixed(0)} %` : "";
}

function showPixel(pixel) {
  $("pixel").textContent = pixel ? `x ${pixel.x} px, y ${pixel.y} px: ${pixel.level} DN` : "\u00a0";
}

$("source").addEventListener("change", () => {
  source = Number($("source").value);
  next = null;
  shownAt = [];
  lowestWhite = 255;
  picture.fit();
  connection.ask({ kind: "watch", source });
  showState(state);
});
$("control").addEventListener("click", () => {
  sessionStorage.removeItem(CONTROL);
  connection.ask({ kind: "control", take: !state.controls });
});
$("in").addEventListener("click", () => picture.enlarge(Math.SQRT2));
$("out").addEventListener("click", () => picture.enlarge(Math.SQRT1_2));
$("fit").addEventListener("click", () => picture.fit());
