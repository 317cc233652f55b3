// The page in headless Chromium: what is drawn, moved, cut, picked and measured. Runs `tessera` as people do;
// tools/viewer/test/run names it.
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { localToGeocentric, multiply } from "../src/frame.js";
import { Browser, chromiumPath, picture } from "./chromium.js";
import { MARK, SIZE, ground, height, ply, writeSite } from "./sites.js";

const binary = process.env.TESSERA_BINARY, bundle = new URL("../../../build/viewer/viewer.html", import.meta.url).pathname;
const lacking = !binary || !existsSync(binary) ? "no tessera (TESSERA_BINARY)"
  : !existsSync(bundle) ? "no bundle (tools/viewer/build)" : !chromiumPath() ? "no chromium" : false;
const options = { skip: lacking && `SKIPPED: ${lacking}`, timeout: 120000 };

const SHIFT = [500000, 5400000, 250], EARTH = [3771793.968, 140253.342, 5124304.349];
const servers = new Set();
let folder, browser;

before(() => {
  if (lacking) return;
  folder = mkdtempSync(join(tmpdir(), "viewer-test-"));
  browser = new Browser();
});
after(async () => {
  if (lacking) return;
  for (const child of servers) child.kill("SIGKILL");
  await browser.close();
  rmSync(folder, { recursive: true, force: true });
});

async function serve(...words) {
  const child = spawn(binary, ["view", ...words], { stdio: ["ignore", "pipe", "ignore"] });
  servers.add(child);
  child.once("exit", () => servers.delete(child));
  const url = await new Promise((done, fail) => {
    child.stdout.once("data", (text) => done(String(text).trim()));
    child.once("exit", (code) => fail(new Error(`tessera view ended with ${code}`)));
  });
  return { url, stop: () => new Promise((done) => (child.once("exit", done), child.kill("SIGTERM"))) };
}

async function shown(page) {
  await page.until("window.tessera && tessera.times.settled !== null");
  await page.settled();
  return picture(await page.screenshot());
}

async function meshPage(name, words = []) {
  const mesh = join(folder, `${name}.ply`), html = join(folder, `${name}.html`);
  writeFileSync(mesh, ply(ground([-SIZE / 2, -SIZE / 2], [SIZE / 2, SIZE / 2], 96), SHIFT));
  const made = spawnSync(binary, ["view", mesh, "-o", html, "--force", ...words], { encoding: "utf8" });
  assert.equal(made.status, 0, made.stderr);
  return browser.open(`file://${html}`);
}

/** Of the area beside the panel, pixels whose colour the test takes, and their middle. */
function pixels(image, takes) {
  let count = 0, x = 0, y = 0;
  for (let j = 0; j < image.height; ++j)
    for (let i = 260; i < image.width - 260; ++i)
      if (takes(image.at(i, j))) ++count, x += i, y += j;
  return { count, x: x / count, y: y / count };
}
const red = ([r, g, b]) => r > 120 && g < 60 && b < 60;
const surface = ([r, g, b]) => Math.max(r, g, b) - Math.min(r, g, b) > 22;  // the ground is green, the sky is grey
const changed = (a, b) => {
  let count = 0;
  for (let j = 0; j < a.height; j += 2)
    for (let i = 260; i < a.width - 260; i += 2)
      if (a.at(i, j).some((c, k) => Math.abs(c - b.at(i, j)[k]) > 16)) ++count;
  return count * 4;
};
const close = (a, b, error) =>
  assert.ok(a.every((c, i) => Math.abs(c - b[i]) <= error), `${a} is farther than ${error} from ${b}`);
const truth = ([x, y], shift = SHIFT) => [x + shift[0], y + shift[1], height(x, y) + shift[2]];

test("a mesh in one file: drawn, turned, nothing asked of the network", options, async () => {
  const page = await meshPage("mesh");
  const first = await shown(page);
  assert.ok(pixels(first, surface).count > 60000, "blank");
  await page.drag(600, 400, 760, 440);
  const turned = picture((await page.settled(), await page.screenshot()));
  assert.ok(changed(first, turned) > 20000, "dragging moved nothing");
  await page.mouse("mouseWheel", 600, 400, { deltaX: 0, deltaY: -400 });
  const nearer = picture((await page.settled(), await page.screenshot()));
  assert.ok(changed(turned, nearer) > 20000, "the wheel did nothing");
  assert.deepEqual(page.errors, []);
  assert.deepEqual(page.requests.filter((url) => !url.startsWith("file:") && !url.startsWith("data:")), []);
  assert.equal(page.requests.filter((url) => url.startsWith("file:")).length, 1);
  await page.close();
});

