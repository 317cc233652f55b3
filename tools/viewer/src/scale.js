// What fits into the picture, and the scale bar. Pure.
import { numberText, roundDown125 } from "./colours.js";

/** The longest round length that takes at most `most` pixels. \param perPixel  scan units a pixel */
export function scaleBar(perPixel, most = 160) {
  if (!(perPixel > 0) || !Number.isFinite(perPixel)) return null;
  const units = roundDown125(perPixel * most);
  return { units, pixels: units / perPixel, text: numberText(units, units) };
}

/** Scan units a pixel at a distance, for a camera with this vertical field of view. */
export const unitsPerPixel = (distance, fieldRadians, height) => 2 * distance * Math.tan(fieldRadians / 2) / height;

/** Near and far plane for an eye this far from a ball; nothing nearer than `closest` matters. */
export function clipRange(distance, radius, closest) {
  const far = Math.max(distance + radius, closest * 10) * 1.02;
  return { near: Math.max(distance - radius, closest, far * 1e-6) * 0.98, far };
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((c) => c / Math.hypot(...a));

/**
 * Obliquely from above, from the front and the right, as `tessera render --view iso` looks: 25 degrees above the horizon,
 * and up to 45 for what is wide and flat, of which the wide angle of a page would show little more than the edge.
 * \param low, high  of the scene, z up  \returns the direction to the eye
 */
export function oblique(low, high) {
  const [x, y, z] = high.map((c, k) => c - low[k]);
  const flat = Math.max(0, 1 - 2 * z / Math.max(x, y, 1e-300)), e = (25 + 20 * flat) * Math.PI / 180;
  const a = 35 * Math.PI / 180;
  return [Math.sin(a) * Math.cos(e), -Math.cos(a) * Math.cos(e), Math.sin(e)];
}

/** Where on an axis across the line of sight the eye has what it sees in the middle. */
function centred(points, along, back, depth, low, high) {
  for (let step = 0; step < 60; ++step) {
    const middle = (low + high) / 2;
    let least = Infinity, most = -Infinity;
    for (const p of points) {
      const seen = (dot(p, along) - middle) / (depth - dot(p, back));
      least = Math.min(least, seen), most = Math.max(most, seen);
    }
    if (least + most > 0) low = middle;
    else high = middle;
  }
  return (low + high) / 2;
}

/**
 * The eye from which points fill the picture but for a margin: the apex of the narrowest frustum around them, as
 * `fit_camera` has it (kernels/picture/camera.cpp), with what it sees in the middle.
 * \param from  the direction to the eye, not upright  \param tangents  of half the field of view, across and upwards
 * \returns {eye, target}: the target lies on the line of sight, in the middle of the depth of the points
 */
export function fitted(points, from, tangents, margin = 1.1) {
  const back = unit(from), right = unit(cross([0, 0, 1], back)), up = cross(back, right);
  const across = [right, up], t = tangents.map((c) => c / margin);
  const low = [Infinity, Infinity], high = [-Infinity, -Infinity], least = [Infinity, Infinity], most = [-Infinity, -Infinity];
  let z0 = Infinity, z1 = -Infinity;
  for (const p of points) {
    const z = dot(p, back);
    z0 = Math.min(z0, z), z1 = Math.max(z1, z);
    across.forEach((axis, k) => {
      const at = dot(p, axis);
      low[k] = Math.min(low[k], at), high[k] = Math.max(high[k], at);
      least[k] = Math.min(least[k], at - z * t[k]), most[k] = Math.max(most[k], at + z * t[k]);
    });
  }
  const before = Math.max((z1 - z0) * 1e-3, Math.abs(z1) * 1e-6, 1e-12);
  const depth = Math.max(z1 + before, ...t.map((c, k) => (most[k] - least[k]) / 2 / c));
  const [x, y] = across.map((axis, k) => centred(points, axis, back, depth, low[k], high[k]));
  const at = (z) => right.map((c, k) => c * x + up[k] * y + back[k] * z);
  return { eye: at(depth), target: at((z0 + z1) / 2) };
}
