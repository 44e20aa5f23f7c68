// A terminal on the control port.

/** Maximum number of lines that are kept. */
const MAX_LINES = 500;
/** Commands that every device with SCPI has (IEEE 488.2). */
const COMMON = ["*IDN?", "*RST", "*CLS", "*OPC?", "*ESR?", "*STB?", "*TST?", "*TRG", "SYSTem:ERRor?"];
const HISTORY = "history";

const $ = (id) => document.getElementById(id);

export class Terminal {
  constructor(requests) {
    this.requests = requests;
    this.history = JSON.parse(sessionStorage.getItem(HISTORY) ?? "[]");
    this.at = this.history.length;
    // Each line waits for the reply to the one before.
    this.last = Promise.resolve();
    $("terminal-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.send($("line-input").value.trim());
    });
    $("line-input").addEventListener("keydown", (event) => this.key(event));
  }

  clear() {
    $("terminal-log").replaceChildren();
    this.known = null;
    this.last = Promise.resolve();
    this.era = {};
  }

  /** Fills the completion. */
  async show() {
    if (this.known) {
      return;
    }
    this.known = COMMON;
    const { era } = this;
    const headers = await this.requests.ask({ lines: {} }).catch(() => []);
    if (era !== this.era) {
      return;
    }
    // An optional part is left out.
    const plain = headers.map((header) => header.replace(/\[.*?\]/g, "")).filter((header) => !header.startsWith("*"));
    this.known = [...COMMON, ...plain.flatMap((header) => [header, `${header}?`])];
    this.complete();
  }

  complete() {
    const all = [...new Set([...this.history, ...this.known])];
    $("lines").replaceChildren(...all.map((line) => new Option(line, line)));
  }

  send(line) {
    if (!line) {
      return;
    }
    $("line-input").value = "";
    this.history = [...this.history.filter((other) => other !== line), line].slice(-100);
    this.at = this.history.length;
    sessionStorage.setItem(HISTORY, JSON.stringify(this.history));
    this.complete();
    const { era } = this;
    // A line for a scanner that is no longer shown is left out.
    this.last = this.last.then(() => era === this.era && this.talk(line));
  }

  async talk(line) {
    this.log(`> ${line}`, "sent");
    try {
      const { reply, took_s: took } = await this.requests.ask({ line });
      this.log(reply || "no reply", reply ? "reply" : "faint", `${(1000 * took).toFixed(0)} ms`);
    } catch (error) {
      this.log(error.message, "bad");
    }
  }

  log(text, kind, note = "") {
    const line = document.createElement("div");
    line.className = kind;
    line.textContent = text;
    if (note) {
      const aside = document.createElement("small");
      aside.textContent = note;
      line.append(" ", aside);
    }
    const log = $("terminal-log");
    log.append(line);
    while (log.childElementCount > MAX_LINES) {
      log.firstChild.remove();
    }
    log.scrollTop = log.scrollHeight;
  }

  /** Up and down go through what was sent. */
  key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!step) {
      return;
    }
    event.preventDefault();
    this.at = Math.min(Math.max(this.at + step, 0), this.history.length);
    $("line-input").value = this.history[this.at] ?? "";
  }
}