test("picking and measuring give the coordinates of the scan", options, async () => {
  const page = await meshPage("picked");
  await page.until("window.tessera && tessera.times.settled !== null");
  await page.evaluate("tessera.view('top')");
  const image = await shown(page);
  const mark = pixels(image, red);
  assert.ok(mark.count > 100, `${mark.count} red pixels`);
  const point = await page.evaluate(`tessera.pick(${mark.x}, ${mark.y})`);
  close(point, truth(MARK), 0.35);
  const [x, y] = [point[0] - SHIFT[0], point[1] - SHIFT[1]];
  assert.ok(Math.abs(point[2] - SHIFT[2] - height(x, y)) < 0.01, `${point} is not on the ground`);

  // Two clicks as a person does them.
  await page.evaluate("document.querySelector('[data-tool=distance]').click()");
  await page.click(mark.x, mark.y);
  await page.click(mark.x - 150, mark.y + 60);
  await page.key("Escape", "Escape", 20);
  const [chain] = await page.evaluate("tessera.measurements()");
  assert.equal(chain.points.length, 2);
  close(chain.points[0], point, 0.2);
  const apart = Math.hypot(...chain.points[0].map((c, i) => c - chain.points[1][i]));
  const text = await page.evaluate("document.getElementById('list').textContent");
  assert.ok(text.includes(apart.toFixed(3).slice(0, -1)), `${apart} is not in ${text}`);
  // A hundred and sixty pixels by the scale bar, which holds for the middle of the scene.
  const bar = await page.evaluate("[document.querySelector('#scale i').offsetWidth, parseFloat(document.querySelector('#scale span').textContent)]");
  const expected = Math.hypot(150, 60) * bar[1] / bar[0], level = Math.hypot(chain.points[0][0] - chain.points[1][0], chain.points[0][1] - chain.points[1][1]);
  assert.ok(Math.abs(level / expected - 1) < 0.1, `${level} by pixels ${expected}`);
  await page.close();
});

