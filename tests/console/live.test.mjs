// The live camera.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { Client, SCREENSHOTS, launch, open, pixels, seen, serve, text, until, watch } from "./helpers.mjs";

let browser;
let device;
let client;

before(async () => {
  browser = await launch();
  // Without noise every free-running frame is the same.
  device = await serve(["--profile", "webcam-grey", "--scene", "sphere", "--no-noise"]);
});

after(async () => {
  await browser?.close();
});

/** Returns the place on the screen of the middle of a pixel, when the picture fits. */
async function placeOf(page, frame, x, y) {
  const box = await page.locator("#view").boundingBox();
  const scale = Math.min(box.width / frame.width, box.height / frame.height);
  return [
    box.x + box.width / 2 + (x + 0.5 - frame.width / 2) * scale,
    box.y + box.height / 2 + (y + 0.5 - frame.height / 2) * scale,
  ];
}

test("the page waits for a program that reads the camera, and then shows its frames", async () => {
  const page = await open(browser, device.control);
  await text(page, "#notice", /^No frames yet/);
  client = new Client(device.runDir);
  await client.frame();
  await text(page, "#device", /^1 program reads frames$/);
  await text(page, "#frame", /webcam|GREY/);
  await until(async () => (await page.textContent("#notice")) === "");
  await page.screenshot({ path: `${SCREENSHOTS}/live.png` });
  assert.deepEqual(page.errors, []);
  const hosts = new Set(page.requests.map((url) => new URL(url).host));
  assert.deepEqual([...hosts], [`127.0.0.1:${device.port}`]);
  await page.context().close();
});

test("what is drawn is what the device sent, pixel by pixel", async () => {
  const page = await open(browser, device.control);
  await text(page, "#frame", /Pattern/);
  const frame = await client.frame();
  const levels = new Set();
  for (const [x, y] of [[0, 0], [320, 240], [300, 200], [350, 260], [637, 477], [17, 401]]) {
    await page.mouse.move(...(await placeOf(page, frame, x, y)));
    const sent = frame.data[y * frame.width + x];
    await text(page, "#pixel", new RegExp(`^x ${x} px, y ${y} px: ${sent} DN$`));
    levels.add(sent);
  }
  assert.ok(levels.size > 2, "the scene is not uniform");
  // Each sample of the canvas, and what of them is seen on the screen.
  const { data } = await pixels(page, "#picture");
  const wrong = frame.data.findIndex((sent, at) => [0, 1, 2].some((colour) => data[4 * at + colour] !== sent));
  assert.equal(wrong, -1, `sample ${wrong}: ${data[4 * wrong]}, sent ${frame.data[wrong]}`);
  const box = await page.locator("#view").boundingBox();
  const screen = await seen(page, "#view");
  for (let y = 5; y < frame.height; y += 37) {
    for (let x = 5; x < frame.width; x += 41) {
      const [left, top] = await placeOf(page, frame, x, y);
      const at = Math.floor(top - box.y) * screen.width + Math.floor(left - box.x);
      const sent = frame.data[y * frame.width + x];
      const around = [-1, 0, 1].flatMap((row) => [-1, 0, 1].map((column) => frame.data[(y + row) * frame.width + x + column]));
      const red = screen.data[4 * at];
      assert.ok(red >= Math.min(...around) && red <= Math.max(...around), `${x}, ${y}: ${red} is seen, sent ${sent}`);
    }
  }
  await page.context().close();
});

test("the histogram has the frame's levels", async () => {
  const page = await open(browser, device.control);
  await text(page, "#saturation", /saturated/);
  const frame = await client.frame();
  const present = new Set(frame.data);
  const drawn = await pixels(page, "#histogram");
  const bars = new Set();
  for (let bin = 0; bin < 256; bin++) {
    const bottom = 4 * ((drawn.height - 1) * drawn.width + bin);
    if (drawn.data[bottom + 3] > 0) {
      bars.add(bin);
    }
  }
  // A level that few pixels have is a bar of less than a pixel.
  const counts = new Map();
  frame.data.forEach((level) => counts.set(level, (counts.get(level) ?? 0) + 1));
  for (let level = 0; level < 256; level++) {
    if (counts.get(level) > 20) {
      assert.ok(bars.has(level), `no bar at ${level}`);
    }
    if (!present.has(level)) {
      assert.ok(!bars.has(level), `a bar at ${level}`);
    }
  }
  await page.context().close();
});

