// Shows the console's messages and sends the viewer's actions.

import { Connection } from "./connection.js";
import { greys } from "./colours.js";
import * as histogram from "./histogram.js";
import { Marks } from "./marks.js";
import { Panels } from "./panels.js";
import { Picture } from "./picture.js";
import { Requests } from "./requests.js";
import { Result } from "./result.js";
import { Room } from "./room.js";
import { copyLink, offerFiles } from "./save.js";

/** Time between two histograms. */
const HISTOGRAM_MS = 100;
/** Minimum saturated fraction for a warning. */
const MANY = 0.001;
/** Time over which shown frames are counted. */
const COUNTED_MS = 2000;
/** Names under which the tab keeps which scanner it shows, and when it lost a connection that had control. */
const [SOURCE, LOST_CONTROL] = ["source", "lost-control"];
/** Time in which a connection that is opened again takes its control back. */
const REGAINED_MS = 10_000;

const $ = (id) => document.getElementById(id);

let state = { sources: [] };
// A link names the scanner, unless this tab has shown one already.
const linked = new URLSearchParams(location.hash.slice(1)).get("scanner");
let source = Number(sessionStorage.getItem(SOURCE) ?? linked ?? 0) || 0;
/** The latest frame that is not drawn yet. */
let next = null;
let shownAt = [];
let histogramAt = -Infinity;
/** White of frames whose format does not tell the sensor's bits: that of the least bits that have sufficed. */
let guessedWhite = 255;

/** White and colours of the frame that is shown, and its grey levels. */
let [white, colours, shownLevels] = [null, null, null];

const picture = new Picture($("view"), $("picture"), placed, showPixel);
const marks = new Marks($("marks"), picture);
let connection = null;
const result = new Result(want, (number) => {
  connection.ask({ kind: "seen", source, number });
  offerFiles(source, state.view_token, result.measurement);
});
const room = new Room((number) => connection.ask({ kind: "seen", source, number }));
const requests = new Requests((message) => connection.ask(message));
const panels = new Panels(requests, {
  watch: (show) => connection?.ask({ kind: "traffic", show }),
  upload: (file) => connection.upload(file),
  mark: (...shown) => marks.show(...shown),
  draw: (scene) => result.showScene(scene, (place) => panels.world.moved(place)),
});
connection = new Connection(told, connected);

/** Asks the console to show these layers of each measurement, and its cloud with the values of a layer. */
function want(layers, cloud) {
  connection?.ask({ kind: "show", layers, cloud });
}

function connected(how) {
  const texts = {
    open: "connected",
    lost: "connection lost, trying again",
    full: "too many viewers, trying again",
    refused: "console ended",
  };
  $("connection").textContent = texts[how];
  $("connection").className = how;
  if (how === "open") {
    next = null;
    connection.ask({ kind: "watch", source });
    result.ask();
    panels.renew();
    return;
  }
  requests.lost();
  room.lost();
  keepControl();
  state.controls = false;
  $("role").textContent = "";
  $("control").hidden = true;
  if (how === "refused") {
    notice("The console has been started again, or has ended.\nOpen the address that it prints.");
  }
}

function keepControl() {
  if (state.controls) {
    sessionStorage.setItem(LOST_CONTROL, Date.now());
  }
}

function told(message, payload) {
  if (message.kind === "state") {
    showState(message);
  } else if (message.kind === "answer") {
    requests.told(message);
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
  } else if (message.kind === "room" || message.kind === "tracked") {
    room.told(message, payload);
  } else if (message.kind === "traffic") {
    panels.traffic.add(message.events);
  } else {
    result.told(message, payload);
  }
}

function showState(now) {
  const names = now.sources.map((one) => one.name);
  if (String(names) !== String(state.sources.map((one) => one.name))) {
    $("source").replaceChildren(...names.map((name, index) => new Option(name, index)));
  }
  if (source >= names.length) {
    select(0);
  }
  $("source").value = source;
  const lostAt = sessionStorage.getItem(LOST_CONTROL);
  if (now.controls || Date.now() - lostAt > REGAINED_MS) {
    sessionStorage.removeItem(LOST_CONTROL);
  } else if (!now.other_controls && now.may_control) {
    connection.ask({ kind: "control", take: true, if_free: true });
  }
  const again = now.sources[source]?.era !== state.sources[source]?.era;
  state = now;
  if (again) {
    forget();
  }
  $("role").textContent = now.controls ? "in control" : now.other_controls ? "watching, another viewer is in control" : "watching";
  $("control").hidden = !now.may_control;
  $("control").textContent = now.controls ? "Give up control" : "Take control";
  showDevice();
}

function showDevice() {
  const here = state.sources[source];
  if (!here) {
    return;
  }
  [$("scanner").hidden, $("room").hidden] = [here.room, !here.room];
  panels.update(here, Boolean(state.controls));
  const parts = [];
  if (here.unplugged.control) {
    parts.push("control port unplugged");
  }
  if (here.unplugged.camera) {
    parts.push(`camera is gone, waiting for it: ${here.why ?? ""}`);
  } else if (here.why) {
    parts.push(`damaged frame: ${here.why}`);
  }
  if (here.readers) {
    parts.push(here.readers === 1 ? "1 program reads frames" : `${here.readers} programs read frames`);
  }
  $("device").textContent = parts.join("; ");
  if (!picture.image) {
    notice("No frames yet.\nThey appear here as soon as a program reads them.");
  }
}

