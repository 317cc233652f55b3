// Points and distances in the coordinates of the scan, as doubles. Pure.
import { numberText } from "./colours.js";

export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const length = (v) => Math.hypot(v[0], v[1], v[2]);

/** From a to b: distance, its parts along the axes, along and across `up` (a unit vector). */
export function distance(a, b, up = [0, 0, 1]) {
  const d = subtract(b, a);
  const height = d[0] * up[0] + d[1] * up[1] + d[2] * up[2];
  const across = subtract(d, up.map((u) => u * height));
  return { distance: length(d), parts: d, height, horizontal: length(across) };
}

/** Along a chain of points. */
export function chainLength(points) {
  let sum = 0;
  for (let i = 1; i < points.length; ++i) sum += length(subtract(points[i], points[i - 1]));
  return sum;
}

/**
 * The last digit shown: not below what positions are worth (single precision of content this large, or the step of
 * quantised coordinates), and no finer than a scan is: a hundred-thousandth of its size, or a thousandth of its unit.
 */
export function positionStep(size, quantum = 0) {
  const least = Math.max(quantum, size * 2 ** -23, Math.min(size * 1e-5, 1e-3), 1e-300);
  return Number(`1e${Math.floor(Math.log10(least))}`);
}

export const pointText = (p, step) => p.map((c) => numberText(c, step)).join("\u2003");

/** Rows for a spreadsheet: plain numbers, dot as decimal sign. */
export function csv(measurements, step) {
  const digits = Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  const plain = (v) => v.toFixed(digits);
  const rows = ["kind,number,x,y,z,distance"];
  measurements.forEach((m, i) => {
    m.points.forEach((p, k) => {
      const d = k > 0 ? plain(length(subtract(p, m.points[k - 1]))) : "";
      rows.push([m.kind, i + 1, ...p.map(plain), d].join(","));
    });
  });
  return rows.join("\n") + "\n";
}
