// The emulated world: fields of the scene, image formation, and objects that are moved in 3D.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { SCREENSHOTS, Client, ask, command, launch, open, panel, seen, serve, text, until, watch } from "./helpers.mjs";

let browser;
let device;

before(async () => {
  browser = await launch();
  device = await serve(["--profile", "webcam-grey", "--scene", "sphere"]);
});

after(async () => {
  await browser?.close();
});

/** Returns the mean grey level of a device's frame that was exposed after now. */
async function level(client) {
  const { id } = await client.frame();
  await until(() => client.latest.id > id + 2);
  const { data } = client.latest;
  return data.reduce((sum, grey) => sum + grey, 0) / data.length;
}

test("fields of the scene are listed and set, and lamps are switched", async () => {
  const page = await open(browser, device.control);
  const client = new Client(device.runDir);
  await panel(page, "scene");
  await until(() => page.locator('#fields-known option[value="object[1].albedo"]').count());
  await page.fill("#field", "object[1].albedo");
  const before = Number(await page.inputValue("#field-value"));
  assert.ok(before > 0.2 && before <= 1);
  const bright = await level(client);
  for (const object of [0, 1]) {
    await page.fill("#field", `object[${object}].albedo`);
    await page.fill("#field-value", "0.05");
    await page.click("#field-form button");
    await until(async () => (await ask(device, { get: "fields" })).fields.object[object].albedo === 0.05);
  }
  const dark = await level(client);
  assert.ok(dark < 0.7 * bright, `${bright} DN, then ${dark} DN`);
  // Without the ambient light as well.
  const ambient = page.locator("#lamps input").first();
  assert.ok(await ambient.isChecked());
  await ambient.click();
  await until(async () => (await ask(device, { get: "fields" })).fields.ambient.irradiance_w_m2 === 0);
  const off = await level(client);
  assert.ok(off < dark, `${dark} DN, then ${off} DN`);
  await ambient.click();
  await until(async () => (await ask(device, { get: "fields" })).fields.ambient.irradiance_w_m2 > 0);
  await page.fill("#field", "object[0].albedo");
  await page.fill("#field-value", "7");
  await page.click("#field-form button");
  await text(page, "#panel-error", /albedo.*7.*expected/);
  await page.screenshot({ path: `${SCREENSHOTS}/fields.png` });
  client.end();
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("a term of image formation is switched off, and its effect and cost are seen", async () => {
  const page = await open(browser, device.control);
  const client = new Client(device.runDir);
  const differ = async () => {
    const { id, data } = await client.frame();
    await until(() => client.latest.id > id);
    return Buffer.compare(data, client.latest.data) !== 0;
  };
  assert.ok(await differ());
  await panel(page, "terms");
  await text(page, "#render-ms", /^[\d.]+ ms a frame$/);
  await text(page, "#terms", /noise.*sensor/);
  await page.click('[data-term="noise"]');
  await text(page, "#terms", /left out on request/);
  // A static scene without noise gives the same frame again and again.
  await until(async () => !(await differ()));
  await text(page, "#render-ms", /^[\d.]+ ms a frame$/);
  await page.screenshot({ path: `${SCREENSHOTS}/terms.png` });
  await page.click('[data-term="noise"]');
  await until(differ);
  const watcher = await open(browser, device.view);
  await panel(watcher, "terms");
  await watcher.waitForSelector('[data-term="noise"]');
  assert.ok(await watcher.locator('[data-term="noise"]').isDisabled());
  client.end();
  assert.deepEqual([...page.errors, ...watcher.errors], []);
  await watcher.context().close();
  await page.context().close();
});

/** Returns the middle of the reddest pixels of an element, in the page: the handle along x. */
async function handle(page, selector) {
  const { data, width, height } = await seen(page, selector);
  const found = [];
  for (let i = 0; i < width * height; i++) {
    if (data[4 * i] > 180 && data[4 * i + 1] < 70 && data[4 * i + 2] < 70) {
      found.push([i % width, Math.floor(i / width)]);
    }
  }
  const box = await page.locator(selector).boundingBox();
  const mean = (axis) => found.reduce((sum, at) => sum + at[axis], 0) / found.length;
  return found.length > 20 ? { x: box.x + mean(0), y: box.y + mean(1) } : null;
}

test("an object is moved in 3D by its handle, and the device moves it", async () => {
  const page = await open(browser, device.control);
  await command(["scan", "--run-dir", device.runDir, "--out", `${device.runDir}-scan`]);
  await text(page, "#result-pixel", /^\d+ points/);
  assert.equal(await handle(page, "#result-view"), null);
  await page.check("#scene-shown");
  await panel(page, "scene");
  await text(page, "#objects", /sphere/);
  const sphere = await page.locator("#object option", { hasText: "sphere" }).first().getAttribute("value");
  await page.selectOption("#object", sphere);
  const from = await until(() => handle(page, "#result-view"));
  await page.screenshot({ path: `${SCREENSHOTS}/scene.png` });
  const pose = async () => (await ask(device, { get: "objects" })).scene.objects[Number(sphere)];
  const before = await pose();
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  await page.mouse.move(from.x + 30, from.y, { steps: 5 });
  await page.mouse.up();
  const after = await until(async () => {
    const now = await pose();
    return Math.abs(now.position_mm[0] - before.position_mm[0]) > 1 && now;
  });
  // Along x, or in the plane of x and z, and without a turn.
  assert.ok(Math.abs(after.position_mm[1] - before.position_mm[1]) < 1e-6, `${after.position_mm}`);
  assert.deepEqual(after.rotation_deg, before.rotation_deg);
  await until(async () => Math.abs(Number(await page.inputValue("#position-x")) - after.position_mm[0]) < 0.001);
  // A viewer without control sees the scene, and no handle.
  const watcher = await open(browser, device.view);
  await text(watcher, "#result-pixel", /^\d+ points/);
  await watcher.check("#scene-shown");
  await panel(watcher, "scene");
  await text(watcher, "#objects", /sphere/);
  assert.equal(await handle(watcher, "#result-view"), null);
  assert.deepEqual([...page.errors, ...watcher.errors], []);
  await watcher.context().close();
  await page.context().close();
});

test("exposure and gain are set on the page", async () => {
  const client = await watch(["--run-dir", device.runDir]);
  const page = await open(browser, client.control);
  await panel(page, "scan");
  await until(async () => Number(await page.inputValue("#exposure-ms")) > 0);
  await page.fill("#exposure-ms", "3.5");
  await page.fill("#gain-db", "6");
  await page.click("#camera-form button");
  await text(page, "#frame-exposure", /^3\.500 ms$/);
  await page.fill("#exposure-ms", "100000");
  await page.click("#camera-form button");
  await text(page, "#panel-error", /^-222/);
  await until(async () => (await page.inputValue("#exposure-ms")) === "3.5");
  assert.deepEqual(page.errors, []);
  await page.context().close();
  await client.kill();
});