function notice(text) {
  $("notice").textContent = text;
}

/** Returns the white of the least bits that suffice for all levels. */
function whiteOf(levels) {
  let highest = 0;
  for (let i = 0; i < levels.length; i++) {
    highest = levels[i] > highest ? levels[i] : highest;
  }
  return 2 ** Math.ceil(Math.log2(highest + 1)) - 1;
}

function showFrame() {
  if (next === null) {
    return;
  }
  const { message, payload } = next;
  next = null;
  try {
    const levels = message.bits === 8 ? new Uint8Array(payload) : new Uint16Array(payload);
    message.guessed = message.format === "Y16";
    if (message.guessed) {
      guessedWhite = Math.max(guessedWhite, whiteOf(levels));
    }
    message.shownWhite = message.guessed ? guessedWhite : message.white;
    notice("");
    if (white !== message.shownWhite) {
      white = message.shownWhite;
      colours = greys(white, !message.guessed);
    }
    shownLevels = levels;
    picture.show(message.width, message.height, levels, colours);
    result.showPattern(message.pattern);
    const now = performance.now();
    shownAt.push(now);
    shownAt = shownAt.filter((at) => now - at <= COUNTED_MS);
    if (now - histogramAt >= HISTOGRAM_MS) {
      histogramAt = now;
      showFigures(message, levels);
    }
  } catch (error) {
    notice(`Frame ${message.id} cannot be shown: ${error.message}`);
  } finally {
    connection.ask({ kind: "drawn", source, number: message.number });
  }
}

function showFigures(frame, levels) {
  const { bins, saturated } = histogram.count(levels, frame.shownWhite);
  histogram.draw($("histogram"), bins);
  $("white").textContent = frame.shownWhite;
  const part = frame.guessed ? 0 : saturated / levels.length;
  $("saturation").textContent = frame.guessed
    ? "bits of the sensor unknown"
    : saturated
      ? `${saturated} px saturated (${(100 * part).toFixed(2)} %)`
      : "no pixel saturated";
  $("saturation").className = part >= MANY ? "bad" : "";
  const number = (value, digits, unit) => (value === null ? "unknown" : `${value.toFixed(digits)} ${unit}`);
  const rows = {
    Number: frame.id,
    Pattern: frame.pattern ?? (frame.identified ? "none, free-running" : "unknown"),
    Size: `${frame.width} × ${frame.height} px`,
    Format: frame.guessed ? frame.format : `${frame.format}, up to ${frame.white} DN`,
    Exposure: number(frame.exposure_ms, 3, "ms"),
    "Device time": number(frame.time_s, 3, "s"),
    Shown: "",
    Delay: number(frame.delay_ms, 0, "ms"),
  };
  $("frame").replaceChildren(...Object.entries(rows).flatMap(([name, value]) => {
    const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
    dt.textContent = name;
    dd.textContent = value;
    dd.id = `frame-${name.toLowerCase().replace(" ", "-")}`;
    return [dt, dd];
  }));
  showRate();
}

/** Shows the frames per second; 0 if none has come for a while. */
function showRate() {
  const now = performance.now();
  shownAt = shownAt.filter((at) => now - at <= COUNTED_MS);
  const rate = shownAt.length > 1 ? (1000 * (shownAt.length - 1)) / (shownAt.at(-1) - shownAt[0]) : 0;
  const row = $("frame-shown");
  if (row) {
    row.textContent = `${rate.toFixed(1)} frames/s`;
  }
}

/** The picture is somewhere else in its view. */
function placed() {
  marks?.draw();
  $("zoom").textContent = picture.image ? `${(picture.scale() * 100).toFixed(0)} %` : "";
}

function showPixel(pixel) {
  $("pixel").textContent = pixel ? `x ${pixel.x} px, y ${pixel.y} px: ${shownLevels[pixel.index]} DN` : "\u00a0";
}

/** Shows another scanner. */
function select(index) {
  source = index;
  connection.ask({ kind: "watch", source });
  sessionStorage.setItem(SOURCE, source);
  forget();
  panels.renew();
}

/** Forgets what has been shown. */
function forget() {
  next = null;
  shownAt = [];
  histogramAt = -Infinity;
  guessedWhite = 255;
  white = null;
  picture.clear();
  result.clear();
  room.clear();
  offerFiles(source, "", null);
  panels.traffic.clear();
  histogram.draw($("histogram"), new Uint32Array(1));
  for (const id of ["white", "saturation", "frame"]) {
    $(id).replaceChildren();
  }
}

$("source").addEventListener("change", () => {
  select(Number($("source").value));
  showDevice();
});
$("control").addEventListener("click", () => {
  sessionStorage.removeItem(LOST_CONTROL);
  connection.ask({ kind: "control", take: !state.controls, if_free: false });
});
$("link").addEventListener("click", () => copyLink(source, state.view_token));
$("in").addEventListener("click", () => picture.enlarge(Math.SQRT2));
$("out").addEventListener("click", () => picture.enlarge(Math.SQRT1_2));
$("fit").addEventListener("click", () => picture.fit());
addEventListener("pagehide", keepControl);
setInterval(showRate, 1000);
