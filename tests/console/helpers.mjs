// A served device with a console, a client that drains its camera, and a browser.

import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import net from "node:net";
import { after } from "node:test";
import { tmpdir } from "node:os";
import path from "node:path";

const require = createRequire(path.join(process.env.PHASMID_NODE_MODULES, "here.js"));
const { chromium } = require("playwright-core");

const closers = [];
// Also after a failure, or the process would wait for them.
after(async () => {
  for (const close of closers) {
    await close();
  }
});

/** Longest time that anything here may take on a busy machine. */
export const DEADLINE_MS = Number(process.env.PHASMID_DEADLINE_MS ?? 120_000);
/** Where screenshots go. */
export const SCREENSHOTS = "target/console";

/** Starts a device with a console, and waits until it has printed its addresses. */
export async function serve(options = [], { port = 0, runDir } = {}) {
  const folder = mkdtempSync(path.join(tmpdir(), "console-"));
  const run = runDir ?? path.join(folder, "run");
  const started = await start(["serve", "--camera", "socket", "--run-dir", run, `--console=${port}`, "--while-stdin", ...options]);
  const kill = async () => {
    await started.kill();
    rmSync(folder, { recursive: true, force: true });
  };
  return { ...started, runDir: run, kill };
}

/** Starts a console that reads a camera. */
export function watch(options) {
  return start(["console", ...options]);
}

/** Starts to track a patient, with a console. */
export function track(options) {
  return start(["track", "--console", ...options]);
}

/** Starts the command, and waits until it has printed the addresses of its console. */
async function start(command) {
  const child = spawn("target/release/phasmid", command);
  const kill = async () => {
    child.kill("SIGKILL");
    if (child.exitCode === null && child.signalCode === null) {
      await once(child, "exit");
    }
  };
  closers.push(kill);
  let out = "";
  let err = "";
  child.stdout.on("data", (data) => { out += data; });
  child.stderr.on("data", (data) => { err += data; });
  await until(() => {
    if (child.exitCode !== null) {
      throw new Error(`phasmid ${command[0]} has ended: ${err}`);
    }
    return (out + err).includes("Ctrl-C ends it.");
  });
  const [control, view] = [...(out + err).matchAll(/http:\S+/g)].map(([url]) => url);
  return {
    control,
    view,
    port: Number(new URL(control).port),
    /** Ends it as a crash would. */
    kill,
    /** Halts it, as a computer that hangs does. */
    halt: () => child.kill("SIGSTOP"),
  };
}

/** Runs the command, and returns what it prints. */
export async function command(parts) {
  const child = spawn("target/release/phasmid", parts, { stdio: ["ignore", "pipe", "pipe"] });
  let [out, err] = ["", ""];
  child.stdout.on("data", (data) => { out += data; });
  child.stderr.on("data", (data) => { err += data; });
  const [status] = await once(child, "close");
  if (status !== 0) {
    throw new Error(`phasmid ${parts.join(" ")}: ${err}`);
  }
  return out;
}

/** Sends a request to a device's service channel, and returns its answer, a line. */
export async function ask(device, request) {
  const { service } = JSON.parse(readFileSync(path.join(device.runDir, "device.json")));
  const socket = net.connect(service);
  socket.write(`${JSON.stringify(request)}\n`);
  let line = "";
  for await (const data of socket) {
    line += data;
    if (line.includes("\n")) {
      break;
    }
  }
  const answer = JSON.parse(line);
  if (answer.error) {
    throw new Error(answer.error);
  }
  return answer;
}

/** Reads a device's camera without delay, as a fast client does. */
export class Client {
  constructor(runDir) {
    const device = JSON.parse(readFileSync(path.join(runDir, "device.json")));
    this.socket = net.connect(device.camera_socket.replace(/^socket:/, ""));
    closers.push(() => this.end());
    this.frames = 0;
    this.latest = null;
    this.arrivals = [];
    let buffered = Buffer.alloc(0);
    this.socket.on("data", (data) => {
      buffered = Buffer.concat([buffered, data]);
      while (buffered.length >= 72) {
        const size = 72 + Number(buffered.readBigUInt64LE(48));
        if (buffered.length < size) {
          break;
        }
        this.frames++;
        this.arrivals.push(performance.now());
        this.latest = {
          id: Number(buffered.readBigUInt64LE(8)),
          width: buffered.readUInt32LE(20),
          height: buffered.readUInt32LE(24),
          data: Buffer.from(buffered.subarray(72, size)),
        };
        buffered = buffered.subarray(size);
      }
    });
  }

  async frame() {
    await until(() => this.latest);
    return this.latest;
  }

  end() {
    this.socket.destroy();
  }
}

/** Waits until a function returns a true value, and returns that. */
export async function until(done) {
  const end = Date.now() + DEADLINE_MS;
  for (;;) {
    const value = await done();
    if (value) {
      return value;
    }
    if (Date.now() > end) {
      throw new Error(`waited ${DEADLINE_MS} ms for: ${done}`);
    }
    await new Promise((next) => setTimeout(next, 20));
  }
}

export function launch() {
  return chromium.launch({
    executablePath: "/usr/bin/chromium",
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
}

/** Opens an address in a browser of its own, and collects what goes wrong in it. */
export async function open(browser, url, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(DEADLINE_MS);
  page.errors = [];
  page.requests = [];
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") {
      page.errors.push(message.text());
    }
  });
  page.on("pageerror", (error) => page.errors.push(String(error)));
  page.on("request", (request) => page.requests.push(request.url()));
  page.on("websocket", (socket) => page.requests.push(socket.url()));
  await page.goto(url);
  return page;
}

/** Opens a panel. */
export async function panel(page, name) {
  await page.click(`#tabs button[value="${name}"]`);
  await page.waitForSelector(`#panel-${name}`);
}

/** Waits until an element's text matches, and returns the match. */
export async function text(page, selector, pattern) {
  let found;
  try {
    return await until(async () => {
      found = await page.textContent(selector);
      return pattern.exec(found);
    });
  } catch (error) {
    throw new Error(`${selector} says "${found?.slice(0, 500)}", expected ${pattern}`, { cause: error });
  }
}

/** Returns the samples of a canvas as RGBA, with its size. */
export async function pixels(page, selector) {
  return decoded(await page.evaluate(SAMPLES, { selector }));
}

/** Returns what is seen of an element on the screen, as RGBA, with its size. */
export async function seen(page, selector) {
  const png = await page.locator(selector).screenshot();
  return decoded(await page.evaluate(SAMPLES, { png: png.toString("base64") }));
}

function decoded(drawn) {
  return { ...drawn, data: Buffer.from(drawn.data, "base64") };
}

/** Runs in the page: reads a canvas or decodes a picture. */
async function SAMPLES({ selector, png }) {
  const source = selector
    ? document.querySelector(selector)
    : await createImageBitmap(new Blob([Uint8Array.from(atob(png), (char) => char.charCodeAt(0))]));
  const { width, height } = source;
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.drawImage(source, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  let bytes = "";
  for (let i = 0; i < data.length; i += 8192) {
    bytes += String.fromCharCode(...data.subarray(i, i + 8192));
  }
  return { width, height, data: btoa(bytes) };
}
