// What is drawn over the picture: points and distances measured, the scale bar, the axes, the legend. Elements of SVG
// and HTML, so that text is sharp and nothing depends on what lies behind.
import { Vector3 } from "three";
import { BEYOND, CLAY, MARKED, deviationColour, numberText, rampColour, ticks } from "./colours.js";
import { distance, length, pointText, subtract } from "./measure.js";

const SVG = "http://www.w3.org/2000/svg";
const svg = (name, attributes = {}, text = "") => {
  const e = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, value);
  e.textContent = text;
  return e;
};
const css = (c) => `rgb(${c.join(" ")})`;

/** \param measurements  [{kind, points (of the scan), scene: [Vector3], open}] */
export function drawMeasurements(layer, measurements, camera, size, step) {
  const toPixels = (v) => {
    const at = v.clone().applyMatrix4(camera.projectionMatrix);
    return [(at.x + 1) / 2 * size.x, (1 - at.y) / 2 * size.y];
  };
  const before = (v) => v.z < -camera.near;
  /** Both ends in pixels, of what lies before the eye; null where nothing does. */
  const seen = (a, b) => {
    if (!before(a) && !before(b)) return null;
    const cut = (from, to) => before(from) ? from : from.clone().lerp(to, (from.z + 1.001 * camera.near) / (from.z - to.z));
    return [toPixels(cut(a, b)), toPixels(cut(b, a))];
  };
  const parts = [], label = ([x, y], text) => {
    parts.push(svg("text", { x: x + 9, y: y - 9, class: "halo" }, text), svg("text", { x: x + 9, y: y - 9 }, text));
  };
  for (const m of measurements) {
    const at = m.scene.map((p) => p.clone().applyMatrix4(camera.matrixWorldInverse));
    for (let i = 1; i < at.length; ++i) {
      const ends = seen(at[i - 1], at[i]);
      if (!ends) continue;
      const [[x1, y1], [x2, y2]] = ends, line = { x1, y1, x2, y2 };
      parts.push(svg("line", { ...line, class: "under" }), svg("line", line));
      label([(x1 + x2) / 2, (y1 + y2) / 2], numberText(length(subtract(m.points[i], m.points[i - 1])), step));
    }
    for (const v of at.filter(before)) {
      const [cx, cy] = toPixels(v);
      parts.push(svg("circle", { cx, cy, r: 4.5, class: m.open ? "open" : "" }));
    }
    if (m.kind === "point" && before(at[0])) label(toPixels(at[0]), pointText(m.points[0], step));
  }
  layer.replaceChildren(...parts);
}

/** One row of the list of measurements: what stands in it, as pairs. */
export function measurementRows(m, step, up) {
  if (m.kind === "point") return [["X", m.points[0][0]], ["Y", m.points[0][1]], ["Z", m.points[0][2]]]
    .map(([k, v]) => [k, numberText(v, step)]).concat(m.more ?? []);
  const last = m.points.length - 1, rows = [];
  if (last > 1) {
    let sum = 0;
    for (let i = 1; i <= last; ++i) sum += length(subtract(m.points[i], m.points[i - 1]));
    rows.push(["along the chain", numberText(sum, step)]);
  }
  if (last < 1) return [["next point …", ""]];
  const d = distance(m.points[last - 1], m.points[last], up);
  rows.push(["distance", numberText(d.distance, step)], ["level", numberText(d.horizontal, step)],
            ["height", numberText(d.height, step)]);
  d.parts.forEach((v, i) => rows.push([`Δ${"XYZ"[i]}`, numberText(v, step)]));
  return rows;
}

export function drawScaleBar(element, bar) {
  element.hidden = !bar;
  if (!bar) return;
  element.querySelector("i").style.width = `${bar.pixels.toFixed(1)}px`;
  element.querySelector("span").textContent = `${bar.text} scan units`;
}

/** \param axes  [{name, direction: Vector3 of the scene}] */
export function drawAxes(layer, axes, camera) {
  const toView = camera.matrixWorldInverse, parts = [];
  axes.map(({ name, direction }) => ({ name, v: direction.clone().transformDirection(toView) }))
    .sort((a, b) => a.v.z - b.v.z)
    .forEach(({ name, v }) => {
      const x = 36 + 22 * v.x, y = 36 - 22 * v.y;
      parts.push(svg("line", { x1: 36, y1: 36, x2: x, y2: y, class: name }),
                 svg("text", { x: 36 + 29 * v.x, y: 40 - 29 * v.y, class: name, "text-anchor": "middle" }, name));
    });
  layer.replaceChildren(...parts);
}

/**
 * \param scale  null, {title, low, high, kind: "height"|"distance"|"deviation"}, or {title, marked: name, text}
 */
export function drawLegend(element, scale) {
  element.hidden = !scale;
  if (!scale) return;
  const title = document.createElement("b");
  title.textContent = scale.title;
  if (scale.marked) {
    const rows = [[MARKED[scale.marked], scale.text], [CLAY, "measured surface"]].map(([colour, text]) => {
      const row = document.createElement("div"), chip = document.createElement("i");
      chip.style.background = css(colour);
      row.append(chip, text);
      return row;
    });
    element.replaceChildren(title, ...rows);
    return;
  }
  const { low, high, kind } = scale, tall = 200, parts = [];
  const colour = (share) => kind === "height" ? rampColour(share)
    : deviationColour(low + share * (high - low), Math.max(Math.abs(low), Math.abs(high)), kind === "deviation");
  const rows = 100;
  for (let i = 0; i < rows; ++i)
    parts.push(svg("rect", { x: 0, y: (rows - 1 - i) * tall / rows + 8, width: 16, height: tall / rows + 0.5,
                             fill: css(colour((i + 0.5) / rows)) }));
  const values = ticks(low, high, 6), step = values.length > 1 ? values[1] - values[0] : Math.abs(low) || 1;
  for (const v of values) {
    const y = 8 + tall * (1 - (v - low) / (high - low || 1));
    parts.push(svg("line", { x1: 16, x2: 21, y1: y, y2: y }), svg("text", { x: 26, y: y + 4 }, numberText(v, step)));
  }
  if (kind !== "height") {
    parts.push(svg("rect", { x: 0, y: tall + 16, width: 16, height: 12, fill: css(BEYOND) }),
               svg("text", { x: 26, y: tall + 26 }, "beyond"));
  }
  const drawing = svg("svg", { width: 128, height: tall + (kind === "height" ? 16 : 34) });
  drawing.append(...parts);
  element.replaceChildren(title, drawing);
}

/** The axes of the scan as directions of the scene. */
export function scanAxes(toScan) {
  return ["X", "Y", "Z"].map((name, i) => ({
    name, direction: new Vector3(toScan[i], toScan[4 + i], toScan[8 + i]).normalize(),
  }));
}
