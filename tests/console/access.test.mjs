// Who may see the page and who may control.

import assert from "node:assert/strict";
import http from "node:http";
import { after, before, test } from "node:test";
import { Client, launch, open, serve, text, until } from "./helpers.mjs";

let browser;
let device;
let client;

before(async () => {
  browser = await launch();
  device = await serve(["--profile", "webcam-grey", "--scene", "plane"]);
  client = new Client(device.runDir);
});

after(async () => {
  await browser?.close();
});

/** Returns status, headers and body of a request; the status is 101 if it opens a WebSocket. */
function request(path, headers = {}) {
  return new Promise((done, failed) => {
    const options = { host: "127.0.0.1", port: device.port, path, headers };
    const asked = http.request(options, (response) => {
      let body = "";
      response.on("data", (data) => { body += data; });
      response.on("end", () => done({ status: response.statusCode, headers: response.headers, body }));
    });
    asked.on("upgrade", (response, socket) => {
      socket.destroy();
      done({ status: 101, headers: response.headers });
    });
    asked.on("error", failed);
    asked.end();
  });
}

const UPGRADE = {
  Connection: "Upgrade",
  Upgrade: "websocket",
  "Sec-WebSocket-Version": "13",
  "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
};

async function cookieOf(url) {
  const { search } = new URL(url);
  const { status, headers } = await request(`/${search}`);
  assert.equal(status, 200);
  return headers["set-cookie"][0];
}

test("nothing is served without a token", async () => {
  const wrong = "0".repeat(32);
  for (const path of ["/", "/main.js", "/ws", "/nothing", `/?token=${wrong}`, "/?token=", "/../Cargo.toml"]) {
    const { status, headers, body } = await request(path);
    assert.equal(status, 403, path);
    assert.match(body, /^Open the address that the console has printed/);
    assert.equal(headers["set-cookie"], undefined);
  }
  const cookie = `phasmid-${device.port}=${wrong}`;
  assert.equal((await request("/", { cookie })).status, 403);
});

test("a token becomes a strict cookie, and serves the embedded files alone", async () => {
  for (const url of [device.view, device.control]) {
    const set = await cookieOf(url);
    assert.match(set, /^phasmid-\d+=[0-9a-f]{32}; Path=\/; HttpOnly; SameSite=Strict$/);
    const cookie = set.split(";")[0];
    const page = await request("/", { cookie });
    assert.equal(page.status, 200);
    assert.match(page.headers["content-security-policy"], /^default-src 'self'; frame-ancestors 'none';/);
    assert.equal(page.headers["x-content-type-options"], "nosniff");
    assert.equal(page.headers["referrer-policy"], "no-referrer");
    for (const path of ["/Cargo.toml", "/assets/main.js", "/%2e%2e%2fCargo.toml", "/..%2f..%2fetc%2fpasswd"]) {
      assert.equal((await request(path, { cookie })).status, 404, path);
    }
  }
  assert.notEqual(device.view, device.control);
});

test("another name for this machine is refused (DNS rebinding)", async () => {
  const cookie = (await cookieOf(device.control)).split(";")[0];
  const { search } = new URL(device.control);
  for (const host of ["evil.example", `evil.example:${device.port}`, "127.0.0.1", `127.0.0.1.evil.example:${device.port}`]) {
    assert.equal((await request("/", { cookie, host })).status, 421, host);
    assert.equal((await request(`/${search}`, { host })).status, 421, host);
    const origin = `http://${host}`;
    assert.equal((await request(`/ws${search}`, { ...UPGRADE, cookie, host, origin })).status, 421, host);
  }
});

test("a WebSocket needs the cookie, a token and the page's own origin", async () => {
  const cookie = (await cookieOf(device.control)).split(";")[0];
  const origin = `http://127.0.0.1:${device.port}`;
  for (const url of [device.view, device.control]) {
    const { search } = new URL(url);
    assert.equal((await request(`/ws${search}`, { ...UPGRADE, cookie, origin })).status, 101);
    assert.equal((await request(`/ws${search}`, { ...UPGRADE, origin })).status, 403);
    for (const foreign of ["http://evil.example", "null", `http://localhost:${device.port}`, undefined]) {
      const headers = { ...UPGRADE, cookie };
      if (foreign) {
        headers.origin = foreign;
      }
      assert.equal((await request(`/ws${search}`, headers)).status, 403, foreign);
    }
  }
  // The cookie alone, which browsers also send to other ports of this machine, opens nothing.
  const secret = cookie.split("=")[1];
  for (const path of ["/ws", "/ws?token=", `/ws?token=${secret}`]) {
    assert.equal((await request(path, { ...UPGRADE, cookie, origin })).status, 403, path);
  }
});

test("one viewer is in control at a time, and a viewer with the other token never", async () => {
  const watcher = await open(browser, device.view);
  await text(watcher, "#role", /^watching$/);
  const first = await open(browser, device.control);
  await text(first, "#role", /^in control$/);
  const second = await open(browser, device.control);
  await text(second, "#role", /^watching, another viewer is in control$/);
  await text(watcher, "#role", /^watching, another viewer is in control$/);
  assert.ok(await watcher.isHidden("#control"));
  await second.click("#control");
  await text(second, "#role", /^in control$/);
  await text(first, "#role", /^watching, another viewer is in control$/);
  await second.click("#control");
  await text(second, "#role", /^watching$/);
  await first.click("#control");
  await text(first, "#role", /^in control$/);
  await first.close();
  await text(second, "#role", /^watching$/);
  for (const page of [watcher, second]) {
    assert.deepEqual(page.errors, []);
    await page.context().close();
  }
});

test("a reload goes on without the token, which the address no longer has", async () => {
  const page = await open(browser, device.control);
  await text(page, "#frame", /Pattern/);
  assert.equal(page.url(), `http://127.0.0.1:${device.port}/`);
  await page.reload();
  await text(page, "#frame", /Pattern/);
  await text(page, "#role", /^in control$/);
  await page.goto(device.view);
  await text(page, "#role", /^watching$/);
  await page.context().close();
});

test("the page says when the console is lost and when it is another one", async () => {
  const lost = await serve(["--profile", "webcam-grey", "--scene", "plane"]);
  const page = await open(browser, lost.control);
  await text(page, "#connection", /^connected$/);
  await lost.kill();
  await text(page, "#connection", /^connection lost, trying again$/);
  const again = await until(() => serve(["--profile", "webcam-grey", "--scene", "plane"], { port: lost.port }).catch(() => null));
  await text(page, "#connection", /^console ended$/);
  await text(page, "#notice", /Open the address that it prints/);
  await page.goto(again.control);
  await text(page, "#connection", /^connected$/);
  await page.context().close();
});
