// The WebSocket to the console, which is opened again when it is lost. `wire.rs` describes the messages.

const FIRST_RETRY_MS = 300;
const LAST_RETRY_MS = 5000;

export class Connection {
  /** `told` gets each message and its payload, `changed` gets "open", "lost" or "refused". */
  constructor(told, changed) {
    this.told = told;
    this.changed = changed;
    this.retryMs = FIRST_RETRY_MS;
    this.open();
  }

  open() {
    const socket = new WebSocket(`ws://${location.host}/ws`);
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.retryMs = FIRST_RETRY_MS;
      this.changed("open");
    };
    socket.onmessage = ({ data }) => {
      const length = new DataView(data).getUint32(0, true);
      const message = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
      this.told(message, data.slice(4 + length));
    };
    socket.onclose = () => this.retry();
  }

  async retry() {
    this.changed("lost");
    await new Promise((done) => setTimeout(done, this.retryMs));
    this.retryMs = Math.min(2 * this.retryMs, LAST_RETRY_MS);
    // A WebSocket does not tell why it was refused.
    try {
      const page = await fetch("/icon.svg", { cache: "no-store" });
      if (page.status === 403) {
        this.changed("refused");
        return;
      }
    } catch {
      this.retry();
      return;
    }
    this.open();
  }

  ask(message) {
    if (this.socket.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(message));
    }
  }
}
