// The page in headless Chromium: what is drawn, moved, cut, picked and measured. Runs `tessera` as people do;
// tools/viewer/test/run names it.
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
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

/** Of the area between the panel, legends and axes, pixels whose colour the test takes, and their middle. */
function pixels(image, takes) {
  let count = 0, x = 0, y = 0;
  for (let j = 0; j < image.height; ++j)
    for (let i = 240; i < image.width; ++i) {
      if (i > image.width - 260 && (j < 150 || j > image.height - 260)) continue;
      if (takes(image.at(i, j))) ++count, x += i, y += j;
    }
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
  assert.equal(await page.evaluate("tessera.times.frames"), 1, "frames without content hold up the tiles");
  assert.equal((await page.evaluate("tessera.state()")).tiles.visible, 4);
  await page.evaluate("tessera.dolly(14)");
  await shown(page);
  assert.equal((await page.evaluate("tessera.state()")).tiles.visible, 1, "from afar the root is enough");
  await page.evaluate("tessera.view('top')");
  const mark = pixels(await shown(page), red);
  close(await page.evaluate(`tessera.pick(${mark.x}, ${mark.y})`), truth(MARK), 0.5);

  await page.evaluate("tessera.setMove('walk')");
  const still = await shown(page), start = (await page.evaluate("tessera.state()")).camera;
  let end = start;
  const gone = () => Math.hypot(end[0] - start[0], end[1] - start[1]);
  for (let press = 0; press < 8 && gone() < 1.5; ++press) {  // a step a frame, and a busy machine draws few
    await page.key("w", "KeyW", 700);
    end = (await page.evaluate("tessera.state()")).camera;
  }
  const walked = await shown(page);
  assert.ok(gone() > 0.2, `${start} to ${end}`);
  assert.ok(changed(still, walked) > 2000);
  assert.deepEqual(page.errors, []);
  const origin = new URL(server.url).origin;
  assert.deepEqual(page.requests.filter((url) => !url.startsWith(origin) && !/^(data|blob):/.test(url)), []);
  await page.close();
  await server.stop();
});

