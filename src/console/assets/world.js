// The world of an emulated device: objects, faults and the clock, on its service channel.

import { attempt } from "./requests.js";

/** Time between two looks at the device while a panel is open. */
const LOOK_MS = 1000;
const AXES = ["x", "y", "z"];

const $ = (id) => document.getElementById(id);

/** Returns rows of a list as terms and values. */
function rows(pairs) {
  return pairs.flatMap(([name, value]) => {
    const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
    [dt.textContent, dd.textContent] = [name, value];
    return [dt, dd];
  });
}

export class World {
  constructor(requests) {
    this.service = (service) => requests.ask({ service });
    this.panel = null;
    $("object").addEventListener("change", () => this.fill());
    $("place-form").addEventListener("submit", (event) => {
      event.preventDefault();
      attempt(() => this.place());
    });
    $("fault-form").addEventListener("submit", (event) => {
      event.preventDefault();
      attempt(() => this.inject());
    });
    $("faults-clear").addEventListener("click", () => attempt(() => this.change({ clear_faults: "all" })));
    $("trigger").addEventListener("click", () => attempt(() => this.change({ do: "trigger" })));
    $("clock-step").addEventListener("click", () => {
      const step = Math.round(1e6 * Number($("step-ms").value));
      attempt(() => this.change({ clock: { step_ns: step } }));
    });
    $("clock-stop").addEventListener("click", () => attempt(() => this.change({ clock: "stop" })));
    setInterval(() => this.look(), LOOK_MS);
  }

  /** The panel that is open, or nothing to forget a scanner. */
  show(panel) {
    const news = panel !== this.panel;
    this.panel = panel;
    if (news) {
      this.objects = null;
      $("object").replaceChildren();
      this.fill();
      this.look();
    }
  }

  async change(request) {
    await this.service(request);
    await this.look();
  }

  async look() {
    const looks = { scene: () => this.lookAtScene(), faults: () => this.lookAtFaults(), clock: () => this.lookAtClock() };
    const look = looks[this.panel];
    if (look && !this.looking && !document.hidden) {
      this.looking = true;
      // A device that has ended says so elsewhere.
      await look().catch(() => {});
      this.looking = false;
    }
  }

  async lookAtScene() {
    const { scene } = await this.service({ get: "objects" });
    if (this.panel !== "scene") {
      return;
    }
    const names = scene.objects.map(({ object, shape, moves }) => `${object}: ${shape}${moves ? ", moves" : ""}`);
    const fresh = String(names) !== String(this.objects?.map(({ name }) => name));
    this.objects = scene.objects.map((object, i) => ({ ...object, name: names[i] }));
    if (fresh) {
      $("object").replaceChildren(...names.map((name, i) => new Option(name, i)));
      this.fill();
    }
    const number = (values) => values.map((value) => value.toFixed(1)).join(", ");
    $("objects").replaceChildren(...rows(this.objects.map(({ name, position_mm: p, rotation_deg: r, patient }) => [
      name,
      `${number(p)} mm; ${number(r)}°${patient ? `; breathing phase ${patient.phase.toFixed(2)}, tumour at ${number(patient.tumour_mm)} mm` : ""}`,
    ])));
  }

  /** Writes an object's pose into the fields. */
  fill() {
    const object = this.objects?.[$("object").value];
    AXES.forEach((axis, i) => {
      $(`position-${axis}`).value = object ? object.position_mm[i].toFixed(3) : "";
      $(`rotation-${axis}`).value = object ? object.rotation_deg[i].toFixed(3) : "";
    });
  }

  place() {
    const numbers = (name) => AXES.map((axis) => Number($(`${name}-${axis}`).value));
    const place = { object: Number($("object").value), position_mm: numbers("position"), rotation_deg: numbers("rotation") };
    return this.change({ place });
  }

  inject() {
    const number = (id) => ($(id).value === "" ? undefined : Number($(id).value));
    const [nth, every] = [number("fault-nth"), number("fault-every")];
    const fault = { what: $("fault-what").value, times: number("fault-times") };
    if (nth !== undefined || every !== undefined) {
      fault.when = { nth, every };
    }
    return this.change({ fault });
  }

  async lookAtFaults() {
    const { faults } = await this.service({ get: "faults" });
    const standing = faults.standing.map(({ id, struck, fault: { what, when, times } }) => {
      const limit = times === undefined ? "" : ` of ${times}`;
      return [`${id}: ${what}`, `${when ? `${JSON.stringify(when)}; ` : ""}${struck}${limit} times`];
    });
    $("faults-standing").replaceChildren(...rows(standing.length ? standing : [["none", ""]]));
    const struck = faults.struck.slice(-20).reverse().map(({ time_ns: time, ...rest }) => [
      `${(time * 1e-9).toFixed(3)} s`,
      Object.entries(rest).map(([name, value]) => `${name} ${typeof value === "object" ? JSON.stringify(value) : value}`).join(", "),
    ]);
    $("faults-struck").replaceChildren(...rows(struck.length ? struck : [["none", ""]]));
  }

  async lookAtClock() {
    const [{ clock }, { device }] = [await this.service({ get: "clock" }), await this.service({ get: "device" })];
    const stepped = clock.pace === "stepped";
    for (const id of ["clock-step", "clock-stop", "step-ms"]) {
      $(id).disabled = !stepped;
      $(id).title = stepped ? "" : "Only a device served with --clock stepped can be stepped.";
    }
    $("clock-rows").replaceChildren(...rows([
      ["Clock", clock.pace],
      ["Device time", `${(clock.now_ns * 1e-9).toFixed(6)} s`],
      ["State", device.state],
      ["Exposures", device.frames],
      ["Missed triggers", device.missed_triggers],
      ...(clock.late ? [["Late, 99 %", `${(clock.late.percentile_99_ns * 1e-6).toFixed(2)} ms`]] : []),
    ]));
  }
}
