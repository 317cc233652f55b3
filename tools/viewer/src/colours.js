// Colours by a number, the same stops as the pictures of `tessera render`, and the ticks of their legends. Pure.

/** Dark blue over green and yellow to light red: readable in grey too. */
export const RAMP = [[52, 72, 148], [46, 138, 160], [112, 180, 110], [232, 208, 96], [226, 128, 92]];
/** Behind, on and in front of a reference. */
export const SIDES = [[44, 92, 190], [222, 222, 216], [206, 60, 44]];
export const BEYOND = [208, 42, 192];
export const CLAY = [205, 199, 188];
export const BACK = [240, 140, 46];
export const MARKED = { synthetic: [70, 130, 220], uncertain: [214, 62, 46] };

function between(stops, share) {
  const at = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2), t = at - i;
  return stops[i].map((c, k) => Math.round(c * (1 - t) + stops[i + 1][k] * t));
}

/** share 0..1 to [r, g, b] of 0..255; what lies outside takes the end. */
export const rampColour = (share) => between(RAMP, share);

/** A deviation on a scale that ends at `high` (> 0), as the pictures draw it. */
export function deviationColour(deviation, high, signed) {
  if (!(Math.abs(deviation) <= high)) return BEYOND;
  return signed ? between(SIDES, 0.5 + 0.5 * deviation / high) : rampColour(Math.abs(deviation) / high);
}

/** The next of 1, 2, 5 times a power of ten at or below x > 0. */
export function roundDown125(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  const lead = x / power * (1 + 1e-12);
  return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
}

/** Round values of a scale from low to high, about `most` of them, in order. */
export function ticks(low, high, most = 6) {
  if (!(high > low)) return [low];
  let step = roundDown125((high - low) / most);
  while (Math.floor(high / step) - Math.ceil(low / step) + 1 > most) step = roundDown125(step * 2.5);
  const out = [];
  for (let i = Math.ceil(low / step - 1e-9); i <= high / step + 1e-9; ++i) out.push(i * step === 0 ? 0 : i * step);
  return out;
}

/** A number with as many digits as `step` tells apart: no noise of floating point, thousands in groups. */
export function numberText(value, step) {
  if (step < 1e-9) return value.toExponential(2);
  const digits = Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  const text = Math.abs(value).toFixed(digits);
  const [whole, part] = text.split(".");
  const grouped = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole;
  const sign = value < 0 && Number(text) !== 0 ? "\u2212" : "";
  return sign + grouped + (part ? "." + part : "");
}
