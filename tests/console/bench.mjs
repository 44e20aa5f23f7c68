// Prints how fast the console is and how much it weighs. Run by tests/console/run, with this file's name.

import { test } from "node:test";
import { Client, command, launch, open, serve, text, until, watch } from "./helpers.mjs";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";

const MEASURED_MS = 10_000;
/** Number of clouds of a recording. */
const UPDATES = 20;

/** Returns the frames per second that a client receives. */
async function rate(client) {
  const before = client.frames;
  const begin = performance.now();
  await new Promise((done) => setTimeout(done, MEASURED_MS));
  return (1000 * (client.frames - before)) / (performance.now() - begin);
}

test("figures", async () => {
  const browser = await launch();
  const device = await serve(["--profile", "webcam-grey", "--scene", "sphere"]);
  const client = new Client(device.runDir);
  await client.frame();
  const alone = await rate(client);
  const page = await open(browser, device.control);
  await text(page, "#frame", /Delay\d/);
  const watched = await rate(client);
  const [, shown] = await text(page, "#frame", /Shown([\d.]+)/);
  const [, delay] = await text(page, "#frame", /Delay(\d+)/);
  await page.context().close();
  const again = await rate(client);
  const weight = await Promise.all(page.requests.filter((url) => url.startsWith("http")).map(async (url) => {
    const response = await fetch(url, { headers: { cookie: await cookie(device.control) } });
    return (await response.arrayBuffer()).byteLength;
  }));
  const bytes = weight.reduce((a, b) => a + b, 0);
  console.log(`client: ${alone.toFixed(2)} frames/s alone, ${watched.toFixed(2)} beside a page, ${again.toFixed(2)} alone`);
  console.log(`page: ${shown} frames/s shown, ${delay} ms from arrival to drawing (median)`);
  console.log(`page: ${bytes} bytes, ${page.errors.length} errors`);
  await scans(browser);
  await recorded(browser);
  await browser.close();
});

/** Prints how fast scans are shown, of a client that scans without a pause. */
async function scans(browser) {
  const device = await serve(["--profile", "webcam-grey", "--scene", "sphere"]);
  const folder = mkdtempSync(path.join(tmpdir(), "bench-"));
  await command(["scan", "--run-dir", device.runDir, "--no-decode", "--out", path.join(folder, "scan")]);
  rmSync(folder, { recursive: true });
  for (const time of ["first", "second"]) {
    const begin = performance.now();
    const page = await open(browser, device.control);
    const [, points] = await text(page, "#result-pixel", /^(\d+) points$/);
    console.log(`page: ${points} points ${((performance.now() - begin) / 1000).toFixed(2)} s after navigation, the ${time} time`);
    await page.context().close();
  }
  const client = await watch(["--run-dir", device.runDir]);
  const page = await open(browser, client.control);
  await page.click('#tabs button[value="scan"]');
  await page.click("#scan-repeat");
  await text(page, "#figures", /Shown[\d.]+ scans/);
  await new Promise((done) => setTimeout(done, MEASURED_MS));
  const [, clouds] = await text(page, "#figures", /Shown([\d.]+) scans/);
  const [, points] = await text(page, "#result-pixel", /^(\d+) points$/);
  const [, shown] = await text(page, "#frame", /Shown([\d.]+)/);
  const [, delay] = await text(page, "#frame", /Delay(\d+)/);
  console.log(`page: ${clouds} clouds/s of ${points} points and ${shown} frames/s, ${delay} ms from arrival to drawing (median)`);
  await page.context().close();
}

/** Prints how fast the clouds of a recording are shown, one after the other. */
async function recorded(browser) {
  const folder = mkdtempSync(path.join(tmpdir(), "bench-"));
  const recording = path.join(folder, "many.rec");
  // The projector lights all that the camera sees.
  const lit = ["--set", "projector.throw_ratio=0.8"];
  const device = await serve(["--profile", "webcam-grey", "--scene", "plane", "--clock", "fast", "--record", recording, ...lit]);
  for (let i = 0; i < 4; i++) {
    await command(["scan", "--run-dir", device.runDir, "--no-decode", "--force", "--out", path.join(folder, "scan")]);
  }
  await device.kill();
  const player = await watch(["--recordings", folder]);
  const page = await open(browser, player.control);
  await page.click('#tabs button[value="playback"]');
  await text(page, "#recording", /many/);
  await page.selectOption("#play-speed", "0.5");
  await page.click("#recording-open");
  await text(page, "#play", /^Play$/);
  // Two scans in turn, each as soon as the one before is shown: their numbers of points differ.
  let points = await page.textContent("#result-pixel");
  const begin = performance.now();
  for (let i = 0; i < UPDATES; i++) {
    await page.locator("#play-at").evaluate((slider, part) => {
      slider.value = Number(slider.min) + part * (slider.max - slider.min);
      slider.dispatchEvent(new Event("input"));
    }, i % 2 ? 1 : 0.4);
    points = await until(async () => {
      const now = await page.textContent("#result-pixel");
      return now !== points && /^\d+ points/.test(now) && now;
    });
  }
  const rate = (1000 * UPDATES) / (performance.now() - begin);
  console.log(`recording: ${rate.toFixed(1)} clouds/s of ${points}, 16 bytes a point`);
  await page.context().close();
  await player.kill();
  rmSync(folder, { recursive: true });
}

async function cookie(url) {
  return (await fetch(url)).headers.get("set-cookie").split(";")[0];
}