test("a section hides what lies before it, from picks too; colours follow the attribute", options, async () => {
  const page = await meshPage("cut");
  const all = await shown(page);
  assert.equal((await page.evaluate("tessera.state().colours")).join(), "rgb,synthetic");
  await page.evaluate("tessera.setColour('rgb'); tessera.view('top')");
  const top = pixels(picture((await page.settled(), await page.screenshot())), surface);
  const mark = pixels(picture(await page.screenshot()), red);
  await page.evaluate("tessera.setSection('x'); tessera.setCut(0.5)");
  await page.settled();
  const cut = picture(await page.screenshot()), half = pixels(cut, surface);
  assert.ok(half.count > 0.4 * top.count && half.count < 0.6 * top.count, `${half.count} of ${top.count}`);
  assert.equal(pixels(cut, red).count, 0, "the mark lies on the hidden side");
  assert.equal(await page.evaluate(`tessera.pick(${mark.x}, ${mark.y})`), null);
  await page.evaluate("tessera.setCut(0.5, true)");
  await page.settled();
  assert.ok(pixels(picture(await page.screenshot()), red).count > 0.9 * mark.count, "flipped, it is there");
  close(await page.evaluate(`tessera.pick(${mark.x}, ${mark.y})`), truth(MARK), 0.35);
  await page.evaluate("tessera.setSection('off'); tessera.setColour('synthetic')");
  await page.settled();
  const blue = pixels(picture(await page.screenshot()), ([r, , b]) => b > r + 60);
  const share = blue.count / top.count, area = Math.PI * 16 / SIZE ** 2;
  assert.ok(share > 0.7 * area && share < 1.4 * area, `${share} of the ground is blue, not ${area}`);
  await page.evaluate("tessera.setColour('height')");
  await page.settled();
  assert.ok(changed(all, picture(await page.screenshot())) > 20000);
  assert.ok(await page.evaluate("!document.getElementById('legend').hidden && document.querySelectorAll('#legend text').length >= 2"));
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("distances to another mesh: coloured inside of faces, with a legend", options, async () => {
  // Four corners on the ground, which bulges between them.
  const flat = ground([-SIZE / 2, -SIZE / 2], [SIZE / 2, SIZE / 2], 1), mesh = join(folder, "flat.ply"), html = join(folder, "flat.html");
  const truth = join(folder, "truth.ply");
  writeFileSync(mesh, ply(flat, SHIFT));
  writeFileSync(truth, ply(ground([-SIZE / 2, -SIZE / 2], [SIZE / 2, SIZE / 2], 96), SHIFT));
  const made = spawnSync(binary, ["view", mesh, "-o", html, "--deviation", truth, "--signed"], { encoding: "utf8" });
  assert.equal(made.status, 0, made.stderr);
  const page = await browser.open(`file://${html}`);
  await shown(page);
  await page.evaluate("tessera.view('top')");
  const image = await shown(page);
  assert.equal((await page.evaluate("tessera.state().mode")), "deviation");
  const above = pixels(image, ([r, , b]) => r > b + 40), below = pixels(image, ([r, , b]) => b > r + 40);
  assert.ok(above.count > 5000 && below.count > 5000, `${above.count} above, ${below.count} below`);
  assert.match(await page.evaluate("document.getElementById('legend').textContent"), /^deviation, ±[0-9.]+.*beyond$/);
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("tiles: served, levels by distance, walking, coordinates through the root's transform", options, async () => {
  const site = join(folder, "site");
  await writeSite(site, { transform: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...SHIFT, 1] });
  const server = await serve(site);
  const page = await browser.open(server.url);
  const first = await shown(page);
  assert.ok(pixels(first, surface).count > 60000, "blank");
  assert.equal((await page.evaluate("tessera.state()")).tiles.visible, 4);
  await page.evaluate("tessera.dolly(14)");
  await shown(page);
  assert.equal((await page.evaluate("tessera.state()")).tiles.visible, 1, "from afar the root is enough");
  await page.evaluate("tessera.view('top')");
  const mark = pixels(await shown(page), red);
  close(await page.evaluate(`tessera.pick(${mark.x}, ${mark.y})`), truth(MARK), 0.5);

  await page.evaluate("tessera.setMove('walk')");
  const still = await shown(page), start = (await page.evaluate("tessera.state()")).camera;
  await page.key("w", "KeyW", 700);
  const walked = await shown(page), end = (await page.evaluate("tessera.state()")).camera;
  assert.ok(Math.hypot(end[0] - start[0], end[1] - start[1]) > 0.2, `${start} to ${end}`);
  assert.ok(changed(still, walked) > 2000);
  assert.deepEqual(page.errors, []);
  const origin = new URL(server.url).origin;
  assert.deepEqual(page.requests.filter((url) => !url.startsWith(origin) && !/^(data|blob):/.test(url)), []);
  await page.close();
  await server.stop();
});

test("tiles on earth stand upright, and measure in the scan's coordinates", options, async () => {
  const site = join(folder, "earth");
  // A scan in feet, its origin shifted.
  const feet = [0.3048, 0, 0, 0, 0, 0.3048, 0, 0, 0, 0, 0.3048, 0, 0, 0, 0, 1];
  await writeSite(site, { transform: multiply(localToGeocentric(EARTH), feet), extras: { shift: SHIFT } });
  const server = await serve(site);
  const page = await browser.open(server.url);
  const first = await shown(page);
  const ground = pixels(first, surface);
  assert.ok(ground.count > 60000, "blank");
  await page.evaluate("tessera.view('front')");
  const front = pixels(await shown(page), surface);
  assert.ok(front.count < 0.6 * ground.count, "seen level, the ground is low");
  await page.evaluate("tessera.view('top')");
  const mark = pixels(await shown(page), red);
  close(await page.evaluate(`tessera.pick(${mark.x}, ${mark.y})`), truth(MARK), 0.5);
  await page.evaluate("document.querySelector('[data-tool=point]').click()");
  await page.click(mark.x, mark.y);
  const text = await page.evaluate("document.getElementById('list').textContent");
  const latitude = Number(/latitude(\d+\.\d+)/.exec(text)[1]), metres = (latitude - 53.80939444) * 111300;
  assert.ok(Math.abs(metres - MARK[1] * 0.3048) < 0.3, `${metres} m north of the origin`);
  assert.deepEqual(page.errors, []);
  await page.close();
  await server.stop();
});

test("a tile that is missing is told, the rest is shown", options, async () => {
  const site = join(folder, "torn");
  await writeSite(site);
  rmSync(join(site, "tiles/1-11.glb"));
  const server = await serve(site);
  const page = await browser.open(server.url);
  await page.until("window.tessera && tessera.state().trouble !== '' && tessera.times.settled !== null");
  await page.settled();
  assert.match(await page.evaluate("tessera.state().trouble"), /1-11\.glb/);
  assert.ok(pixels(picture(await page.screenshot()), surface).count > 20000);
  await page.close();
  await server.stop();
});
