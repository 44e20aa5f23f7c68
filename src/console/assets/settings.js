// Exposure and gain of the camera, on a control port that speaks SCPI.

import { attempt } from "./requests.js";

const $ = (id) => document.getElementById(id);

export class Settings {
  constructor(requests) {
    this.requests = requests;
    $("camera-form").addEventListener("submit", (event) => {
      event.preventDefault();
      attempt(() => this.set());
    });
  }

  /** Fills the fields, unless a scan is using the port. */
  look() {
    return this.fill().catch(() => {});
  }

  async fill() {
    const known = await this.requests.ask({ lines: {} });
    $("camera-form").hidden = known.length === 0;
    if (known.length) {
      const { reply } = await this.requests.ask({ line: "CAM:EXP?;GAIN?" });
      const [exposure, gain] = reply.split(";").map(Number);
      [$("exposure-ms").value, $("gain-db").value] = [Number((1000 * exposure).toPrecision(9)), gain];
    }
  }

  async set() {
    const exposure = Number($("exposure-ms").value) / 1000;
    const { reply } = await this.requests.ask({ line: `CAM:EXP ${exposure};GAIN ${Number($("gain-db").value)};:SYST:ERR?` });
    // What the device made of it.
    await this.look();
    if (!reply.startsWith("0,")) {
      throw new Error(reply);
    }
  }
}
