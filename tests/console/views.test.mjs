// What is shown of scans: maps, the cloud, profiles, and the projected pattern. The command line decodes the same
// scans; what is drawn must be what it writes.

import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import * as colours from "../../src/console/assets/colours.js";
import { along } from "../../src/console/assets/chart.js";
import { SCREENSHOTS, ask, command, launch, open, pixels, seen, serve, text, until } from "./helpers.mjs";

const [WIDTH, HEIGHT] = [640, 480];
const folder = mkdtempSync(path.join(tmpdir(), "views-"));
let browser;
let device;
/** What the command line said of the scan. */
let summary;

before(async () => {
  browser = await launch();
  device = await serve(["--profile", "webcam-grey", "--scene", "torso"]);
  summary = await scan("scan", ["--truth"]);
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

/** Scans with the command line, and returns what it says. */
function scan(name, options = [], from = device) {
  return command(["scan", "--run-dir", from.runDir, "--out", path.join(folder, name), ...options]);
}

/** Reads a map that the command line has written. */
function map(name, scanned = "scan") {
  const bytes = readFileSync(path.join(folder, scanned, name));
  const length = bytes.readUInt16LE(8);
  const head = bytes.subarray(10, 10 + length).toString();
  assert.match(head, /'descr': '<f4', 'fortran_order': False, 'shape': \(480, 640\)/);
  return new Float32Array(bytes.buffer.slice(bytes.byteOffset + 10 + length, bytes.byteOffset + bytes.length));
}

async function view(page, name) {
  await page.selectOption("#view-select", name);
}

/** Waits until a layer is drawn, and returns its colours. */
async function drawn(page, title) {
  await text(page, "#legend-title", new RegExp(`^${title}`));
  await until(async () => (await page.textContent("#result-notice")) === "");
  return new Uint32Array(new Uint8Array((await pixels(page, "#result-picture")).data).buffer);
}

/** Returns the colours that a layer's values have. */
function expected(layer, values) {
  const steps = new Uint16Array(values.length);
  colours.quantise(layer, values, colours.range(layer, values), steps);
  const table = colours.samples(layer);
  return Uint32Array.from(steps, (step) => table[step]);
}

function differing(a, b) {
  return a.reduce((count, value, i) => count + (value !== b[i]), 0);
}

/** Points at a pixel of the map, which fits, and returns what is said of it. */
async function at(page, x, y) {
  const box = await page.locator("#result-view").boundingBox();
  const scale = Math.min(box.width / WIDTH, box.height / HEIGHT);
  await page.mouse.move(
    box.x + box.width / 2 + (x + 0.5 - WIDTH / 2) * scale,
    box.y + box.height / 2 + (y + 0.5 - HEIGHT / 2) * scale,
  );
  const [, said] = await text(page, "#result-pixel", new RegExp(`^x ${x} px, y ${y} px: (.*)$`));
  return said;
}

test("the cloud of a scan appears, in colours, and can be turned", async () => {
  const page = await open(browser, device.control);
  const [, points] = await text(page, "#result-pixel", /^(\d+) points$/);
  assert.match(summary, new RegExp(`points +${points},`));
  const [, figure] = await text(page, "#figures", /Points(\d+) /);
  assert.equal(figure, points);
  const before = await seen(page, "#cloud");
  const found = new Set(new Uint32Array(new Uint8Array(before.data).buffer));
  assert.ok(found.size > 100, `${found.size} colours`);
  await page.screenshot({ path: `${SCREENSHOTS}/cloud.png` });
  const box = await page.locator("#result-view").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 120, box.y + box.height / 2 + 30, { steps: 4 });
  await page.mouse.up();
  const turned = await seen(page, "#cloud");
  assert.ok(Buffer.compare(before.data, turned.data) !== 0, "the cloud has turned");
  // Other colours for the same points.
  await page.selectOption("#colour-select", "error");
  await text(page, "#legend-title", /^Error of depth \(mm\)$/);
  const [, low] = await text(page, "#legend-low", /^(-[\d.]+)$/);
  assert.ok(Number(low) < 0 && Number(low) > -50, low);
  // The true surface has points where the scan has none.
  await page.selectOption("#colour-select", { label: "True surface" });
  await text(page, "#legend-title", /^True depth \(mm\)$/);
  const [, surface] = await text(page, "#result-pixel", /^(\d+) points/);
  assert.ok(Number(surface) > Number(points), `${surface} points, ${points} measured`);
  await page.selectOption("#colour-select", "error");
  await text(page, "#legend-title", /^Error of depth \(mm\)$/);
  await page.uncheck("#fields");
  const bare = await seen(page, "#cloud");
  assert.ok(Buffer.compare(turned.data, bare.data) !== 0, "the colours have changed");
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("each map is what the command line writes", async () => {
  const page = await open(browser, device.view);
  for (const [name, title, values, scale] of [
    ["depth", "Depth", map("depth.npy"), "linear"],
    ["projector_x", "Projector column", map("projector_x.npy"), "linear"],
    ["modulation", "Modulation", map("modulation.npy"), "linear"],
  ]) {
    await view(page, name);
    assert.equal(differing(await drawn(page, title), expected({ scale }, values)), 0, name);
  }
  await page.screenshot({ path: `${SCREENSHOTS}/modulation.png` });
  const x = map("projector_x.npy")[240 * WIDTH + 300];
  const [period] = [...readFileSync(path.join(folder, "scan/sequence.toml"), "utf8").matchAll(/period_px = ([\d.]+)/g)]
    .map(([, found]) => Number(found))
    .sort((a, b) => a - b);
  await view(page, "phase_x");
  await drawn(page, "Phase");
  const phase = parseFloat(await at(page, 300, 240));
  assert.ok(Math.abs(phase - 2 * Math.PI * ((x / period) % 1)) < 1e-3, `${phase} at column ${x}`);
  await view(page, "order_x");
  await drawn(page, "Fringe order");
  assert.equal(parseFloat(await at(page, 300, 240)), Math.floor(x / period));
  // The link keeps the view.
  await page.reload();
  await drawn(page, "Fringe order");
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("the mask says why pixels have no point, and counts them", async () => {
  const page = await open(browser, device.view);
  await view(page, "mask");
  const shown = await drawn(page, "Mask");
  const depth = map("depth.npy");
  const [valid] = colours.samples({ scale: "classes" });
  const missing = shown.reduce((count, colour, i) => count + ((colour === valid) === Number.isNaN(depth[i])), 0);
  assert.equal(missing, 0);
  for (const [, reason, percent] of summary.matchAll(/^ +(low modulation|mixed) +\d+ \(([\d.]+) %\)/gm)) {
    const said = await page.textContent("#legend-classes");
    const [, found] = new RegExp(`${reason} ([\\d.]+) %`).exec(said);
    assert.ok(Math.abs(Number(found) - Number(percent)) <= 0.051, `${reason}: ${found}, ${percent}`);
  }
  assert.equal(await at(page, 5, 5), "low modulation");
  await page.screenshot({ path: `${SCREENSHOTS}/mask.png` });
  await page.context().close();
});

test("the error is the depth minus the truth", async () => {
  const page = await open(browser, device.view);
  const values = [];
  for (const name of ["depth", "true_depth", "error"]) {
    await view(page, name);
    await drawn(page, { depth: "Depth", true_depth: "True depth", error: "Error of depth" }[name]);
    values.push(parseFloat(await at(page, 300, 240)));
  }
  const [depth, truth, error] = values;
  assert.ok(Math.abs(depth - truth - error) < 0.02 && error !== 0, String(values));
  assert.equal(Math.fround(depth).toPrecision(6), map("depth.npy")[240 * WIDTH + 300].toPrecision(6));
  await page.context().close();
});

test("a profile has the values along a line, which the mouse and the arrows move", async () => {
  const page = await open(browser, device.view, { viewport: { width: 1400, height: 900 } });
  await view(page, "depth");
  await drawn(page, "Depth");
  await page.click("#profile");
  await until(async () => (await page.locator("#profile-chart").isVisible()));
  const chart = async () => (await pixels(page, "#profile-chart")).data;
  const isDrawn = (data) => new Set(new Uint32Array(new Uint8Array(data).buffer)).size > 10;
  await until(async () => isDrawn(await chart()));
  await page.screenshot({ path: `${SCREENSHOTS}/profile.png` });
  const middle = await chart();
  await page.focus("#result-view");
  for (let i = 0; i < 40; i++) {
    await page.keyboard.press("ArrowDown");
  }
  const lower = await chart();
  assert.notEqual(Buffer.compare(middle, lower), 0);
  const ends = () => page.locator("#line-ends").evaluate((line) => ["x1", "y1", "x2", "y2"].map((name) => Number(line.getAttribute(name))));
  const [, y1, , y2] = await ends();
  assert.equal(y1, y2);
  const box = await page.locator("#result-view").boundingBox();
  await page.mouse.move(box.x + 100, box.y + 200);
  await page.mouse.down();
  await page.mouse.move(box.x + 300, box.y + 350, { steps: 3 });
  await page.mouse.up();
  const line = await ends();
  const half = Math.min(box.width / WIDTH, box.height / HEIGHT) / 2;
  [100, 200, 300, 350].forEach((want, i) => assert.ok(Math.abs(line[i] - want) <= half + 1, `${line}`));
  assert.notEqual(Buffer.compare(lower, await chart()), 0);
  await page.click("#profile");
  await until(async () => !(await page.locator("#profile-chart").isVisible()));
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("a line's pixels are those from end to end", () => {
  assert.deepEqual(along([2, 1], [5, 1], 10), [12, 13, 14, 15]);
  assert.deepEqual(along([1, 3], [1, 1], 10), [31, 21, 11]);
  assert.deepEqual(along([0, 0], [4, 2], 10), [0, 11, 12, 23, 24]);
  assert.deepEqual(along([4, 4], [4, 4], 10), [44]);
});

test("colours go up with the values, and mark what is missing", () => {
  const layer = { scale: "linear" };
  const steps = new Uint16Array(5);
  colours.quantise(layer, [NaN, -1, 0, 0.5, 9], [0, 1], steps);
  assert.deepEqual([...steps], [colours.STEPS, 0, 0, 512, colours.STEPS - 1]);
  assert.deepEqual(colours.range({ scale: "signed" }, [-3, 1, NaN]), [-3, 3]);
  assert.deepEqual(colours.range(layer, [NaN, NaN]), [0, 1]);
  assert.deepEqual(colours.range(layer, [7, 7]), [6.5, 7.5]);
});

test("the projected pattern is the one that the frame reports", async () => {
  const page = await open(browser, device.view);
  await view(page, "pattern");
  // The last frame of the scan; nothing has been exposed since.
  await text(page, "#result-pixel", /^Pattern 12 of 13: black$/);
  const black = await pixels(page, "#result-picture");
  assert.ok(black.data.every((value, i) => value === (i % 4 === 3 ? 255 : 0)));
  // The same patterns backwards end with fringes.
  const [head, ...frames] = readFileSync(path.join(folder, "scan/sequence.toml"), "utf8").split("[[frame]]");
  const backwards = [head, ...frames.reverse()].join("[[frame]]").replace(/^file = .*$/gm, "");
  const file = path.join(folder, "backwards.toml");
  writeFileSync(file, backwards);
  const other = await serve(["--profile", "webcam-grey", "--scene", "torso", "--sequence", file]);
  await scan("other", ["--sequence", "backwards"], other);
  const fringes = await open(browser, other.view);
  await view(fringes, "pattern");
  await text(fringes, "#result-pixel", /^Pattern 12 of 13: fringes along x, period 16.0000 px, phase 0.0 degrees$/);
  const { width, height, data } = await pixels(fringes, "#result-picture");
  assert.deepEqual([width, height], [854, 480]);
  for (const x of [0, 3, 8, 100, 853]) {
    const level = Math.floor(255 * (0.5 + 0.5 * Math.cos((2 * Math.PI * x) / 16)) + 0.5 + 1e-6);
    assert.deepEqual([data[4 * x], data[4 * (479 * width + x) + 1]], [level, level], `column ${x}`);
  }
  await fringes.screenshot({ path: `${SCREENSHOTS}/pattern.png` });
  await fringes.context().close();
  await page.context().close();
});

test("a scan with a lost frame shows nothing new, one with a wrong pattern says so, and the next is shown", async () => {
  const faulty = await serve(["--profile", "webcam-grey", "--scene", "sphere"]);
  const page = await open(browser, faulty.view);
  await text(page, "#result-notice", /^No scan yet/);
  await scan("first", [], faulty);
  const [, points] = await text(page, "#result-pixel", /^(\d+) points$/);
  assert.ok(Number(points) > 10_000);
  await view(page, "depth");
  const shows = async (scanned) => {
    const want = expected({ scale: "linear" }, map("depth.npy", scanned));
    await until(async () => differing(await drawn(page, "Depth"), want) === 0);
  };
  await shows("first");
  await ask(faulty, { fault: { what: "dropped", when: { nth: 4, every: 13 } } });
  await assert.rejects(scan("lost", [], faulty), /missing/);
  await shows("first");
  await ask(faulty, { clear_faults: "all" });
  await ask(faulty, { fault: { what: "wrong-pattern", when: { nth: 2, every: 13 } } });
  await assert.rejects(scan("wrong", [], faulty), /frames/);
  await text(page, "#result-notice", /do not follow the sequence/);
  await ask(faulty, { clear_faults: "all" });
  await scan("second", [], faulty);
  await shows("second");
  assert.deepEqual(page.errors, []);
  await page.context().close();
});
