// Recordings: made, opened, played, scrubbed and uploaded on the page.

import assert from "node:assert/strict";
import { copyFileSync, mkdirSync, mkdtempSync, readdirSync, symlinkSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { SCREENSHOTS, command, launch, open, panel, pixels, serve, text, until, watch } from "./helpers.mjs";

let browser;
let device;
let folder;

before(async () => {
  browser = await launch();
  folder = path.join(mkdtempSync(path.join(tmpdir(), "recordings-")), "all");
  mkdirSync(folder);
  device = await serve(["--profile", "webcam-grey", "--scene", "torso", "--recordings", folder]);
});

after(async () => {
  await browser?.close();
});

async function scan(sequence) {
  const out = path.join(mkdtempSync(path.join(tmpdir(), "scan-")), "out");
  await command(["scan", "--run-dir", device.runDir, "--sequence", sequence, "--out", out]);
}

test("a viewer in control records a scanner, and what was recorded is sound", async () => {
  const page = await open(browser, device.control);
  await panel(page, "traffic");
  await page.click("#record");
  await text(page, "#record-name", /^into recording-1\.rec$/);
  await scan("quick-4");
  await scan("quick-4-xy");
  await text(page, "#figures", /Sequencequick-4-xy/);
  await page.click("#record");
  await text(page, "#record-name", /^$/);
  const info = JSON.parse(await command(["record", "info", path.join(folder, "recording-1.rec"), "--json"]));
  assert.equal(info.damaged_at, null);
  assert.ok(info.frame.count >= 13 + 23, JSON.stringify(info.frame));
  // The next one gets another name.
  await page.click("#record");
  await text(page, "#record-name", /^into recording-2\.rec$/);
  await page.click("#record");
  await text(page, "#record-name", /^$/);
  const watcher = await open(browser, device.view);
  await panel(watcher, "traffic");
  assert.ok(await watcher.locator("#record").isDisabled());
  assert.deepEqual([...page.errors, ...watcher.errors], []);
  await watcher.context().close();
  await page.context().close();
});

test("a recording is opened, played, paused and scrubbed", async () => {
  writeFileSync(path.join(folder, "other.txt"), "no recording");
  symlinkSync("/etc/passwd", path.join(folder, "link.rec"));
  const player = await watch(["--recordings", folder]);
  const page = await open(browser, player.control);
  await panel(page, "playback");
  await text(page, "#recording", /^recording-1\.rec \([\d.]+ MB\)recording-2\.rec/);
  const listed = await page.locator("#recording option").evaluateAll((all) => all.map(({ value }) => value));
  assert.deepEqual(listed, ["recording-1.rec", "recording-2.rec"]);
  await page.selectOption("#recording", "recording-1.rec");
  await page.click("#recording-open");
  await text(page, "#play-name", /^recording-1\.rec$/);
  // It plays, and both scans appear.
  await text(page, "#figures", /Sequencequick-4Frames13/);
  await text(page, "#figures", /Sequencequick-4-xyFrames23/);
  await text(page, "#result-pixel", /^\d+ points/);
  await text(page, "#play", /^Play$/);
  const [, at, end] = await text(page, "#play-time", /^([\d.]+) of ([\d.]+) s$/);
  assert.equal(at, end);
  const last = await pixels(page, "#picture");
  await page.screenshot({ path: `${SCREENSHOTS}/playback.png` });
  // Back to where the first scan was complete.
  const slide = (part) => page.locator("#play-at").evaluate((slider, to) => {
    slider.value = Number(slider.min) + to * (slider.max - slider.min);
    slider.dispatchEvent(new Event("input"));
  }, part);
  // Where the scans are in the recording depends on how busy the machine was.
  const search = async (from, found) => {
    let part = from;
    await until(async () => {
      await slide(part);
      part = part < 0.95 ? part + 0.01 : from;
      return found();
    });
  };
  await search(0.1, async () => {
    const now = await pixels(page, "#picture").catch(() => null);
    return now && Buffer.compare(last.data, now.data) !== 0;
  });
  await search(0.3, async () => /Sequencequick-4Frames13/.test(await page.locator("#figures").textContent()));
  await panel(page, "traffic");
  await text(page, "#traffic-rows", /frame \d+, pattern/);
  await page.selectOption("#traffic-seconds", "0.5");
  await page.screenshot({ path: `${SCREENSHOTS}/console.png` });
  await panel(page, "playback");
  await page.selectOption("#play-speed", "10");
  await page.click("#play");
  await text(page, "#figures", /Sequencequick-4-xyFrames23/);
  await text(page, "#play", /^Play$/);
  assert.deepEqual(page.errors, []);
  await page.context().close();
  await player.kill();
});

test("a recording is uploaded, and nothing is overwritten or written elsewhere", async () => {
  const page = await open(browser, device.control);
  await page.selectOption("#source", { label: "recordings" });
  await panel(page, "playback");
  const mine = path.join(path.dirname(folder), "mine.rec");
  copyFileSync(path.join(folder, "recording-1.rec"), mine);
  await page.setInputFiles("#recording-file", mine);
  await text(page, "#play-name", /^mine\.rec$/);
  await text(page, "#figures", /Sequencequick-4Frames13/);
  await page.setInputFiles("#recording-file", mine);
  await text(page, "#panel-error", /^mine\.rec exists; expected another name$/);
  const odd = path.join(path.dirname(folder), "odd.txt");
  writeFileSync(odd, "x");
  await page.setInputFiles("#recording-file", odd);
  await text(page, "#panel-error", /odd\.txt.*expected a name that ends with \.rec/);
  const broken = path.join(path.dirname(folder), "broken.rec");
  writeFileSync(broken, "no recording at all");
  await page.setInputFiles("#recording-file", broken);
  await text(page, "#scan-status", /broken\.rec.*not a recording/);
  // The page's own token is needed, and its origin.
  const [control, view] = [device.control, device.view].map((url) => new URL(url).searchParams.get("token"));
  const status = (name, token) => page.evaluate(async ([to, secret]) => {
    const answer = await fetch(`/recordings/${to}?token=${secret}`, { method: "POST", body: "x" });
    return answer.status;
  }, [name, token]);
  assert.equal(await status("a.rec", view), 403);
  assert.equal(await status("a.rec", "0"), 403);
  assert.equal(await status("..%2Fa.rec", control), 400);
  const foreign = await fetch(`http://127.0.0.1:${device.port}/recordings/a.rec?token=${control}`, {
    method: "POST", body: "x", headers: { Origin: "http://evil.example" },
  });
  assert.equal(foreign.status, 403);
  assert.deepEqual(readdirSync(folder).sort(), ["broken.rec", "link.rec", "mine.rec", "other.txt", "recording-1.rec", "recording-2.rec"]);
  await page.context().close();
});
