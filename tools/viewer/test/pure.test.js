// What the page computes, without a page.
import assert from "node:assert/strict";
import { deflateSync } from "node:zlib";
import { test } from "node:test";
import * as blocks from "../src/blocks.js";
import * as colours from "../src/colours.js";
import * as frame from "../src/frame.js";
import * as measure from "../src/measure.js";
import * as scale from "../src/scale.js";
import * as section from "../src/section.js";

const near = (a, b, error = 1e-9) =>
  assert.ok(a.length === b.length && a.every((x, i) => Math.abs(x - b[i]) <= error), `${a} is not ${b}`);

test("ramps begin and end at their stops, and clamp", () => {
  assert.deepEqual(colours.rampColour(0), colours.RAMP[0]);
  assert.deepEqual(colours.rampColour(1), colours.RAMP[4]);
  assert.deepEqual(colours.rampColour(0.5), colours.RAMP[2]);
  assert.deepEqual(colours.rampColour(-3), colours.RAMP[0]);
  assert.deepEqual(colours.rampColour(7), colours.RAMP[4]);
  assert.deepEqual(colours.rampColour(0.125), [49, 105, 154]);
});

test("deviations: sides, middle, beyond", () => {
  assert.deepEqual(colours.deviationColour(0, 2, true), colours.SIDES[1]);
  assert.deepEqual(colours.deviationColour(-2, 2, true), colours.SIDES[0]);
  assert.deepEqual(colours.deviationColour(2, 2, true), colours.SIDES[2]);
  assert.deepEqual(colours.deviationColour(-1, 2, false), colours.rampColour(0.5));
  assert.deepEqual(colours.deviationColour(2.01, 2, false), colours.BEYOND);
  assert.deepEqual(colours.deviationColour(NaN, 2, true), colours.BEYOND);
});

test("ticks are round, inside, and few", () => {
  assert.deepEqual(colours.ticks(0, 1, 6), [0, 0.2, 0.4, 0.6000000000000001, 0.8, 1]);
  assert.deepEqual(colours.ticks(-2, 2, 6), [-2, -1, 0, 1, 2]);
  for (const [low, high] of [[0, 1], [101.3, 187.2], [-0.0031, 0.0002], [4e6, 4.1e6], [7, 7]]) {
    const all = colours.ticks(low, high, 6);
    assert.ok(all.length >= 1 && all.length <= 6, `${low} to ${high}: ${all}`);
    for (const t of all) assert.ok(t >= low - 1e-9 * Math.abs(low) && t <= high * (1 + 1e-9), `${t}`);
  }
});

test("numbers show what their step tells apart", () => {
  assert.equal(colours.numberText(0.30000000000000004, 0.1), "0.3");
  assert.equal(colours.numberText(1234567.891, 0.01), "1\u202f234\u202f567.89");
  assert.equal(colours.numberText(-0.0001, 0.01), "0.00");
  assert.equal(colours.numberText(-12, 1), "\u221212");
  assert.equal(colours.numberText(5000, 1000), "5000");
});

test("distances, heights and chains", () => {
  const d = measure.distance([500000, 5400000, 100], [500003, 5400004, 112]);
  assert.equal(d.distance, 13);
  assert.equal(d.height, 12);
  assert.equal(d.horizontal, 5);
  assert.deepEqual(d.parts, [3, 4, 12]);
  const y = measure.distance([0, 0, 0], [3, 5, 4], [0, 1, 0]);
  assert.equal(y.height, 5);
  assert.equal(y.horizontal, 5);
  assert.equal(measure.chainLength([[0, 0, 0], [3, 4, 0], [3, 4, 2]]), 7);
  assert.equal(measure.chainLength([[1, 2, 3]]), 0);
});

test("steps follow the size, tables are plain", () => {
  assert.equal(measure.positionStep(0.15), 0.000001);
  assert.equal(measure.positionStep(50), 0.0001);
  assert.equal(measure.positionStep(5000), 0.001);
  assert.equal(measure.positionStep(50, 0.0015), 0.001);
  assert.equal(measure.positionStep(1e6), 0.1);
  const table = measure.csv([{ kind: "distance", points: [[1, 2, 3], [1, 2, 5.25]] }], 0.01);
  assert.equal(table, "kind,number,x,y,z,distance\ndistance,1,1.00,2.00,3.00,\ndistance,1,1.00,2.00,5.25,2.25\n");
});

