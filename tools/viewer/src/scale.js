// The scale bar. Pure.
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
