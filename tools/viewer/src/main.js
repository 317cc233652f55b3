// The page of `tessera view`: opens what the page was made for, and wires the panel to it.
import { Box3, Matrix4, Sphere, Vector3 } from "three";
import { numberText } from "./colours.js";
import { apply, geocentricFrame, geodetic, isGeocentric, localFrame } from "./frame.js";
import { look, MODES } from "./material.js";
import { positionStep } from "./measure.js";
import { loadMesh } from "./mesh_source.js";
import { Navigation } from "./navigation.js";
import { drawAxes, drawLegend, drawMeasurements, drawScaleBar, scanAxes } from "./overlay.js";
import { oblique, scaleBar, unitsPerPixel } from "./scale.js";
import { extent, levelDirection, sectionPlane } from "./section.js";
import { Stage } from "./stage.js";
import { openTiles } from "./tiles_source.js";
import { Tools } from "./tools.js";

const element = (id) => document.getElementById(id);
const config = JSON.parse(element("tessera-view").textContent);
const times = { start: performance.now(), picture: null, frames: null, settled: null };  // frames: drawn until the picture
const COLOURS = [["plain", "Plain"], ["rgb", "RGB"], ["height", "Height"], ["deviation", "Deviation"],
                 ["synthetic", "Synthetic"], ["uncertain", "Uncertain"]];
const HINTS = {
  orbit: "drag turns · right drag moves · wheel comes closer · double click looks at a place",
  walk: "W A S D walk · Q E down and up · drag looks about · wheel sets the pace · Shift runs",
  point: "click a place for its coordinates · P ends",
  distance: "click from place to place · Esc ends a chain · M ends measuring",
};

function trouble(text) {
  const box = element("trouble");
  box.hidden = false;
  if (!box.textContent.includes(text)) box.textContent += (box.textContent ? "\n" : "") + text;
}

const scan = {
  frame: localFrame([0, 0, 0]), step: 0.001, up: [0, 0, 1], box: new Box3(),
  /** Beside the coordinates of a picked point. */
  more(hit) {
    const rows = [];
    if (this.frame.toGeocentric) {
      const g = geodetic(apply(this.frame.toGeocentric, hit.point.toArray()));
      rows.push(["latitude", g.latitude.toFixed(7)], ["longitude", g.longitude.toFixed(7)], ["height (ell.)", g.height.toFixed(2)]);
    }
    const error = hit.object.userData.tile?.geometricError * this.frame.unit;
    if (error > 0) rows.push(["of a level within", numberText(error, positionStep(error) * 1e4)]);
    return rows;
  },
};

let stage, navigation, tools, tiles = null, contentColours = new Set(), mode = null, section = "off", flipped = false,
  cut = 0.5, cutDirection = null, sceneBox = { low: [-1, -1, -1], high: [1, 1, 1] },
  outline = [[0, 0, 0]];  // points of the scene that views fit into the picture

/** Puts content into the scene: its frame follows from where it is, and which way is up. */
function place(source, up) {
  scan.frame = source.frame(up);
  const group = source.object, matrix = new Matrix4().fromArray(scan.frame.fromContent);
  matrix.decompose(group.position, group.quaternion, group.scale);
  group.updateMatrixWorld(true);
  const box = scan.box = source.sceneBox(matrix);
  outline = source.outline(matrix);
  box.getBoundingSphere(stage.ball);
  sceneBox = { low: box.min.toArray(), high: box.max.toArray() };
  look.heights.value = { x: box.min.z, y: box.max.z };
  const scanUp = apply(scan.frame.toScan, [0, 0, 1]).map((c, i) => c - apply(scan.frame.toScan, [0, 0, 0])[i]);
  scan.up = scanUp.map((c) => c / Math.hypot(...scanUp));
  setStep = () => (scan.step = positionStep(2 * stage.ball.radius * scan.frame.unit, (source.quantum?.() ?? 0) * scan.frame.unit));
  setStep();
  axes = scanAxes(scan.frame.toScan);
  updateSection();
}
let axes = [], setStep = null;

