// Panels below the pictures: scanning, a terminal, the emulated world, and the traffic.

import { Calibration } from "./calibration.js";
import { Playback } from "./playback.js";
import { attempt } from "./requests.js";
import { Settings } from "./settings.js";
import { Terminal } from "./terminal.js";
import { Traffic } from "./traffic.js";
import { World } from "./world.js";

const $ = (id) => document.getElementById(id);
/** Name under which the tab keeps which panel is open. */
const OPEN = "panel";
/** Panels, and the kind of requests that each needs. */
const NEEDS = { scan: "scan", terminal: "line", scene: "service", terms: "service", faults: "service", clock: "service", calibration: "calibration", traffic: null, playback: "playback" };

export class Panels {
  /** `requests` asks the scanner, `watch` says whether its traffic is wanted, `upload` sends a recording, `draw`
   * draws a scene in 3D, `mark` draws points over the camera's picture. */
  constructor(requests, { watch, upload, draw, mark }) {
    this.requests = requests;
    this.watch = watch;
    this.answers = [];
    this.terminal = new Terminal(requests);
    this.settings = new Settings(requests);
    this.traffic = new Traffic();
    this.world = new World(requests, draw);
    this.playback = new Playback(requests, upload);
    this.calibration = new Calibration(requests, mark);
    this.open = sessionStorage.getItem(OPEN);
    for (const button of document.querySelectorAll("#tabs button")) {
      button.addEventListener("click", () => this.select(button.value === this.open ? null : button.value));
    }
    $("record").addEventListener("click", () => attempt(() => requests.ask({ record: !this.recording })));
    const sequence = () => $("sequence").value.trim() || null;
    for (const run of ["once", "repeat", "stop"]) {
      $(`scan-${run}`).addEventListener("click", () => attempt(() => requests.ask({ scan: { run, sequence: sequence() } })));
    }
  }

  /** Opens a panel, or none. */
  select(name) {
    this.open = name;
    sessionStorage.setItem(OPEN, name ?? "");
    this.show();
  }

  /** Shows the panels that the scanner has. */
  update({ answers, status, recording, cut, room }, controls) {
    const news = this.answers.join() !== answers.join() || (controls && !this.controls) || this.room !== room;
    [this.answers, this.controls, this.room] = [answers, controls, room];
    $("scan-status").textContent = status ?? "";
    this.recording = recording !== null;
    $("record").hidden = !answers.includes("record");
    $("record").disabled = !controls;
    $("record").textContent = this.recording ? "End the recording" : "Record";
    $("record").setAttribute("aria-pressed", this.recording);
    $("record-name").textContent = cut ?? (recording ? `into ${recording}` : "");
    $("record-name").className = cut ? "bad" : "";
    for (const field of document.querySelectorAll("#panel fieldset")) {
      field.disabled = !controls;
      field.title = controls ? "" : "Take control first.";
    }
    $("pose-scan").hidden = !answers.includes("scan");
    this.calibration.control(controls);
    this.world.update(answers.includes("service"), controls);
    if (news) {
      this.show();
    }
  }

  /** The scanner is another one, or the connection is new. */
  renew() {
    this.requests.lost();
    this.terminal.clear();
    this.world.forget();
    this.playback.show(false);
    this.calibration.show(false);
    this.watched = null;
    this.show();
  }

  watchTraffic(show) {
    if (this.watched !== show) {
      this.watched = show;
      this.traffic.clear();
      this.watch(show);
    }
  }

  show() {
    for (const button of document.querySelectorAll("#tabs button")) {
      const need = NEEDS[button.value];
      button.hidden = this.room || (need !== null && !this.answers.includes(need));
      if (button.hidden && button.value === this.open) {
        continue;
      }
      const open = button.value === this.open;
      button.setAttribute("aria-expanded", open);
      $(`panel-${button.value}`).hidden = !open;
    }
    const need = NEEDS[this.open];
    const shown = this.open && !this.room && (need === null || this.answers.includes(need)) ? this.open : null;
    $("panel").hidden = shown === null;
    $("panel-error").textContent = "";
    this.watchTraffic(shown === "traffic");
    this.world.show(shown);
    this.playback.show(shown === "playback");
    this.calibration.show(shown === "calibration");
    if (shown === "terminal") {
      this.terminal.show();
    }
    if (shown === "scan" && this.controls) {
      this.settings.look();
    }
  }
}
