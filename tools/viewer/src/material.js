// One shader for everything that is shown: flat normals of what is on screen where the data has none, colours by what
// the person asks for, a section plane. Colours are those of the scan, for screens (sRGB), lit as they are, without tone
// mapping; linear ones, as glTF has them, become sRGB at the vertices, so that a site looks like its mesh.
import { DoubleSide, ShaderMaterial, Vector3 } from "three";
import { BACK, BEYOND, CLAY, MARKED, RAMP, SIDES } from "./colours.js";

export const MODES = { plain: 0, rgb: 1, height: 2, deviation: 3, synthetic: 4, uncertain: 5 };

const glsl = (c) => `vec3(${c.map((v) => (v / 255).toFixed(4)).join(", ")})`;
const stops = (name, list) => `vec3 ${name}(float t) {
  t = clamp(t, 0.0, 1.0) * ${(list.length - 1).toFixed(1)};
  vec3 c = ${glsl(list[0])};
  ${list.slice(1).map((s, i) => `c = mix(c, ${glsl(s)}, clamp(t - ${i.toFixed(1)}, 0.0, 1.0));`).join("\n  ")}
  return c;
}`;

const toScreen = `vec3 toScreen(vec3 c) {  // IEC 61966-2-1, as stream/formats/srgb.cpp
  return mix(12.92 * c, 1.055 * pow(max(c, 0.0), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}`;

const vertexShader = `
#ifdef HAS_COLOUR
  attribute vec3 color;
#endif
#ifdef HAS_DEVIATION
  attribute float deviation;
#endif
#ifdef HAS_SYNTHETIC
  attribute float synthetic;
#endif
#ifdef HAS_UNCERTAIN
  attribute float uncertain;
#endif
#ifdef LINEAR_COLOUR
${toScreen}
#endif
#ifdef HAS_PICTURE
varying vec2 onPicture;
#endif
#ifdef POINTS
  uniform float pointSize;
#endif
varying vec3 seen, placed, tint, lit;
varying float measured, made, doubtful;
void main() {
  vec4 at = modelMatrix * vec4(position, 1.0);
  placed = at.xyz;
  vec4 before = modelViewMatrix * vec4(position, 1.0);
  seen = before.xyz;
  tint = vec3(0.0);
  lit = vec3(0.0);
  measured = made = doubtful = 0.0;
#ifdef HAS_COLOUR
#ifdef LINEAR_COLOUR
  tint = toScreen(color);
#else
  tint = color;
#endif
#endif
#ifdef HAS_PICTURE
  onPicture = uv;
#endif
#ifdef HAS_NORMAL
  lit = normalMatrix * normal;
#endif
#ifdef HAS_DEVIATION
  measured = deviation;
#endif
#ifdef HAS_SYNTHETIC
  made = synthetic;
#endif
#ifdef HAS_UNCERTAIN
  doubtful = uncertain;
#endif
  gl_Position = projectionMatrix * before;
#ifdef POINTS
  gl_PointSize = pointSize;
#endif
}`;

