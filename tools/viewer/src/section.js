// A plane that hides what lies in front of it: normal . p > offset. Pure; arrays of three numbers.

const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/**
 * \param kind   "x", "y", "z", or a direction of three numbers
 * \param share  0 hides all of the box, 1 nothing; the other way round when flipped
 * \param box    {low, high}
 */
export function sectionPlane(kind, share, box, flipped = false) {
  const axis = Array.isArray(kind) ? kind.map((c) => c / Math.hypot(...kind)) : AXES[kind];
  const normal = flipped ? axis.map((c) => (c === 0 ? 0 : -c)) : axis;
  const [from, to] = extent(axis, box);
  const at = from + share * (to - from);
  return { normal, offset: flipped ? -at : at };
}

/** Of a box along a direction: its lowest and highest value. */
export function extent(normal, box) {
  let from = 0, to = 0;
  for (let i = 0; i < 3; ++i) {
    const a = normal[i] * box.low[i], b = normal[i] * box.high[i];
    from += Math.min(a, b);
    to += Math.max(a, b);
  }
  return [from, to];
}

export const hides = (plane, p) => plane !== null && dot(plane.normal, p) > plane.offset;

/** A direction level with the ground that points to the viewer: what stands in the way is cut off. */
export function levelDirection(view, up) {
  const along = dot(view, up);
  const level = view.map((c, i) => -(c - along * up[i]));
  const size = Math.hypot(...level);
  return size > 1e-6 ? level.map((c) => c / size) : up;
}
