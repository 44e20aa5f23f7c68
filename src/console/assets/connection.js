// The WebSocket to the console, which is opened again when it is lost. `wire.rs` describes the messages.

const FIRST_RETRY_MS = 300;
const LAST_RETRY_MS = 5000;
/** Name under which the tab keeps its token: unlike a cookie, other ports of this machine do not get it. */
const TOKEN = "token";

/** Moves the token of the address to the tab's own storage. */
function takeToken() {
  const token = new URLSearchParams(location.search).get(TOKEN);
  if (token !== null) {
    sessionStorage.setItem(TOKEN, token);
    history.replaceState(null, "", location.pathname + location.hash);
  }
  return sessionStorage.getItem(TOKEN) ?? "";
}

export class Connection {
  /** `told` gets each message and its payload, `changed` gets "open", "lost", "full" or "refused". */
  constructor(told, changed) {
    this.told = told;
    this.changed = changed;
    this.retryMs = FIRST_RETRY_MS;
    this.token = takeToken();
    this.path = `/ws?token=${this.token}`;
    this.open();
  }

  open() {
    const socket = new WebSocket(`ws://${location.host}${this.path}`);
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
    // A WebSocket does not tell why it was refused; a plain request does.
    const status = await fetch(this.path, { cache: "no-store" }).then((answer) => answer.status, () => null);
    if (status === 403) {
      this.changed("refused");
      return;
    }
    this.changed(status === 503 ? "full" : "lost");
    await new Promise((done) => setTimeout(done, this.retryMs));
    this.retryMs = Math.min(2 * this.retryMs, LAST_RETRY_MS);
    this.open();
  }

  /** Sends a recording. */
  async upload(file) {
    const path = `/recordings/${encodeURIComponent(file.name)}?token=${this.token}`;
    const answer = await fetch(path, { method: "POST", body: file });
    if (!answer.ok) {
      throw new Error((await answer.text()).trim());
    }
  }

  /** Sends a message; returns whether there is a connection. */
  ask(message) {
    const open = this.socket?.readyState === WebSocket.OPEN;
    if (open) {
      this.socket.send(JSON.stringify(message));
    }
    return open;
  }
}
