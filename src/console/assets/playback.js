// Recordings: the list, and the one that is played.

import { attempt } from "./requests.js";

/** Time between two looks at the position. */
const LOOK_MS = 200;

const $ = (id) => document.getElementById(id);

export class Playback {
  /** `upload` sends a file to the console. */
  constructor(requests, upload) {
    this.requests = requests;
    this.shown = false;
    const play = (wish) => attempt(() => requests.ask({ play: wish }).then(() => this.look()));
    $("recording-open").addEventListener("click", () => attempt(() => this.open($("recording").value)));
    $("recording-file").addEventListener("change", () => attempt(() => this.send(upload)));
    $("play").addEventListener("click", () => play({ playing: !this.playing, ...this.restart() }));
    $("play-speed").addEventListener("change", () => play({ speed: Number($("play-speed").value) }));
    // While the slider is dragged, the position follows it.
    $("play-at").addEventListener("input", () => {
      this.wanted = Number($("play-at").value);
      this.scrub();
    });
    setInterval(() => this.look(), LOOK_MS);
  }

  /** A recording at its end begins again. */
  restart() {
    const { about } = this;
    return about && !this.playing && about.at_s >= about.end_s ? { at_s: about.begin_s } : {};
  }

  async scrub() {
    if (this.scrubbing) {
      return;
    }
    this.scrubbing = true;
    while (this.wanted !== null) {
      const at = this.wanted;
      this.wanted = null;
      await attempt(() => this.requests.ask({ play: { at_s: at } }));
    }
    this.scrubbing = false;
  }

  async open(name) {
    await this.requests.ask({ open: { name } });
    await this.look();
  }

  async send(upload) {
    const [file] = $("recording-file").files;
    if (file) {
      try {
        await upload(file);
      } finally {
        $("recording-file").value = "";
      }
      await this.list();
      await this.open(file.name);
    }
  }

  /** Whether the panel is open. */
  show(shown) {
    const opened = shown && !this.shown;
    this.shown = shown;
    if (opened) {
      attempt(() => this.list());
      this.look();
    }
  }

  async list() {
    const chosen = $("recording").value;
    const list = await this.requests.ask({ recordings: {} });
    $("recording").replaceChildren(...list.map(({ name, bytes }) => new Option(`${name} (${(bytes / 1e6).toFixed(1)} MB)`, name)));
    if (list.some(({ name }) => name === chosen)) {
      $("recording").value = chosen;
    }
    $("recording-none").hidden = list.length > 0;
  }

  async look() {
    if (!this.shown || this.looking || document.hidden) {
      return;
    }
    this.looking = true;
    const about = await this.requests.ask({ playback: {} }).catch(() => null);
    this.looking = false;
    this.about = about;
    this.playing = Boolean(about?.playing);
    $("play").textContent = this.playing ? "Pause" : "Play";
    $("play-name").textContent = about?.name ?? "no recording is open";
    if (about && !this.scrubbing && document.activeElement !== $("play-speed")) {
      $("play-speed").value = about.speed;
    }
    if (about && !this.scrubbing) {
      [$("play-at").min, $("play-at").max, $("play-at").value] = [about.begin_s, about.end_s, about.at_s];
      $("play-time").textContent = `${(about.at_s - about.begin_s).toFixed(2)} of ${(about.end_s - about.begin_s).toFixed(2)} s`;
    }
  }
}
