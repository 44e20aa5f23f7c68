// A patient in a treatment room, tracked by several pods, as the page of `phasmid track --console` shows it.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { SCREENSHOTS, command, launch, open, panel, pixels, seen, serve, text, track, until } from "./helpers.mjs";

let browser;
let folder;
let room;
let tracking;

before(async () => {
  browser = await launch();
  folder = mkdtempSync(path.join(tmpdir(), "room-"));
  const planning = path.join(folder, "planning");
  await command(["patient", "plan", "p02-man-mean", "--spacing-mm", "12", "--out", planning]);
  const smaller = ["width_px=320", "height_px=240", "sensor_width_mm=2.48"].flatMap((field) => ["--set", `camera.${field}`]);
  room = await serve(["--profile", "sgrt-ceiling", "--clock", "fast", ...smaller]);
  tracking = await track(["--run-dir", room.runDir, "--planning", planning, "--tolerance-mm", "8", "--timeout", "600"]);
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

/** Returns how many different colours an element shows. */
async function colours(page, selector) {
  const { data } = await seen(page, selector);
  return new Set(new Uint32Array(data.buffer, data.byteOffset, data.length / 4)).size;
}

/** Returns the number of the last scan. */
async function scan(page) {
  return Number((await text(page, "#room-figures", /^Scan(\d+)/))[1]);
}

test("patient, results with the truth, beam and pods are shown from scan to scan", async () => {
  const page = await open(browser, tracking.control, { viewport: { width: 1400, height: 900 } });
  // What is planned is shown before the first scan.
  await until(async () => (await colours(page, "#room-canvas")) > 20);
  await text(page, "#beam", /^no scan yet$|held$/);
  assert.deepEqual(await page.locator("#source option").allTextContents(), ["room", "left", "right", "foot"]);
  const first = await scan(page);
  await until(async () => (await scan(page)) >= first + 2);
  const figures = /off by([\d.]+) ± ([\d.]+) mmin truth([\d.]+) mmError of the tumour([\d.]+) mm/;
  // The truth comes a little later than the result.
  const [shown, off, deviation, truth, error] = await text(page, "#room-figures", figures);
  assert.ok(Number(off) > 0.5 && Number(off) < 15 && Number(deviation) > 0.01, shown);
  assert.ok(Number(error) < 4 && Math.abs(off - truth) <= Number(error) + 0.02, shown);
  const pods = await page.locator("#pod-rows tr").allTextContents();
  assert.equal(pods.length, 3);
  for (const pod of pods) {
    const [, points, part] = /^(?:left|right|foot)(\d+?)(\d\d?) %$/.exec(pod);
    assert.ok(Number(points) > 100 && Number(part) > 2, pod);
  }
  // Curves are drawn, and the tracked surface comes and goes with its box.
  for (const title of ["Skin, vertical (z)", "Tumour, distance from plan"]) {
    const { data } = await pixels(page, `#charts canvas[aria-label="${title}"]`);
    assert.ok(data.some((byte) => byte > 0), title);
  }
  await page.screenshot({ path: `${SCREENSHOTS}/room.png` });
  const blue = async () => {
    const { data } = await seen(page, "#room-canvas");
    let count = 0;
    for (let i = 0; i < data.length; i += 4) {
      count += data[i + 2] > data[i] + 40 && data[i + 2] > 90 ? 1 : 0;
    }
    return count;
  };
  await page.click("#show-points");
  await page.click("#show-pods");
  const tracked = await blue();
  assert.ok(tracked > 2000, `${tracked} px of the tracked skin`);
  await page.click("#show-tracked");
  assert.ok((await blue()) < 0.2 * tracked);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("the beam comes on, a pod is a scanner of its own, and a second tab sees the results", async () => {
  const page = await open(browser, tracking.view);
  await text(page, "#beam", /on$/);
  await page.selectOption("#source", { label: "foot" });
  await text(page, "#figures", /Points\d+/);
  await text(page, "#frame-size", /^320 × 240 px$/);
  assert.ok(await page.isHidden("#room"));
  await panel(page, "traffic");
  await text(page, "#traffic-rows", /INIT|TRIG/);
  await page.selectOption("#source", { label: "room" });
  assert.ok(await page.isHidden("#scanner"));
  const now = await scan(page);
  const other = await open(browser, tracking.view);
  assert.ok((await scan(other)) >= now);
  await other.context().close();
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("the beam is held, with the reason, when the pods are silent", async () => {
  const page = await open(browser, tracking.control);
  await text(page, "#beam", /on$/);
  room.halt();
  await text(page, "#beam", /held$/);
  await text(page, "#beam-why", /too old$/);
  await text(page, "#room-figures", /Tumour off bylost/);
  await text(page, "#connection", /^connected$/);
  assert.deepEqual(page.errors, []);
  // Without tracking nobody knows.
  await tracking.kill();
  await text(page, "#beam", /^unknown$/);
  await page.context().close();
});
