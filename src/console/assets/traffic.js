// The traffic of a scanner: a time line and a list.

/** Maximum number of events that are kept, and of free-running frames, which would push out the others. */
const [MAX_EVENTS, MAX_FREE] = [2000, 600];
/** Maximum number of events in the list. */
const MAX_ROWS = 300;
/** Time by which events may be out of order. */
const BACK_S = 1;
const LANES = ["commands", "replies", "exposures", "frames", "events"];

const $ = (id) => document.getElementById(id);

/** Returns the lane of an event. */
function lane({ what }) {
  return { sent: 0, received: 1, frame: 3 }[what] ?? 4;
}

const isFree = ({ frame }) => Boolean(frame) && frame.pattern === null;

export class Traffic {
  constructor() {
    this.clear();
    $("traffic-pause").addEventListener("click", () => this.pause(!this.paused));
    $("traffic-free").addEventListener("change", () => this.list());
    $("traffic-seconds").addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe($("traffic-line"));
  }

  clear() {
    this.events = [];
    this.shown = [];
    this.pause(false);
  }

  pause(paused) {
    this.paused = paused;
    $("traffic-pause").setAttribute("aria-pressed", paused);
    this.update();
  }

  add(events) {
    const known = [...this.events, ...events];
    // A recording that goes back, or a device that was started again: what came before is of another time.
    const back = known.findLastIndex(({ time_s: time }, i) => i > 0 && time < known[i - 1].time_s - BACK_S);
    const all = known.slice(Math.max(back, 0));
    const [free, others] = [all.filter(isFree).slice(-MAX_FREE), all.filter((event) => !isFree(event)).slice(-MAX_EVENTS)];
    this.events = [...free, ...others].sort((a, b) => a.number - b.number);
    this.update();
  }

  update() {
    if (!this.paused) {
      this.shown = this.events;
      this.list();
      this.draw();
    }
  }

  /** Latest time in seconds of the device's clock, or of the host's if there is none. */
  now() {
    return this.shown.at(-1)?.time_s ?? 0;
  }

  list() {
    const free = $("traffic-free").checked;
    const chosen = this.shown.filter((event) => free || !isFree(event));
    const rows = chosen.slice(-MAX_ROWS).map((event, i, all) => {
      const row = document.createElement("tr");
      const frame = event.frame && `frame ${event.frame.id}${event.frame.pattern === null ? "" : `, pattern ${event.frame.pattern}`}`;
      const cells = [event.time_s.toFixed(6), event.channel, event.what, frame ?? event.text ?? "", latency(all, i)];
      row.className = event.what;
      row.append(...cells.map((text) => {
        const cell = document.createElement("td");
        cell.textContent = text;
        return cell;
      }));
      return row;
    });
    $("traffic-rows").replaceChildren(...rows.reverse());
  }

  draw() {
    const canvas = $("traffic-line");
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) {
      return;
    }
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const colour = (name) => {
      canvas.style.color = `var(${name})`;
      return getComputedStyle(canvas).color;
    };
    const [faint, line] = [colour("--faint"), colour("--line")];
    const colours = [colour("--mark"), colour("--good"), colour("--truth"), colour("--text"), colour("--bad")];
    const seconds = Number($("traffic-seconds").value);
    const [now, left, tall] = [this.now(), 80, height / LANES.length];
    const x = (time) => left + ((width - left) * (time - now + seconds)) / seconds;
    context.font = "11px system-ui, sans-serif";
    LANES.forEach((name, i) => {
      context.fillStyle = faint;
      context.fillText(name, 2, (i + 0.65) * tall);
      context.strokeStyle = line;
      context.strokeRect(left, i * tall, width - left, tall);
    });
    for (const event of this.shown) {
      const exposure = event.frame?.exposure_s;
      if (exposure && exposure[1] > now - seconds) {
        context.fillStyle = colours[2];
        const from = Math.max(left, x(exposure[0]));
        context.fillRect(from, 2 * tall + 3, Math.max(1, x(exposure[1]) - from), tall - 6);
      }
      if (event.time_s >= now - seconds) {
        const at = lane(event);
        context.fillStyle = colours[at];
        context.fillRect(x(event.time_s) - 1, at * tall + 2, 2, tall - 4);
      }
    }
  }
}

/** Returns how long an event came after what it follows: a reply after its command, a frame after its exposure. */
function latency(events, i) {
  const event = events[i];
  const milliseconds = (since) => `${(1000 * (event.time_s - since)).toFixed(1)} ms`;
  if (event.what === "received") {
    const sent = events.slice(0, i).findLast((other) => other.what === "sent" && other.channel === event.channel);
    return sent ? `${milliseconds(sent.time_s)} after the command` : "";
  }
  if (event.what === "frame" && event.frame.exposure_s) {
    return `${milliseconds(event.frame.exposure_s[1])} after the exposure`;
  }
  return "";
}
