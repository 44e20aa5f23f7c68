// Scanning, the terminal, the emulated world and the traffic, as a viewer in control uses them.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { SCREENSHOTS, ask, launch, open, panel, pixels, seen, serve, text, until, watch } from "./helpers.mjs";

let browser;
let device;
/** A console that is itself the client of the device. */
let client;

before(async () => {
  browser = await launch();
  device = await serve(["--profile", "webcam-grey", "--scene", "sphere"]);
  client = await watch(["--run-dir", device.runDir]);
});

after(async () => {
  await browser?.close();
});

/** Returns the id of the frame that is shown. */
async function frame(page) {
  return Number((await text(page, "#frame-number", /^(\d+)$/))[1]);
}

test("a scan is started on the page, once and again and again, and stopped", async () => {
  const page = await open(browser, client.control);
  await text(page, "#frame-pattern", /^none, free-running$/);
  await text(page, "#result-notice", /^No scan yet/);
  await panel(page, "scan");
  await page.click("#scan-once");
  await text(page, "#result-pixel", /^\d+ points$/);
  await text(page, "#figures", /Sequencequick-4Frames13/);
  // The camera runs free again.
  await text(page, "#frame-pattern", /^none, free-running$/);
  await page.fill("#sequence", "quick-4-xy");
  await page.click("#scan-repeat");
  await text(page, "#figures", /Sequencequick-4-xy/);
  await page.selectOption("#view-select", "projector_y");
  await text(page, "#legend-title", /^Projector row/);
  await page.screenshot({ path: `${SCREENSHOTS}/scan.png` });
  const first = await pixels(page, "#result-picture");
  await until(async () => Buffer.compare(first.data, (await pixels(page, "#result-picture")).data) !== 0);
  await page.click("#scan-stop");
  await until(async () => (await page.textContent("#scan-status")) === "");
  await text(page, "#frame-pattern", /^none, free-running$/);
  await page.fill("#sequence", "no-such");
  await page.click("#scan-once");
  await text(page, "#scan-status", /no-such/);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("the terminal talks to the device, with history and completion", async () => {
  const page = await open(browser, client.control);
  await panel(page, "terminal");
  const send = async (line) => {
    await page.fill("#line-input", line);
    await page.press("#line-input", "Enter");
  };
  await send("*IDN?");
  await text(page, "#terminal-log", /> \*IDN\?Phasmid,webcam-grey,.* \d+ ms/);
  await send("CAM:EXP 0.005");
  await text(page, "#terminal-log", /> CAM:EXP 0.005no reply/);
  await text(page, "#frame-exposure", /^5\.000 ms$/);
  await send("CAM:EXP?");
  await text(page, "#terminal-log", /> CAM:EXP\?0\.005/);
  await send("NONSENSE");
  await send("SYST:ERR?");
  await text(page, "#terminal-log", /-113,"Undefined header/);
  await page.press("#line-input", "ArrowUp");
  await page.press("#line-input", "ArrowUp");
  assert.equal(await page.inputValue("#line-input"), "NONSENSE");
  const options = await page.$$eval("#lines option", (all) => all.map((option) => option.value));
  for (const line of ["CAM:EXP?", "CAMera:EXPosure?", "SEQuence:SELect", "*IDN?", "TRIGger"]) {
    assert.ok(options.includes(line), `${line} of ${options}`);
  }
  await page.screenshot({ path: `${SCREENSHOTS}/terminal.png` });
  await send("CAM:EXP DEF");
  await page.context().close();
});

test("an object that is moved on the page moves in the picture", async () => {
  const page = await open(browser, device.control);
  await panel(page, "scene");
  await text(page, "#objects", /sphere/);
  const { scene } = await ask(device, { get: "objects" });
  const index = scene.objects.findIndex(({ shape }) => shape === "sphere");
  await page.selectOption("#object", String(index));
  const x = scene.objects[index].position_mm[0];
  assert.equal(Number(await page.inputValue("#position-x")), x);
  const before = await seen(page, "#picture");
  await page.fill("#position-x", String(x + 60));
  await page.click("#place-form button");
  await text(page, "#objects", new RegExp(`sphere.*${(x + 60).toFixed(1)}, `));
  const moved = (await ask(device, { get: "objects" })).scene.objects[index];
  assert.equal(moved.position_mm[0], x + 60);
  await until(async () => {
    const { data } = await seen(page, "#picture");
    let differing = 0;
    for (let i = 0; i < data.length; i += 4) {
      differing += Math.abs(data[i] - before.data[i]) > 30;
    }
    return differing > 500;
  });
  await page.fill("#position-x", "1e99");
  await page.click("#place-form button");
  await text(page, "#panel-error", /position_mm|expected/);
  await page.screenshot({ path: `${SCREENSHOTS}/scene.png` });
  await page.context().close();
});

test("a fault that is injected on the page is listed, and the host reacts", async () => {
  const page = await open(browser, client.control);
  await panel(page, "faults");
  await page.selectOption("#fault-what", "dropped");
  await page.fill("#fault-nth", "5");
  await page.click("#fault-form button:not([type])");
  await text(page, "#faults-standing", /dropped.*"nth":5.*0 of 1 times/);
  await panel(page, "scan");
  // A fast second run replaces the status before a poll sees it.
  await page.evaluate(() => {
    const status = document.querySelector("#scan-status");
    globalThis.said = [];
    const note = () => globalThis.said.push(status.textContent);
    new MutationObserver(note).observe(status, { childList: true, characterData: true, subtree: true });
  });
  await page.click("#scan-once");
  const said = () => page.evaluate(() => globalThis.said.join("\n"));
  await until(async () => /scanning again: pattern 4 is missing/.test(await said()));
  await text(page, "#result-pixel", /^\d+ points$/);
  await panel(page, "faults");
  await text(page, "#faults-struck", /dropped/);
  await page.screenshot({ path: `${SCREENSHOTS}/faults.png` });
  await page.click("#faults-clear");
  await text(page, "#faults-standing", /none/);
  await page.context().close();
});

test("traffic is shown with its latencies, and can be held", async () => {
  const page = await open(browser, device.view);
  await panel(page, "traffic");
  const operator = await open(browser, client.control);
  await panel(operator, "scan");
  await operator.click("#scan-once");
  await text(page, "#traffic-rows", /sent.*TRG/);
  await text(page, "#traffic-rows", /received.*[\d.]+ ms after the command/);
  await text(page, "#traffic-rows", /frame \d+, pattern 12[\d.]+ ms after the exposure/);
  const drawn = await pixels(page, "#traffic-line");
  assert.ok(new Set(new Uint32Array(new Uint8Array(drawn.data).buffer)).size > 4);
  await page.selectOption("#traffic-seconds", "10");
  await page.screenshot({ path: `${SCREENSHOTS}/traffic.png` });
  await page.check("#traffic-free");
  await page.click("#traffic-pause");
  const held = await page.textContent("#traffic-rows");
  const at = await frame(page);
  await until(async () => (await frame(page)) > at + 3);
  assert.equal(await page.textContent("#traffic-rows"), held);
  assert.deepEqual(page.errors, []);
  await page.context().close();
  await operator.context().close();
});

test("stepped time advances by what the page says", async () => {
  const stepped = await serve(["--profile", "webcam-grey", "--scene", "plane", "--clock", "stepped"]);
  const page = await open(browser, stepped.control);
  await panel(page, "clock");
  await text(page, "#clock-rows", /Clockstepped/);
  const { clock } = await ask(stepped, { get: "clock" });
  await page.fill("#step-ms", "12.5");
  await page.click("#clock-step");
  await until(async () => (await ask(stepped, { get: "clock" })).clock.now_ns === clock.now_ns + 12_500_000);
  await text(page, "#clock-rows", new RegExp(`Device time${((clock.now_ns + 12_500_000) * 1e-9).toFixed(6)} s`));
  await page.click("#trigger");
  await page.fill("#step-ms", "1e12");
  await page.click("#clock-step");
  await text(page, "#panel-error", /clock/);
  // It goes on in real time, and pauses again.
  await page.click('#clock-pace button[value="real"]');
  await text(page, "#clock-rows", /Clockreal/);
  const began = (await ask(stepped, { get: "clock" })).clock.now_ns;
  await until(async () => (await ask(stepped, { get: "clock" })).clock.now_ns > began + 100_000_000);
  assert.ok(await page.isDisabled("#clock-step"));
  await page.click('#clock-pace button[value="stepped"]');
  await text(page, "#clock-rows", /Clockstepped/);
  const paused = (await ask(stepped, { get: "clock" })).clock.now_ns;
  await page.fill("#step-ms", "2");
  await page.click("#clock-step");
  await until(async () => (await ask(stepped, { get: "clock" })).clock.now_ns === paused + 2_000_000);
  assert.deepEqual(page.errors, []);
  await page.context().close();
});

test("a viewer that is not in control changes nothing", async () => {
  const page = await open(browser, device.view);
  await panel(page, "scene");
  await text(page, "#objects", /sphere/);
  assert.ok(await page.locator("#place-form fieldset").evaluate((fields) => fields.disabled));
  // A page that asks all the same.
  const { scene } = await ask(device, { get: "objects" });
  const [{ position_mm: position, rotation_deg: rotation }] = scene.objects;
  await page.locator("#place-form fieldset").evaluate((fields) => { fields.disabled = false; });
  await page.fill("#position-x", String(position[0] + 5));
  await page.evaluate(() => document.querySelector("#place-form").requestSubmit());
  await text(page, "#panel-error", /^take control first$/);
  const after = (await ask(device, { get: "objects" })).scene.objects[0];
  assert.deepEqual([after.position_mm, after.rotation_deg], [position, rotation]);
  await page.context().close();
});