test("a section hides what lies before it, flipped the rest", () => {
  const box = { low: [-2, -4, 0], high: [2, 4, 10] };
  const plane = section.sectionPlane("z", 0.3, box);
  assert.deepEqual(plane, { normal: [0, 0, 1], offset: 3 });
  assert.ok(section.hides(plane, [0, 0, 3.1]));
  assert.ok(!section.hides(plane, [0, 0, 2.9]));
  const other = section.sectionPlane("z", 0.3, box, true);
  assert.ok(!section.hides(other, [0, 0, 3.1]));
  assert.ok(section.hides(other, [0, 0, 2.9]));
  assert.ok(!section.hides(null, [0, 0, 99]));
  near(section.sectionPlane([3, 4, 0], 1, box).normal, [0.6, 0.8, 0]);
  assert.equal(section.sectionPlane([3, 4, 0], 1, box).offset, 0.6 * 2 + 0.8 * 4);
  assert.deepEqual(section.extent([-1, 0, 0], box), [-2, 2]);
  near(section.levelDirection([0, 0.8, -0.6], [0, 0, 1]), [0, -1, 0]);
  assert.deepEqual(section.levelDirection([0, 0, -1], [0, 0, 1]), [0, 0, 1]);
});

test("geodetic coordinates of known places", () => {
  // Corners of the ellipsoid, and a point of EPSG's guidance note 7-2 (9602).
  const a = 6378137, b = a * (1 - 1 / 298.257223563);
  near([frame.geodetic([a, 0, 0]).height, frame.geodetic([0, 0, b + 5]).height], [0, 5], 1e-6);
  const p = frame.geodetic([3771793.968, 140253.342, 5124304.349]);
  near([p.latitude, p.longitude], [53.80939444, 2.12955], 1e-7);
  near([p.height], [73], 0.01);
});

test("the local frame of a place on earth is level, and leads back", () => {
  const centre = [3771793.968, 140253.342, 5124304.349];
  const f = frame.geocentricFrame(centre);
  const above = frame.apply(f.toGeocentric, [0, 0, 50]);
  near([frame.geodetic(above).height], [123], 0.01);
  near(frame.apply(f.fromContent, above), [0, 0, 50], 1e-6);
  near(frame.apply(f.fromContent, centre), [0, 0, 0], 1e-6);
  const east = frame.geodetic(frame.apply(f.toGeocentric, [10, 0, 0]));
  assert.ok(east.longitude > 2.1296 && Math.abs(east.latitude - 53.80939444) < 1e-6);
  assert.ok(frame.isGeocentric(centre));
  assert.ok(!frame.isGeocentric([500000, 5400000, 100]));
});

test("scan coordinates come back through shift, axes and placement", () => {
  const local = frame.localFrame([10, 20, 30], [500000, 5400000, 0]);
  near(frame.apply(local.toScan, [1, 2, 3]), [500011, 5400022, 33]);
  near(frame.apply(local.fromContent, [11, 22, 33]), [1, 2, 3]);
  for (const [up, axis] of [["x", [5, 0, 0]], ["y", [0, 5, 0]], ["z", [0, 0, 5]]]) {
    const f = frame.localFrame([0, 0, 0], [0, 0, 0], up);
    near(frame.apply(f.fromContent, axis), [0, 0, 5]);
    near(frame.apply(f.toScan, [0, 0, 5]), axis);
  }
  // Scanned in feet, placed on earth in metres.
  const centre = [3771793.968, 140253.342, 5124304.349];
  const feet = frame.multiply(frame.localToGeocentric(centre), [0.3048, 0, 0, 0, 0, 0.3048, 0, 0, 0, 0, 0.3048, 0, 0, 0, 0, 1]);
  const placed = frame.geocentricFrame(centre, feet, [1000, 2000, 0]);
  near(frame.apply(placed.toScan, [3.048, 0, 30.48]), [1010, 2000, 100], 1e-5);
  near([placed.unit], [1 / 0.3048], 1e-9);
});