test("buttons, keys and the wheel zoom to the pixel and back", async () => {
  const page = await open(browser, device.control);
  await text(page, "#frame", /Pattern/);
  const fitting = Number((await text(page, "#zoom", /^(\d+) %$/))[1]);
  await page.click("#in");
  const zoomed = Number((await text(page, "#zoom", /^(\d+) %$/))[1]);
  assert.ok(zoomed > fitting);
  await page.click("#out");
  await text(page, "#zoom", new RegExp(`^${fitting} %$`));
  await page.focus("#view");
  for (let i = 0; i < 20; i++) {
    await page.keyboard.press("+");
  }
  await text(page, "#zoom", /^6400 %$/);
  // One pixel of the picture fills many of the screen, all alike.
  await page.mouse.move(400, 400);
  const [, x, y] = await text(page, "#pixel", /^x (\d+) px, y (\d+) px/);
  await page.mouse.move(405, 402);
  const again = await text(page, "#pixel", /^x (\d+) px, y (\d+) px/);
  assert.ok(Math.abs(again[1] - x) <= 1 && Math.abs(again[2] - y) <= 1);
  const screen = await seen(page, "#view");
  let steps = 0;
  for (let i = 4; i < screen.data.length; i += 4) {
    steps += screen.data[i] !== screen.data[i - 4];
  }
  // At most one step for each 64 pixels, and one at the end of each row.
  assert.ok(steps <= screen.data.length / 4 / 64 + 2 * screen.height, `${steps} steps`);
  await page.keyboard.press("ArrowRight");
  await page.mouse.wheel(0, 500);
  await page.keyboard.press("0");
  await text(page, "#zoom", new RegExp(`^${fitting} %$`));
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("a page that is busy skips frames and then shows the latest", async () => {
  const page = await open(browser, device.control);
  await text(page, "#frame", /Pattern/);
  const before = client.frames;
  // Counts the frames that the page receives until it has drawn one after it was busy.
  const received = await page.evaluate(() => new Promise((done) => {
    let count = 0;
    const { parse } = JSON;
    JSON.parse = (text) => {
      const message = parse(text);
      count += message.kind === "frame";
      return message;
    };
    const { send } = WebSocket.prototype;
    WebSocket.prototype.send = function (text) {
      send.call(this, text);
      done(count);
    };
    const end = performance.now() + 3000;
    while (performance.now() < end);
  }));
  const missed = client.frames - before;
  assert.ok(missed > 20, `${missed} frames in the meantime`);
  // At most those that were sent before the page was busy.
  assert.ok(received <= 2, `${received} frames were waiting`);
  const now = client.latest.id;
  await until(async () => Number((await text(page, "#frame", /Number(\d+)/))[1]) >= now);
  await page.context().close();
});

test("a second viewer sees the same, also in the dark and on a narrow screen", async () => {
  const first = await open(browser, device.control);
  const second = await open(browser, device.view, { colorScheme: "dark", viewport: { width: 600, height: 900 } });
  for (const page of [first, second]) {
    await text(page, "#frame", /Pattern/);
    const { data } = await pixels(page, "#picture");
    assert.ok(new Set(data).size > 20, "the picture is not uniform");
  }
  const back = await second.evaluate(() => getComputedStyle(document.body).backgroundColor);
  assert.equal(back, "rgb(22, 25, 28)");
  await second.screenshot({ path: `${SCREENSHOTS}/dark.png` });
  await Promise.all([first, second].map((page) => page.context().close()));
});

test("saturated pixels are counted and marked", async () => {
  const bright = await serve(["--profile", "webcam-grey", "--scene", "sphere", "--set", "camera.f_number=1.4"]);
  const reader = new Client(bright.runDir);
  const page = await open(browser, bright.control);
  const [, count] = await text(page, "#saturation", /^(\d+) px saturated/);
  assert.ok(count > 300);
  assert.equal(await page.getAttribute("#saturation", "class"), "bad");
  const { data } = await pixels(page, "#picture");
  let marked = 0;
  for (let i = 0; i < data.length; i += 4) {
    marked += data[i] === 255 && data[i + 2] < 100;
  }
  assert.ok(marked > 100, `${marked} pixels are marked`);
  await page.screenshot({ path: `${SCREENSHOTS}/saturated.png` });
  await page.context().close();
});

test("levels of more than eight bits are shown from black to the white of their bits", async () => {
  const deep = await serve(["--profile", "webcam-grey", "--scene", "sphere", "--no-noise", "--set", "camera.format=Y16",
    "--set", "camera.sensor.bits=12", "--set", "camera.sensor.gain_dn_per_e=0.33456"]);
  const reader = new Client(deep.runDir);
  const page = await open(browser, deep.control);
  await text(page, "#saturation", /^bits of the sensor unknown$/);
  const frame = await reader.frame();
  await page.mouse.move(...(await placeOf(page, frame, 320, 240)));
  const sent = frame.data.readUInt16LE(2 * (240 * frame.width + 320));
  assert.ok(sent > 255, `${sent}`);
  await text(page, "#pixel", new RegExp(`: ${sent} DN$`));
  const { data } = await pixels(page, "#picture");
  const white = Number(await page.textContent("#white"));
  assert.ok(Math.abs(data[4 * (240 * frame.width + 320)] - (255 * sent) / white) <= 1);
  await page.context().close();
});

test("another scanner can be selected, and a reload shows it again", async () => {
  const two = await serve(["--profile", "webcam-grey", "--profile", "webcam-grey", "--scene", "plane"]);
  const reader = new Client(path.join(two.runDir, "webcam-grey-2"));
  const page = await open(browser, two.control);
  await text(page, "#notice", /^No frames yet/);
  await page.selectOption("#source", { label: "webcam-grey-2" });
  await text(page, "#frame", /Number\d+/);
  await page.reload();
  await text(page, "#frame", /Number\d+/);
  await page.selectOption("#source", { label: "webcam-grey" });
  await text(page, "#notice", /^No frames yet/);
  assert.equal(await page.textContent("#frame"), "");
  reader.end();
  await text(page, "#notice", /^No frames yet/);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("a console that reads a camera itself shows its frames, its loss and its return", async () => {
  const options = ["--profile", "webcam-grey", "--scene", "plane"];
  const runDir = mkdtempSync(path.join(tmpdir(), "console-"));
  const first = await serve(options, { runDir });
  const reader = await watch(["--run-dir", runDir]);
  const page = await open(browser, reader.control);
  await text(page, "#frame", /Number\d+/);
  const { data } = await pixels(page, "#picture");
  assert.ok(new Set(data).size > 20, "the picture is not uniform");
  await first.kill();
  await text(page, "#device", /camera is gone, waiting for it: ./);
  const second = await serve(options, { runDir });
  await text(page, "#device", /^1 program reads frames$/);
  const last = Number((await text(page, "#frame", /Number(\d+)/))[1]);
  await until(async () => Number((await text(page, "#frame", /Number(\d+)/))[1]) !== last);
  rmSync(runDir, { recursive: true, force: true });
  await page.context().close();
});
