// The world of an emulated device: its scene, image formation, faults and clock, on its service channel.

import { attempt } from "./requests.js";
import { rows } from "./rows.js";
import { Terms } from "./terms.js";

/** Time between two looks at the device while a panel is open. */
const LOOK_MS = 1000;
const AXES = ["x", "y", "z"];

const $ = (id) => document.getElementById(id);

/** Returns the fields of a scene with their values in TOML, as `--set` takes them. */
function flat(value, path) {
  const isList = Array.isArray(value);
  if (value === null) {
    return [];
  }
  if (typeof value !== "object" || (isList && value.every((part) => typeof part !== "object"))) {
    return [[path, JSON.stringify(value)]];
  }
  const name = (key) => (isList ? `${path}[${key}]` : path ? `${path}.${key}` : key);
  return Object.entries(value).flatMap(([key, part]) => flat(part, name(key)));
}

export class World {
  /** `draw` is called with the scene to draw in 3D. */
  constructor(requests, draw) {
    this.service = (service) => requests.ask({ service });
    this.terms = new Terms(this.service);
    this.draw = draw;
    this.panel = null;
    this.lamps = new Map();
    for (const id of ["object", "handles", "scene-shown"]) {
      $(id).addEventListener("change", () => attempt(() => this.lookAtScene()));
    }
    $("field").addEventListener("input", () => {
      $("field-value").value = this.known?.get($("field").value) ?? "";
    });
    $("field-form").addEventListener("submit", (event) => {
      event.preventDefault();
      attempt(() => this.set($("field").value.trim(), $("field-value").value));
    });
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
    for (const button of document.querySelectorAll("#clock-pace button")) {
      button.addEventListener("click", () => attempt(() => this.change({ clock: { pace: button.value } })));
    }
    $("clock-stop").addEventListener("click", () => attempt(() => this.change({ clock: "stop" })));
    setInterval(() => this.look(), LOOK_MS);
  }

  /** Forgets the scanner that was shown. */
  forget() {
    this.seen = null;
    this.lamps.clear();
    this.show(null);
  }

  /** The panel that is open, if any. */
  show(panel) {
    const news = panel !== this.panel;
    this.panel = panel;
    if (news) {
      [this.objects, this.fields] = [null, null];
      this.terms.clear();
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
    const looks = { scene: () => this.lookAtScene(), terms: () => this.terms.look(), faults: () => this.lookAtFaults(), clock: () => this.lookAtClock() };
    const look = looks[this.panel] ?? (this.isDrawn() && looks.scene);
    if (look && !this.looking && !document.hidden) {
      this.looking = true;
      // A device that has ended says so elsewhere.
      await look().catch(() => {});
      this.looking = false;
    }
  }

  /** Whether the scene is drawn in 3D. */
  isDrawn() {
    return this.answers && $("scene-shown").checked;
  }

  /** Says whether the scanner has a service channel, and whether this viewer is in control. */
  update(answers, controls) {
    $("scene-choice").hidden = !answers;
    const news = this.answers !== answers || this.controls !== controls;
    [this.answers, this.controls] = [answers, controls];
    if (news) {
      this.drawScene();
    }
  }

  drawScene() {
    const chosen = this.panel === "scene" && this.controls && this.objects ? Number($("object").value) : null;
    const scene = this.isDrawn() && this.seen ? this.seen : null;
    // A path cannot be moved.
    const moves = scene && chosen !== null && scene.objects[chosen]?.moves;
    this.draw({ scene, fields: this.fields, chosen: moves ? null : chosen, mode: $("handles").value });
  }

  /** Sets a field of the scene. */
  async set(field, value) {
    await this.service({ set: `${field}=${value}` });
    await this.lookAtFields();
    await this.look();
  }

  async lookAtFields() {
    this.fields = (await this.service({ get: "fields" })).fields;
    const all = flat(this.fields, "").filter(([path]) => path.includes(".") && !path.startsWith("rig"));
    this.known = new Map(all);
    $("fields-known").replaceChildren(...all.map(([path, value]) => new Option(value, path)));
    const lights = this.fields.light.map((light, i) => [`light[${i}]`, `lamp ${i}, ${light.kind}`, light.kind === "point" ? "intensity_w_sr" : "irradiance_w_m2", light]);
    const ambient = ["ambient", "ambient light", "irradiance_w_m2", this.fields.ambient];
    $("lamps").replaceChildren(...[ambient, ...lights].map(([path, name, key, light]) => {
      const [label, box] = [document.createElement("label"), document.createElement("input")];
      if (light[key] > 0) {
        this.lamps.set(path, light[key]);
      }
      [box.type, box.checked] = ["checkbox", light[key] > 0];
      // One that was off from the start has no power to return to.
      box.disabled = !this.lamps.has(path);
      box.addEventListener("change", () => attempt(() => this.set(`${path}.${key}`, box.checked ? this.lamps.get(path) : 0)));
      label.append(box, ` ${name} `);
      return label;
    }));
  }

  async lookAtScene() {
    if (this.panel !== "scene" && !this.isDrawn()) {
      this.drawScene();
      return;
    }
    const { scene } = await this.service({ get: "objects" });
    this.seen = scene;
    if (!this.fields) {
      await this.lookAtFields();
    }
    this.drawScene();
    if (this.panel !== "scene") {
      return;
    }
    const names = scene.objects.map(({ object, shape, moves }) => `${object}: ${shape}${moves ? ", moves" : ""}`);
    const fresh = String(names) !== String(this.objects?.map(({ name }) => name));
    this.objects = scene.objects.map((object, i) => ({ ...object, name: names[i] }));
    if (fresh) {
      $("object").replaceChildren(...names.map((name, i) => new Option(name, i)));
      this.fill();
      this.drawScene();
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

  /** Moves an object, as its handles were. */
  async moved(place) {
    await attempt(() => this.change({ place }));
    this.fill();
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
    if ($("fault-what").options.length === 0) {
      $("fault-what").replaceChildren(...faults.kinds.map((kind) => new Option(kind)));
    }
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
      $(id).title = stepped ? "" : "Pause time to step it.";
    }
    for (const button of document.querySelectorAll("#clock-pace button")) {
      button.setAttribute("aria-pressed", button.value === clock.pace);
    }
    $("clock-rows").replaceChildren(...rows([
      ["Clock", clock.pace],
      ["Device time", `${(clock.now_ns * 1e-9).toFixed(6)} s`],
      ["State", device.state],
      ["Exposures", device.frames],
      ["Missed triggers", device.missed_triggers],
      ...(clock.rendering ? [["Rendering", `${clock.rendering.real_time_factor} × real time`]] : []),
      ...(clock.late ? [["Late, 99 %", `${(clock.late.percentile_99_ns * 1e-6).toFixed(2)} ms`]] : []),
    ]));
  }
}