test("blocks: base64, inflate, differences", async () => {
  const words = Int32Array.from([5, 3, 2000000000, -2000000000, 7]);
  const stored = Int32Array.from(words, (w, i) => (w - (i ? words[i - 1] : 0)) | 0);
  const text = deflateSync(Buffer.from(stored.buffer)).toString("base64");
  const bytes = await blocks.inflate(blocks.base64Bytes(text));
  assert.deepEqual(blocks.undoDifferences(new Int32Array(bytes.buffer)), words);
});

test("marks of faces become marks of vertices, shared ones are doubled", () => {
  // Two faces share the edge 1-2; the second closes a hole.
  const index = Uint32Array.from([0, 1, 2, 2, 1, 3]);
  const { source, mark } = blocks.splitByMark(index, [0, 1], 4);
  assert.deepEqual([...index], [0, 1, 2, 4, 5, 3]);
  assert.deepEqual(source, [2, 1]);
  assert.deepEqual([...mark], [0, 0, 0, 1, 1, 1]);
});

test("scale bars are round and fit", () => {
  assert.deepEqual(scale.scaleBar(0.01, 160), { units: 1, pixels: 100, text: "1" });
  assert.equal(scale.scaleBar(0.0007, 160).text, "0.1");
  assert.equal(scale.scaleBar(0, 160), null);
  for (const perPixel of [1e-6, 0.013, 1, 77, 4e5]) {
    const bar = scale.scaleBar(perPixel);
    assert.ok(bar.pixels <= 160 && bar.pixels > 60, `${perPixel}: ${bar.pixels}`);
  }
  assert.equal(scale.unitsPerPixel(10, Math.PI / 2, 1000).toFixed(9), "0.020000000");
});

test("clip planes hold the ball, from within too", () => {
  const out = scale.clipRange(100, 10, 0.1);
  assert.ok(out.near < 90 && out.near > 80 && out.far > 110);
  const inside = scale.clipRange(2, 10, 0.01);
  assert.ok(inside.near <= 0.01 && inside.far > 12);
});

test("views fit all points into the picture, whatever their shape, and no more", () => {
  const box = (x, y, z) => [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [i & 1 ? x : -x, i & 2 ? y : -y, i & 4 ? z : -z]);
  const dot = (a, b) => a.reduce((sum, c, i) => sum + c * b[i], 0), less = (a, b) => a.map((c, i) => c - b[i]);
  const unit = (a) => a.map((c) => c / Math.hypot(...a));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  for (const size of [[1, 1, 1], [400, 300, 2], [2000, 30, 5], [30, 2000, 5], [0.1, 0.2, 9], [5, 5, 0]])
    for (const from of [scale.oblique([-1, -1, 0], [1, 1, 0.1]), [0, -1, 0], [1, 0, 0], [0, -1e-4, 1]])
      for (const tangents of [[0.7, 0.46], [0.3, 0.46]]) {
        const points = box(...size), { eye, target } = scale.fitted(points, from, tangents);
        const back = unit(less(eye, target)), right = unit(cross([0, 0, 1], back)), up = cross(back, right);
        near(back, unit(from), 1e-6);
        const seen = points.map((p) => [right, up].map((axis, k) => dot(less(p, eye), axis) / dot(less(eye, p), back) / tangents[k]));
        const most = [0, 1].map((k) => Math.max(...seen.map((s) => s[k]))), least = [0, 1].map((k) => Math.min(...seen.map((s) => s[k])));
        near([Math.max(...most)], [1 / 1.1], 2e-3 / 1.1);  // the margin, on one axis at least
        near(most, least.map((c) => -c), 1e-6);  // in the middle
      }
});

test("what is flat is looked at from higher up", () => {
  const angle = (high) => Math.asin(scale.oblique([0, 0, 0], high)[2]) * 180 / Math.PI;
  near([angle([1000, 800, 0]), angle([2, 2, 2]), angle([1, 1, 50])], [45, 25, 25], 1e-9);
  assert.ok(angle([100, 100, 20]) > 35 && angle([100, 100, 20]) < 45);
  const [x, y] = scale.oblique([0, 0, 0], [1, 1, 1]);
  assert.ok(x > 0 && y < 0, "from the front and the right");
});