const VIEWS = { top: [0, -1e-4, 1], front: [0, -1, 0], right: [1, 0, 0] };

function view(name) {
  navigation.walk(false);
  pressMove();
  const from = VIEWS[name] ?? oblique(sceneBox.low, sceneBox.high);
  navigation.frame(outline, from, stage.size.x - stage.covered);
}

function pressMove() {
  for (const button of document.querySelectorAll("[data-move]"))
    button.setAttribute("aria-pressed", (button.dataset.move === "walk") === navigation.walking);
  hint();
}

const hint = () => (element("hint").textContent = HINTS[tools?.tool ?? (navigation.walking ? "walk" : "orbit")]);

function setMove(name) {
  const radius = stage.ball.radius, eye = Math.min(1.7, radius / 20);
  navigation.walk(name === "walk", eye, 1.5 * eye);
  pressMove();
  stage.canvas.focus();
}

function setColour(name) {
  mode = name;
  look.mode.value = MODES[name];
  for (const button of element("colour-buttons").children) button.setAttribute("aria-pressed", button.dataset.colour === name);
  drawLegend(element("legend"), legend());
  stage.changed();
}

function legend() {
  if (mode === "height") {
    const at = (z) => scan.frame.kind === "geocentric"
      ? geodetic(apply(scan.frame.toGeocentric, [0, 0, z])).height
      : apply(scan.frame.toScan, [0, 0, z]).reduce((sum, c, i) => sum + c * scan.up[i], 0);
    const { x, y } = look.heights.value;
    return { title: "height", low: at(x), high: at(y), kind: "height" };
  }
  if (mode === "deviation") {
    const high = look.scaleEnd.value, signed = look.signedScale.value;
    return { title: `${signed ? "deviation, \u00b1" : "distance, up to "}${Number(high.toPrecision(3))}`, low: signed ? -high : 0, high, kind: signed ? "deviation" : "distance" };
  }
  if (mode === "synthetic") return { title: "origin", marked: mode, text: "closes a hole" };
  if (mode === "uncertain") return { title: "side", marked: mode, text: "in doubt" };
  return null;
}

function offerColours(names) {
  for (const name of names) contentColours.add(name);
  const offered = COLOURS.filter(([name]) => ["plain", "height"].includes(name) || contentColours.has(name));
  if (element("colour-buttons").children.length === offered.length) return;
  element("colour-buttons").replaceChildren(...offered.map(([name, text]) => {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: text });
    button.dataset.colour = name;
    button.addEventListener("click", () => (chosen = true, setColour(name)));
    return button;
  }));
  const first = ["deviation", "uncertain", "rgb", "plain"].find((name) => name === "plain" || contentColours.has(name));
  setColour(chosen && mode ? mode : first);
}
let chosen = false;

function setSection(kind) {
  section = kind;
  cutDirection = kind === "view" ? levelDirection(navigation.direction().toArray(), [0, 0, 1]) : null;
  for (const button of document.querySelectorAll("[data-section]"))
    button.setAttribute("aria-pressed", button.dataset.section === kind);
  element("section-row").hidden = kind === "off";
  updateSection();
}

/** The axis named is one of the scan. */
const sectionAxis = () => cutDirection ?? axes["xyz".indexOf(section)].direction.toArray();

function updateSection() {
  if (section === "off") stage.plane = null;
  else {
    const axis = sectionAxis();
    stage.plane = sectionPlane(axis, cut, sceneBox, flipped);
    const [from, to] = extent(axis, sceneBox), along = axis.map((c) => c * (from + cut * (to - from)));
    const at = apply(scan.frame.toScan, along), i = "xyz".indexOf(section);
    element("cut-at").textContent = i < 0 || scan.frame.kind === "geocentric" ? "" : numberText(at[i], scan.step * 1e3);
  }
  stage.changed();
}

