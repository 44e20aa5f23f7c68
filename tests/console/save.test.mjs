// What a viewer saves: pictures, clouds, arrays, and a link to a view.

import assert from "node:assert/strict";
import { mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { command, launch, open, seen, serve, text } from "./helpers.mjs";

let browser;
let device;
let folder;

before(async () => {
  browser = await launch();
  device = await serve(["--profile", "webcam-grey", "--scene", "sphere"]);
  folder = path.join(mkdtempSync(path.join(tmpdir(), "save-")), "scan");
  await command(["scan", "--run-dir", device.runDir, "--out", folder]);
});

after(async () => {
  await browser?.close();
});

/** Clicks an element, and returns the file that the browser downloads and its name. */
async function download(page, selector) {
  const [file] = await Promise.all([page.waitForEvent("download"), page.click(selector)]);
  return { name: file.suggestedFilename(), bytes: readFileSync(await file.path()) };
}

/** Returns the size of a PNG. */
function size(bytes) {
  assert.equal(bytes.subarray(1, 4).toString(), "PNG");
  return [bytes.readUInt32BE(16), bytes.readUInt32BE(20)];
}

test("files have the scan that is shown", async () => {
  const page = await open(browser, device.view);
  await text(page, "#result-pixel", /^\d+ points$/);
  const cloud = await download(page, "#save-cloud");
  assert.equal(cloud.name, "cloud.ply");
  // The command line writes the same file.
  assert.equal(Buffer.compare(cloud.bytes, readFileSync(path.join(folder, "cloud.ply"))), 0);
  const arrays = await download(page, "#save-arrays");
  assert.equal(arrays.name, "scan.npz");
  const depth = readFileSync(path.join(folder, "depth.npy"));
  assert.ok(arrays.bytes.includes(depth) && arrays.bytes.includes("depth_sigma.npy"));
  const picture = await download(page, "#save-picture");
  assert.equal(picture.name, "cloud.png");
  const shown = await page.locator("#cloud").evaluate((canvas) => [canvas.width, canvas.height]);
  assert.deepEqual(size(picture.bytes), shown);
  assert.ok(picture.bytes.length > 5000, "it is not of one colour");
  await page.selectOption("#view-select", "depth");
  await text(page, "#legend-title", /^Depth/);
  assert.deepEqual(size((await download(page, "#save-picture")).bytes), [640, 480]);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("a link shows the same view to somebody who may only watch", async () => {
  const page = await open(browser, device.control, { permissions: ["clipboard-read", "clipboard-write"] });
  await page.selectOption("#view-select", "mask");
  await text(page, "#legend-title", /^Mask/);
  await page.click("#link");
  await text(page, "#link", /^Copied$/);
  const link = await page.evaluate(() => navigator.clipboard.readText());
  assert.equal(new URL(link).searchParams.get("token"), new URL(device.view).searchParams.get("token"));
  const other = await open(browser, link);
  await text(other, "#legend-title", /^Mask/);
  await text(other, "#role", /^watching/);
  assert.ok(await other.locator("#control").isHidden());
  const all = await seen(other, "#result-view");
  assert.ok(new Set(new Uint32Array(new Uint8Array(all.data).buffer)).size > 2);
  await other.context().close();
  await page.context().close();
});

test("nothing is saved without a token, nor of other scanners or names", async () => {
  const page = await open(browser, device.view);
  const token = new URL(device.view).searchParams.get("token");
  const status = (address) => page.evaluate(async (to) => (await fetch(to)).status, address);
  assert.equal(await status("/scans/0/cloud.ply"), 403);
  assert.equal(await status("/scans/0/cloud.ply?token=0"), 403);
  assert.equal(await status(`/scans/7/cloud.ply?token=${token}`), 404);
  assert.equal(await status(`/scans/0/passwd?token=${token}`), 404);
  assert.equal(await status(`/scans/x/cloud.ply?token=${token}`), 400);
  assert.equal(await status(`/scans/0/scan.npz?token=${token}`), 200);
  await page.context().close();
});
