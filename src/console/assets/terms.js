// The terms of image formation: which are computed, why, and what rendering takes with them.

import { attempt } from "./requests.js";

const $ = (id) => document.getElementById(id);

export class Terms {
  constructor(service) {
    this.service = service;
    this.before = null;
  }

  clear() {
    this.before = null;
    $("terms").replaceChildren();
    $("render-ms").textContent = "unknown";
  }

  async look() {
    const { device } = await this.service({ get: "device" });
    this.show(await this.service({ get: "plan" }), device.rendered);
  }

  show({ plan, render_us: spent }, frames) {
    const focused = document.activeElement?.dataset?.term;
    $("terms").replaceChildren(...plan.flatMap(({ term, included, pass, why }) => {
      const [label, box, of, reason] = ["label", "input", "span", "span"].map((name) => document.createElement(name));
      [box.type, box.checked, box.dataset.term] = ["checkbox", included, term];
      box.addEventListener("change", () => attempt(() => this.choose(term, box.checked)));
      label.append(box, ` ${term}`);
      [of.textContent, reason.textContent] = [pass, why];
      for (const part of [label, of, reason]) {
        part.className = included ? "" : "out";
      }
      return [label, of, reason];
    }));
    document.querySelector(`[data-term="${focused}"]`)?.focus();
    const { before } = this;
    if (frames > (before?.frames ?? Infinity)) {
      $("render-ms").textContent = `${((spent - before.spent) / (frames - before.frames) / 1000).toFixed(2)} ms a frame`;
    }
    if (!before || frames > before.frames) {
      this.before = { spent, frames };
    }
  }

  async choose(term, included) {
    await this.service({ term: { term, included } });
    // Frames from now on are rendered with it.
    this.before = null;
    await this.look();
  }
}