function wire() {
  const on = (id, event, call) => element(id).addEventListener(event, call);
  for (const button of document.querySelectorAll("[data-move]")) button.addEventListener("click", () => setMove(button.dataset.move));
  for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => view(button.dataset.view));
  for (const button of document.querySelectorAll("[data-tool]"))
    button.addEventListener("click", () => (tools.use(button.dataset.tool), hint()));
  for (const button of document.querySelectorAll("[data-section]")) button.addEventListener("click", () => setSection(button.dataset.section));
  const flip = () => {
    flipped = !flipped;
    element("flip").setAttribute("aria-pressed", flipped);
    updateSection();
  };
  on("flip", "click", flip);
  on("home", "click", () => view("iso"));
  on("cut", "input", (e) => (cut = Number(e.target.value), updateSection()));
  on("backs", "change", (e) => (look.backs.value = e.target.checked, stage.changed()));
  stage.canvas.addEventListener("dblclick", (e) => {
    if (tools.tool) return void tools.finish();
    const hit = navigation.walking ? null : stage.pick(e.offsetX, e.offsetY);
    if (hit) navigation.centre(hit.point);
  });
  const keys = { "1": () => setMove("orbit"), "2": () => setMove("walk"), h: () => view("iso"), f: flip,
                 p: () => (tools.use("point"), hint()), m: () => (tools.use("distance"), hint()),
                 Escape: () => tools.finish() || (tools.tool && (tools.use(tools.tool), hint())) };
  window.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || /^(INPUT|SELECT)$/.test(e.target.tagName)) return;
    keys[e.key]?.();
  });
}

function everyFrame() {
  stage.before.push((seconds) => navigation.step(seconds) && stage.changed());
  stage.closest = () => navigation.walking ? navigation.eye * 0.05 : stage.camera.position.distanceTo(navigation.orbit.target) * 0.01;
  stage.after.push(() => {
    const away = navigation.walking ? 8 * navigation.eye : stage.camera.position.distanceTo(navigation.orbit.target);
    drawScaleBar(element("scale"), scaleBar(unitsPerPixel(away, stage.camera.fov * Math.PI / 180, stage.size.y) * scan.frame.unit));
    drawMeasurements(element("over"), tools.measurements, stage.camera, stage.size, scan.step);
    drawAxes(element("axes"), axes, stage.camera);
    const { triangles, points } = stage.renderer.info.render;
    if (times.picture === null && triangles + points > 0)
      Object.assign(times, { picture: performance.now(), frames: stage.renderer.info.render.frame });
    if (tiles) {
      element("counts").textContent = `${points > 0 ? `${numberText(points, 1)} points` : `${numberText(triangles, 1)} faces`} shown, ${tiles.visibleTiles.size} tiles`;
      element("busy").style.width = tiles.loadProgress < 1 ? `${100 * tiles.loadProgress}%` : "0";
    } else if (times.settled === null && triangles > 0) {
      times.settled = performance.now();
    }
  });
}

async function meshSource() {
  const mesh = await loadMesh();
  offerColours(mesh.colours);
  const shown = config.points ? `${numberText(config.points, 1)} points, the means of ${numberText(config.spots, 1)} cubes`
    : `${numberText(config.faces, 1)} faces`;
  element("counts").textContent = shown + (config.deviation?.reference ? `, compared with ${config.deviation.reference}` : "");
  if (config.deviation) {
    look.scaleEnd.value = config.deviation.high;
    look.signedScale.value = config.deviation.signed;
  }
  const centre = mesh.box.getCenter(new Vector3()).toArray();
  stage.waits = () => false;
  return {
    object: mesh.object,
    frame: (up) => localFrame(centre, config.origin, up),
    sceneBox: (matrix) => mesh.box.clone().applyMatrix4(matrix),
    outline: (matrix) => mesh.sample.map((p) => p.clone().applyMatrix4(matrix).toArray()),
  };
}

const corners = ({ min, max }) =>
  [0, 1, 2, 3, 4, 5, 6, 7].map((i) => new Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z));