test("tiles of points: drawn in their colours, picked", options, async () => {
  const { positions, colours } = ground([-SIZE / 2, -SIZE / 2], [SIZE / 2, SIZE / 2], 192);
  const scan = join(folder, "scan.ply"), site = join(folder, "points");
  writeFileSync(scan, ply({ positions, colours, synthetic: [], faces: [] }));
  const made = spawnSync(binary, ["tiles", scan, "-o", site, "--no-html", "--progress", "none"], { encoding: "utf8" });
  assert.equal(made.status, 0, made.stderr);
  const server = await serve(site);
  const page = await browser.open(server.url);
  const first = await shown(page);
  assert.ok(pixels(first, surface).count > 20000, "blank");
  assert.match(await page.evaluate("document.getElementById('counts').textContent"), /points shown, \d+ tiles/);
  await page.evaluate("tessera.view('top')");
  const mark = pixels(await shown(page), red);
  close(await page.evaluate(`tessera.pick(${mark.x}, ${mark.y})`), truth(MARK, [0, 0, 0]), 0.7);
  assert.deepEqual(page.errors, []);
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

// Three bands of a plate, each of one colour: dark, middle, bright.
const BANDS = [[24, 32, 16], [96, 128, 64], [200, 168, 216]];

function plate() {
  const positions = [], colours = [], faces = [];
  BANDS.forEach((colour, band) => {
    for (let j = 0; j <= 10; ++j)
      for (let i = 0; i <= 10; ++i) positions.push([10 * band + i, 2 * j, 0]), colours.push([...colour, 255]);
    for (let j = 0; j < 10; ++j)
      for (let i = 0; i < 10; ++i) {
        const a = 121 * band + 11 * j + i;
        faces.push([a, a + 1, a + 12], [a, a + 12, a + 11]);
      }
  });
  return { positions, colours, faces, synthetic: positions.map(() => 0) };
}

const mean = (all) => all[0].map((_, k) => all.reduce((sum, c) => sum + c[k], 0) / all.length);

/** What a page of ours shows of the bands, from above: the mean of what is drawn where a click hits them. */
async function bandsOfPage(page) {
  await page.until("window.tessera && tessera.times.settled !== null");
  await page.evaluate("tessera.view('top'); tessera.setColour('rgb')");
  const image = await shown(page), found = BANDS.map(() => []);
  const hits = await page.evaluate(`(() => {
    const out = [];
    for (let x = 250; x < ${image.width}; x += 11)
      for (let y = 60; y < ${image.height}; y += 23) out.push([x, y, tessera.pick(x, y)]);
    return out;
  })()`);
  for (const [x, y, at] of hits)
    if (at && Math.abs(at[0] % 10 - 5) < 4 && Math.abs(at[1] - 10) < 9) found[Math.floor(at[0] / 10)].push(image.at(x, y));
  assert.ok(found.every((all) => all.length > 20), `${found.map((all) => all.length)} hits`);
  return found.map(mean);
}

/** The bands of a picture in which the plate lies level, by the columns that are not as the corner is. */
function bandsOfPicture(image) {
  const ground = image.at(2, 2), y = image.height >> 1;
  const columns = [...Array(image.width).keys()].filter((x) => image.at(x, y).some((c, k) => Math.abs(c - ground[k]) > 3));
  const from = columns[0], wide = columns.at(-1) + 1 - from;
  return BANDS.map((_, band) => mean([...Array(21).keys()].map((i) => image.at(Math.floor(from + wide * (band + 0.3 + 0.02 * i) / 3), y))));
}

/** A page of three.js alone with a GLB in it, drawn without light. */
async function threePage(glb, html) {
  const { build } = await import("esbuild");
  const source = `import { Box3, MeshBasicMaterial, OrthographicCamera, Scene, Vector3, WebGLRenderer } from "three";
    import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
    const bytes = Uint8Array.from(atob(document.getElementById("glb").textContent), (c) => c.charCodeAt(0));
    new GLTFLoader().parse(bytes.buffer, "", ({ scene }) => {
      scene.traverse((o) => o.isMesh && (o.material = new MeshBasicMaterial({ vertexColors: true, side: 2 })));
      const all = new Scene().add(scene), box = new Box3().setFromObject(scene), size = box.getSize(new Vector3());
      // The plate is thin along the axis that is up.
      const up = size.y < size.z ? "y" : "z", camera = new OrthographicCamera(-0.6 * size.x, 0.6 * size.x, 0.4 * size.x, -0.4 * size.x, 0.1, 100);
      camera.position.copy(box.getCenter(new Vector3()));
      camera.up.set(0, up === "y" ? 0 : 1, up === "y" ? -1 : 0);
      const target = camera.position.clone();
      camera.position[up] += 10;
      camera.lookAt(target);
      const renderer = new WebGLRenderer({ canvas: document.querySelector("canvas"), preserveDrawingBuffer: true });
      renderer.setSize(600, 400);
      renderer.render(all, camera);
      window.drawn = true;
    }, (error) => console.error(error));`;
  const script = await build({ stdin: { contents: source, resolveDir: new URL("..", import.meta.url).pathname }, bundle: true, write: false, format: "iife" });
  writeFileSync(html, `<!DOCTYPE html><body style="margin:0"><canvas></canvas><script type="text/plain" id="glb">${readFileSync(glb).toString("base64")}</script>
    <script>${script.outputFiles[0].text.replaceAll("</script", "<\\/script")}</script>`);
  const page = await browser.open(`file://${html}`, { width: 600, height: 400 });
  await page.until("window.drawn");
  const image = picture(await page.screenshot());
  assert.deepEqual(page.errors, []);
  await page.close();
  return image;
}

function tessera(...words) {
  const run = spawnSync(binary, words, { encoding: "utf8" });
  assert.equal(run.status, 0, run.stderr);
}

test("dark, middle and bright colours are the same in a page, a site, a GLB elsewhere and a picture", options, async () => {
  const mesh = join(folder, "plate.ply"), at = (name) => join(folder, name);
  writeFileSync(mesh, ply(plate()));
  tessera("view", mesh, "-o", at("plate.html"), "--force");
  const own = await browser.open(`file://${at("plate.html")}`), ofMesh = await bandsOfPage(own);
  await own.close();

  tessera("tiles", mesh, "-o", at("plate-site"), "--no-html", "--progress", "none");
  const server = await serve(at("plate-site")), page = await browser.open(server.url), ofSite = await bandsOfPage(page);
  await page.close();
  await server.stop();
  BANDS.forEach((_, band) => close(ofSite[band], ofMesh[band], 2));

  // Another program shows the numbers that the scan has.
  tessera("convert", mesh, "-o", at("plate.glb"));
  const elsewhere = bandsOfPicture(await threePage(at("plate.glb"), at("three.html")));
  BANDS.forEach((colour, band) => close(elsewhere[band], colour, 1.5));

  // Light scales a colour alike, be it dark or bright; and the light of pictures is about that of pages.
  const lightOf = (bands, error) => {
    const light = bands[1].map((c, k) => c / BANDS[1][k]);
    bands.forEach((drawn, band) => close(drawn, BANDS[band].map((c, k) => c * light[k]), error));
    return light;
  };
  const light = lightOf(ofSite, 3);
  for (const [name, file] of [["mesh", mesh], ["GLB", at("plate.glb")]]) {
    const png = at(`${name}.png`);
    tessera("render", file, "-o", png, "--view", "top", "--size", "600x400", "--force");
    lightOf(bandsOfPicture(picture(readFileSync(png))), 10).forEach((c, k) =>
      assert.ok(c / light[k] > 0.75 && c / light[k] < 1.33, `${name}: ${c} in a picture, ${light[k]} in a page`));
  }
});

test("a wide site opens obliquely from above, fitted to the frame", options, async () => {
  for (const [name, stretch] of [["field", [30, 25]], ["road", [60, 3]]]) {
    const site = join(folder, name);
    await writeSite(site, { transform: [stretch[0], 0, 0, 0, 0, stretch[1], 0, 0, 0, 0, 1, 0, ...SHIFT, 1] });
    const server = await serve(site), page = await browser.open(server.url), image = await shown(page);
    const [x, y, z] = (await page.evaluate("tessera.state()")).camera, angle = Math.atan2(z, Math.hypot(x, y)) * 180 / Math.PI;
    assert.ok(angle > 30 && angle < 60, `${name} is seen from ${angle} degrees above`);
    let low = [Infinity, Infinity], high = [-1, -1];
    for (let j = 0; j < image.height; ++j)
      for (let i = 236; i < image.width; ++i)
        if (surface(image.at(i, j)) && j < image.height - 90) low = [Math.min(low[0], i), Math.min(low[1], j)], high = [Math.max(high[0], i), Math.max(high[1], j)];
    assert.ok(low[0] > 240 && high[0] < image.width - 4 && low[1] > 4, `${name} is cut off: ${low} to ${high}`);
    assert.ok(high[0] - low[0] > 0.8 * (image.width - 236), `${name} is small: ${low} to ${high}`);
    assert.ok(high[1] - low[1] > 0.3 * image.height, `${name} is a strip: ${low} to ${high}`);
    await page.close();
    await server.stop();
  }
});
