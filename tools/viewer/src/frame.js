// Where the scene lies in the world. The scene is z up, its origin near the middle of what is shown, so that single
// precision suffices; the coordinates that people get are those of the scan. Pure; matrices are 16 numbers by columns.

const A = 6378137, F = 1 / 298.257223563, E2 = F * (2 - F);

/** Within 100 km of the ellipsoid: these are earth-centred coordinates, and no local ones. */
export const isGeocentric = (p) => Math.abs(Math.hypot(p[0], p[1], p[2]) - 6.37e6) < 1.2e5;

/** WGS 84: earth-centred to degrees and height above the ellipsoid, in metres. By Bowring's iteration. */
export function geodetic([x, y, z]) {
  const r = Math.hypot(x, y);
  let latitude = Math.atan2(z, r * (1 - E2)), n = A;
  for (let i = 0; i < 6; ++i) {
    const s = Math.sin(latitude);
    n = A / Math.sqrt(1 - E2 * s * s);
    latitude = Math.atan2(z + E2 * n * s, r);
  }
  const s = Math.sin(latitude), c = Math.cos(latitude);
  const height = c > 0.1 ? r / c - n : z / s - n * (1 - E2);
  return { latitude: latitude * 180 / Math.PI, longitude: Math.atan2(y, x) * 180 / Math.PI, height };
}

/** East, north, up at an earth-centred point: columns of the matrix that takes the local scene there. */
export function localToGeocentric(centre) {
  const { latitude, longitude } = geodetic(centre);
  const a = latitude * Math.PI / 180, o = longitude * Math.PI / 180;
  const sa = Math.sin(a), ca = Math.cos(a), so = Math.sin(o), co = Math.cos(o);
  return [-so, co, 0, 0, -sa * co, -sa * so, ca, 0, ca * co, ca * so, sa, 0, ...centre, 1];
}

const UPS = {  // rotations that take the axis named to z
  z: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
  y: [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1],
  x: [0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1],
};

export function apply(m, [x, y, z]) {
  return [m[0] * x + m[4] * y + m[8] * z + m[12], m[1] * x + m[5] * y + m[9] * z + m[13],
          m[2] * x + m[6] * y + m[10] * z + m[14]];
}

/** Of a matrix of rotation, one scale and translation. */
export function inverse(m) {
  const s2 = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
  const out = [m[0] / s2, m[4] / s2, m[8] / s2, 0, m[1] / s2, m[5] / s2, m[9] / s2, 0, m[2] / s2, m[6] / s2,
               m[10] / s2, 0, 0, 0, 0, 1];
  const t = apply(out, [-m[12], -m[13], -m[14]]);
  out[12] = t[0], out[13] = t[1], out[14] = t[2];
  return out;
}

export function multiply(a, b) {
  const out = new Array(16).fill(0);
  for (let c = 0; c < 4; ++c)
    for (let r = 0; r < 4; ++r)
      for (let k = 0; k < 4; ++k) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

export const translation = (t) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...t, 1];

/**
 * The scene around a point of local content.
 * \param centre  in the content's own coordinates
 * \param shift   content + shift = coordinates of the scan
 * \param up      "x", "y" or "z" of the content
 */
export function localFrame(centre, shift = [0, 0, 0], up = "z") {
  const toContent = multiply(translation(centre), inverse(UPS[up]));
  return { kind: "local", fromContent: inverse(toContent), toScan: multiply(translation(shift), toContent),
           unit: 1 };
}

/**
 * The scene around an earth-centred point.
 * \param toWorld  matrix of the root tile, which took the scan's coordinates (less `shift`) to earth-centred ones;
 *   null: nobody knows them, and earth-centred coordinates are given
 */
export function geocentricFrame(centre, toWorld = null, shift = [0, 0, 0]) {
  const toContent = localToGeocentric(centre);
  const toScan = toWorld ? multiply(translation(shift), multiply(inverse(toWorld), toContent)) : toContent;
  return { kind: toWorld ? "placed" : "geocentric", fromContent: inverse(toContent), toScan,
           toGeocentric: toContent, unit: Math.hypot(toScan[0], toScan[1], toScan[2]) };
}