async function tilesSource() {
  const source = openTiles(config.url, {
    loaded: () => (offerColours(source.colours), setStep?.(), stage.changed()),
    changed: stage.changed,
    failed: (text) => trouble(`A tile could not be shown: ${text}`),
  });
  tiles = source.tiles;
  tiles.setCamera(stage.camera);
  stage.update = [() => {
    tiles.setResolutionFromRenderer(stage.camera, stage.renderer);
    tiles.update();
  }];
  tiles.addEventListener("tiles-load-end", () => (times.settled = performance.now(), stage.changed()));
  tiles.addEventListener("load-root-tileset", stage.changed);
  stage.waits = () => times.settled === null && tiles.visibleTiles.size === 0;
  stage.changed();
  const { sphere, box, placed, root, asset } = await source.opened;
  element("up-row").hidden = isGeocentric(sphere.center.toArray());
  element("detail-row").hidden = false;
  element("detail").addEventListener("input", (e) => {
    tiles.errorTarget = 24 * 2 ** (-4 * e.target.value);
    stage.changed();
  });
  offerColours([]);
  const extras = asset.extras?.tessera ?? {}, shift = extras.shift ?? [0, 0, 0], centre = sphere.center.toArray();
  look.scaleEnd.value = extras.deviation?.high ?? 1;
  look.signedScale.value = extras.deviation?.signed ?? false;
  const identity = !root.transform || new Matrix4().fromArray(root.transform).equals(new Matrix4());
  return {
    object: source.object,
    frame: (up) => isGeocentric(centre) ? geocentricFrame(centre, identity ? null : root.transform, shift)
      : localFrame(centre, shift, up),
    sceneBox: (matrix) => box.clone().applyMatrix4(matrix.clone().multiply(placed)),
    outline: (matrix) => corners(box).map((p) => p.applyMatrix4(placed).applyMatrix4(matrix).toArray()),
    quantum: () => (Number.isFinite(source.steps.finest) ? source.steps.finest : 0),
  };
}

async function open() {
  element("name").textContent = document.title = config.name;
  stage = new Stage(element("view"), element("panel"));
  navigation = new Navigation(stage.camera, stage.canvas, stage.changed, (p) => stage.below(p),
                              () => stage.pick((stage.size.x + stage.covered) / 2, stage.size.y / 2)?.point ?? null);
  tools = new Tools(stage, scan);
  wire();
  const source = await (config.kind === "tiles" ? tilesSource() : meshSource());
  stage.scene.add(source.object);
  const up = element("up");
  up.value = config.up ?? "z";
  const show = () => {
    tools.clear();
    place(source, up.value);
    setColour(mode);
    view("iso");
  };
  up.addEventListener("change", show);
  everyFrame();
  show();
}

/** For tests and scripts. */
window.tessera = {
  times, setColour, setMove, setSection, view,
  setCut: (share, flip = flipped) => (cut = share, flipped = flip, updateSection()),
  use: (tool) => tools.use(tool),
  pick: (x, y) => {
    const hit = stage.pick(x, y);
    return hit && apply(scan.frame.toScan, hit.point.toArray());
  },
  measurements: () => tools.measurements.map(({ kind, points }) => ({ kind, points })),
  dolly: (factor) => {
    stage.camera.position.lerp(navigation.orbit.target, 1 - factor);
    navigation.orbit.update();
    stage.changed();
  },
  state: () => ({ kind: scan.frame.kind, mode, colours: [...contentColours], walking: navigation.walking, triangles: stage.renderer.info.render.triangles,
                  camera: stage.camera.position.toArray(), trouble: element("trouble").textContent, busy: stage.due,
                  tiles: tiles && { visible: tiles.visibleTiles.size, progress: tiles.loadProgress, failed: tiles.stats.failed } }),
};

open().catch((error) => {
  console.error(error);
  trouble(/WebGL/i.test(String(error?.message)) ? "This browser shows no WebGL 2, which the view needs." : `The view could not be opened: ${error?.message ?? error}`);
});