const fragmentShader = `
varying vec3 seen, placed, tint, lit;
varying float measured, made, doubtful;
#ifdef HAS_PICTURE
${toScreen}
varying vec2 onPicture;
uniform sampler2D picture;
#endif
uniform int mode;
uniform bool backs, cutting, signedScale;
uniform vec2 heights;
uniform float scaleEnd;
uniform vec3 cutNormal, upSeen;
uniform float cutOffset;
${stops("ramp", RAMP)}
${stops("sides", SIDES)}
void main() {
  if (cutting && dot(placed, cutNormal) > cutOffset) discard;
#ifdef POINTS
  if (distance(gl_PointCoord, vec2(0.5)) > 0.5) discard;
  vec3 facet = normalize(-seen), n = facet;  // a point without a normal looks at the eye
#else
  vec3 facet = normalize(cross(dFdx(seen), dFdy(seen)));
  vec3 n = facet;
#endif
#ifdef HAS_NORMAL
  n = normalize(lit);
  if (dot(n, facet) < 0.0) n = -n;
#endif
  vec3 base = ${glsl(CLAY)};
#ifdef HAS_COLOUR
  if (mode == 1) base = tint;
#endif
#ifdef HAS_PICTURE
  if (mode == 1) base = toScreen(texture2D(picture, onPicture).rgb);
#endif
  if (mode == 2) base = ramp((placed.z - heights.x) / max(heights.y - heights.x, 1e-20));
#ifdef HAS_DEVIATION
  if (mode == 3) {
    // Written so that what is no number lies beyond the scale too.
    if (!(abs(measured) <= scaleEnd)) base = ${glsl(BEYOND)};
    else base = signedScale ? sides(0.5 + 0.5 * measured / scaleEnd) : ramp(abs(measured) / scaleEnd);
  }
#endif
#ifdef HAS_SYNTHETIC
  if (mode == 4 && made > 0.5) base = ${glsl(MARKED.synthetic)};
#endif
#ifdef HAS_UNCERTAIN
  if (mode == 5) base = mix(base, ${glsl(MARKED.uncertain)}, clamp(doubtful, 0.0, 1.0));
#endif
#ifdef POINTS
  bool behind = false;
#else
  bool behind = !gl_FrontFacing;
#endif
  // Cut open, a solid shows its inside: there the colours asked for stay readable.
  if (behind && backs) base = mix(base, ${glsl(BACK)}, cutting ? 0.6 : 1.0);
  // Sky and ground by the direction up, a lamp over the left shoulder, and a rim that lifts edges off each other.
  float sky = 0.5 + 0.5 * dot(n, upSeen);
  float lamp = max(0.0, dot(n, normalize(vec3(-0.45, 0.55, 0.75))));
  vec3 light = mix(vec3(0.30, 0.29, 0.31), vec3(0.52, 0.55, 0.60), sky) + vec3(0.50, 0.485, 0.455) * lamp;
  light *= 0.80 + 0.20 * max(0.0, dot(n, normalize(-seen)));
  if (behind && cutting) light = mix(light, vec3(0.92), 0.65);
  gl_FragColor = vec4(min(base * light * 1.06, vec3(1.0)), 1.0);
}`;

/** What all materials share; changing a value changes all of them. */
export const look = {
  mode: { value: MODES.plain },
  backs: { value: true },
  cutting: { value: false },
  cutNormal: { value: new Vector3(0, 0, 1) },
  cutOffset: { value: 0 },
  heights: { value: { x: 0, y: 1 } },
  scaleEnd: { value: 1 },
  signedScale: { value: false },
  upSeen: { value: new Vector3(0, 0, 1) },
  pointSize: { value: 3 },  // pixels of the canvas
};

const made = new Map();

/**
 * The material for a geometry, by what its vertices carry.
 * \param linear  their colours are, as those of glTF; else sRGB
 * \param points  they are points, not corners of faces
 * \param picture  a texture that is shown in place of colours, or nothing
 */
export function materialFor(geometry, { linear = false, points = false, picture = null } = {}) {
  const defines = { ...(linear ? { LINEAR_COLOUR: "" } : {}), ...(points ? { POINTS: "" } : {}) };
  for (const [name, attribute] of [["HAS_COLOUR", "color"], ["HAS_NORMAL", "normal"], ["HAS_DEVIATION", "deviation"],
                                   ["HAS_SYNTHETIC", "synthetic"], ["HAS_UNCERTAIN", "uncertain"]])
    if (geometry.getAttribute(attribute)) defines[name] = "";
  if (picture)
    return new ShaderMaterial({
      vertexShader, fragmentShader, defines: { ...defines, HAS_PICTURE: "" },
      uniforms: { ...look, picture: { value: picture } }, side: DoubleSide,
    });
  const key = Object.keys(defines).join();
  if (!made.has(key))
    made.set(key, new ShaderMaterial({ vertexShader, fragmentShader, defines, uniforms: look, side: DoubleSide }));
  return made.get(key);
}

/** Names of the colourings that a geometry can show. */
export const coloursOf = (geometry) => [
  ...(geometry.getAttribute("color") ? ["rgb"] : []),
  ...["deviation", "synthetic", "uncertain"].filter((name) => geometry.getAttribute(name)),
];
