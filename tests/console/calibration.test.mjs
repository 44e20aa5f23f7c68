// Calibration on the page: the board is found, scans become poses, and the rig is that of the device.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { SCREENSHOTS, ask, launch, open, panel, pixels, serve, text, until, watch } from "./helpers.mjs";

/** Positions (mm) and rotations (degrees) of the board in front of the device. */
const POSES = [
  [[0, 0, 900], [0, 0, 0]],
  [[60, 20, 950], [25, 0, 5]],
  [[-60, -20, 950], [-25, 0, 0]],
  [[20, -30, 1000], [0, 28, -5]],
  [[-20, 30, 1000], [0, -28, 90]],
];
const BOARD = { columns: 25, rows: 19, pitch: 18, dot: 7.5, marker: 15 };

let browser;
let device;
let client;

before(async () => {
  browser = await launch();
  const board = `{ pattern = "dots", columns = 25, rows = 19, pitch_mm = 18.0, dot_mm = 7.5, marker_mm = 15.0 }`;
  device = await serve(["--profile", "webcam-grey", "--scene", "board", "--set", `object[0].shape.board=${board}`]);
  client = await watch(["--run-dir", device.runDir]);
});

after(async () => {
  await browser?.close();
});

/** Returns the numbers of a row of the poses. */
async function row(page, index) {
  const cells = await page.locator("#pose-rows tr").nth(index).locator("td").allTextContents();
  return cells.slice(1, 7).map(Number);
}

test("a board is moved, seen and scanned, and the solution is the rig of the device", async () => {
  const page = await open(browser, client.control);
  await text(page, "#frame-pattern", /^none, free-running$/);
  await panel(page, "calibration");
  await text(page, "#covered", /^no poses yet$/);
  await page.click("#pose-take");
  await text(page, "#panel-error", /there is no scan yet/);
  for (const [name, value] of Object.entries(BOARD)) {
    await page.fill(`#board-${name}`, String(value));
  }
  await page.click("#board-form button");
  await page.fill("#pose-sequence", "quick-4-xy");
  for (const [index, [position_mm, rotation_deg]] of POSES.entries()) {
    await ask(device, { place: { object: 0, position_mm, rotation_deg } });
    // The live picture shows the board at once.
    await text(page, "#board-seen", /^live picture: 4\d\d of 475 points$/);
    const before = await page.textContent("#figures");
    await page.click("#pose-scan-once");
    await until(async () => (await page.textContent("#figures")) !== before);
    await until(async () => (await page.textContent("#scan-status")) === "");
    await page.click("#pose-take");
    await until(async () => (await page.locator("#pose-rows tr").count()) === index + 1);
    const [points, lit] = await row(page, index);
    assert.ok(points > 440 && points <= 475 && lit > 300, `pose ${index}: ${points} points, ${lit} with the projector`);
  }
  await text(page, "#covered", /^\d+ % of the picture covered by 5 poses$/);
  const marked = async () => { const { data } = await pixels(page, "#marks"); return data.filter((byte) => byte > 0).length; };
  const points = await marked();
  assert.ok(points > 1000);
  await page.click("#pose-take");
  await text(page, "#panel-error", /a pose already/);
  await page.click("#rig-solve");
  await text(page, "#rig-summary", /^0\.\d+ px RMS in the camera, 0\.\d+ px in the projector$/);
  const [, , distance, , camera, projector] = await row(page, 0);
  assert.ok(Math.abs(distance - 900) < 30 && camera < 0.2 && projector < 0.5, `${distance} mm, ${camera} px, ${projector} px`);
  // Residuals are drawn from the points.
  assert.ok((await marked()) !== points);
  await page.screenshot({ path: `${SCREENSHOTS}/calibration.png` });
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#rig-save")]);
  assert.equal(download.suggestedFilename(), "calibration.toml");
  const saved = readFileSync(await download.path(), "utf8");
  const { calibration } = await ask(device, { get: "calibration" });
  const fx = (toml) => [...toml.matchAll(/focal_px = \[([\d.]+)/g)].map(([, value]) => Number(value));
  const [found, known] = [fx(saved), fx(calibration)];
  assert.equal(found.length, 2);
  for (const i of [0, 1]) {
    assert.ok(Math.abs(found[i] / known[i] - 1) < 0.02, `${found} px, ${known} px`);
  }
  // A changed list of poses makes the solution old.
  await page.locator("#pose-rows button").first().click();
  await text(page, "#rig-summary", /solve again$/);
  assert.equal(await page.locator("#pose-rows tr").count(), 4);
  // A viewer sees the poses and the board, and may not change them.
  const watcher = await open(browser, client.view);
  await panel(watcher, "calibration");
  await text(watcher, "#covered", /covered by 4 poses$/);
  await text(watcher, "#board-seen", /of 475 points$/);
  assert.ok(await watcher.isDisabled("#pose-take"));
  await watcher.context().close();
  await page.click("#poses-forget");
  await text(page, "#covered", /^no poses yet$/);
  await text(page, "#rig-summary", /^$/);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("a wrong board and a view without a board are said", async () => {
  const page = await open(browser, client.control);
  await panel(page, "calibration");
  // The fields have the board of the console by then.
  await text(page, "#covered", /^no poses yet$/);
  await page.fill("#board-dot", "20");
  await page.click("#board-form button");
  await text(page, "#panel-error", /dot_mm: 20; expected above 0 and below the pitch/);
  await page.selectOption("#board-kind", "chess");
  assert.ok(await page.isDisabled("#board-dot"));
  await page.fill("#board-columns", "9");
  await page.fill("#board-rows", "6");
  await page.click("#board-form button");
  await text(page, "#board-seen", /^live picture: .*expected/);
  await page.click("#pose-take");
  await text(page, "#panel-error", /expected/);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});
