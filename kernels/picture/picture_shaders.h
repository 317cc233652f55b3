/// \file picture_shaders.h
/// GLSL of picture.cpp. Colours are averaged and lit in linear light, taken as the square of the stored
/// value; no pow, sin or cos, whose last bits belong to the driver. PAGE is defined where a page of a texture gives colours.
#pragma once

namespace tessera::shaders {

inline constexpr const char* kLight = R"(
// Eye coordinates: x right, y up, z towards the viewer.
vec3 lit(vec3 albedo, vec3 n, vec3 v) {
  const vec3 key = vec3(-0.4537, 0.5672, 0.6874);
  const vec3 fill = vec3(0.7303, -0.0913, 0.6771);
  vec3 half_way = normalize(key + v);
  float spec = max(dot(n, half_way), 0.0);
  spec *= spec; spec *= spec; spec *= spec; spec *= spec; spec *= spec;
  float wrap = max(dot(n, key) * 0.85 + 0.15, 0.0);
  float light = 0.86 * wrap + 0.20 * max(dot(n, fill), 0.0) + 0.12 * max(dot(n, v), 0.0) + 0.09 + 0.06 * n.y;
  return albedo * light + vec3(0.035 * spec);
}
// As lacquer: the key light small and bright, the fill light as a soft box, more light at grazing angles (Schlick).
vec3 glossy(vec3 albedo, vec3 n, vec3 v) {
  float key = max(dot(n, normalize(vec3(-0.4537, 0.5672, 0.6874) + v)), 0.0);
  float fill = max(dot(n, normalize(vec3(0.7303, -0.0913, 0.6771) + v)), 0.0);
  fill *= fill; fill *= fill; fill *= fill; fill *= fill; fill *= fill;
  key *= key; key *= key; key *= key; key *= key; key *= key; key *= key; key *= key;
  float away = 1.0 - max(dot(n, v), 0.0);
  float grazing = away * away * away * away * away;
  return 0.6 * lit(albedo, n, v) + vec3(0.7 * key + 0.12 * fill + 0.3 * grazing);
}
// Where the reflected ray meets the sphere of light tubes: for a half vector m the tangent of half its angle to the
// view's vertical plane, which grows evenly enough.
vec3 light_tubes(vec3 albedo, vec3 n, vec3 v) {
  const float tubes = 24.0;
  vec3 m = normalize(reflect(-v, n) + vec3(0.0, 0.0, 1.0));
  float at = tubes * m.x / (1.0 + max(m.z, 0.0));
  float half_pixel = max(fwidth(at), 1e-6);
  float from_tube = abs(fract(at) - 0.5);  // 0.5 in the middle of a dark gap
  float lamp = 1.0 - smoothstep(0.25 - half_pixel, 0.25 + half_pixel, from_tube);
  lamp = mix(lamp, 0.5, smoothstep(0.3, 0.8, half_pixel));  // narrower than pixels: their mean, not a moire
  return lit(albedo, n, v) * mix(0.12, 1.0, lamp);
}
)";

inline constexpr const char* kTriangleVertex = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 normal;
layout(location = 2) in vec4 colour;
uniform mat4 view, projection;
out vec3 eye_position;
out vec3 eye_normal;
out vec3 albedo;
out vec3 corner;
#ifdef PAGE
layout(location = 3) in vec2 on_page;
out vec2 page_position;
#endif
void main() {
#ifdef PAGE
  page_position = vec2(on_page.x, 1.0 - on_page.y);  // rows of pages run from the top
#endif
  vec4 p = view * vec4(position, 1.0);
  eye_position = p.xyz;
  eye_normal = mat3(view) * normal.xyz;
  albedo = colour.rgb * colour.rgb;
  int i = gl_VertexID % 3;
  corner = vec3(i == 0, i == 1, i == 2);
  gl_Position = projection * p;
}
)";

inline constexpr const char* kTriangleFragment = R"(#version 450 core
in vec3 eye_position;
in vec3 eye_normal;
in vec3 albedo;
in vec3 corner;
uniform int orthographic;
uniform float wire_pixels;
uniform int cut_backs;
uniform int shade;
uniform vec4 back_colour;
#ifdef PAGE
in vec2 page_position;
uniform sampler2D page;
/// Mean of what a sample covers, in linear light. On a grazing face that is long: up to eight steps along it, each as wide as it is
/// (drivers' own anisotropic filters differ, and llvmpipe's is not bilinear where texels are large).
vec3 page_colour() {
  vec2 along = dFdx(page_position), across = dFdy(page_position), texels = vec2(textureSize(page, 0));
  float longer = length(along * texels), shorter = length(across * texels);
  if (longer < shorter) {
    vec2 turned = along; along = across; across = turned;
    float size = longer; longer = shorter; shorter = size;
  }
  int steps = int(clamp(ceil(longer / max(shorter, 1.0)), 1.0, 8.0));
  vec3 sum = vec3(0.0);
  for (int i = 0; i < steps; ++i) {
    float from_middle = (float(i) + 0.5) / float(steps) - 0.5;
    vec3 c = textureGrad(page, page_position + from_middle * along, along / float(steps), across).rgb;
    sum += c * c;
  }
  return sum / float(steps);
}
#endif
layout(location = 0) out vec4 colour;
layout(location = 1) out vec4 facing;
%LIGHT%
void main() {
#ifdef PAGE
  vec3 shown = page_colour();  // before anything is discarded: what it covers hangs on neighbours
#else
  vec3 shown = albedo;
#endif
  if (cut_backs != 0 && !gl_FrontFacing) discard;
  vec3 v = orthographic != 0 ? vec3(0.0, 0.0, 1.0) : normalize(-eye_position);
  float size = dot(eye_normal, eye_normal);
  vec3 n = size > 0.0 ? eye_normal * inversesqrt(size) : v;
  if (!gl_FrontFacing) n = -n;
  vec3 surface = gl_FrontFacing ? shown : back_colour.rgb * back_colour.rgb;
  if (wire_pixels > 0.0) {
    vec3 d = corner / max(fwidth(corner), vec3(1e-12));
    float near_edge = min(min(d.x, d.y), d.z);
    surface *= mix(0.12, 1.0, smoothstep(0.5 * wire_pixels - 0.5, 0.5 * wire_pixels + 0.5, near_edge));
  }
  vec3 light = shade == 1 ? glossy(surface, n, v) : shade == 2 ? light_tubes(surface, n, v) : lit(surface, n, v);
  colour = vec4(sqrt(light), 1.0);
  facing = vec4(0.5 * n + 0.5, 1.0);
}
)";

inline constexpr const char* kPointVertex = R"(#version 450 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 normal;
layout(location = 2) in vec4 colour;
uniform mat4 view, projection;
uniform int orthographic;
uniform float diameter_scale, least_pixels;
out vec3 eye_position;
out vec4 eye_normal;
out vec3 albedo;
void main() {
  vec4 p = view * vec4(position, 1.0);
  eye_position = p.xyz;
  eye_normal = vec4(mat3(view) * normal.xyz, normal.w);
  albedo = colour.rgb * colour.rgb;
  gl_Position = projection * p;
  float size = orthographic != 0 ? diameter_scale : diameter_scale / max(-p.z, 1e-30);
  gl_PointSize = clamp(size, least_pixels, 200.0);
}
)";

inline constexpr const char* kPointFragment = R"(#version 450 core
in vec3 eye_position;
in vec4 eye_normal;
in vec3 albedo;
uniform int orthographic, mark_back;
uniform vec4 back_colour;
layout(location = 0) out vec4 colour;
layout(location = 1) out vec4 facing;
%LIGHT%
void main() {
  vec2 off = gl_PointCoord - 0.5;
  if (dot(off, off) > 0.25) discard;
  vec3 v = orthographic != 0 ? vec3(0.0, 0.0, 1.0) : normalize(-eye_position);
  if (eye_normal.w < 0.5) {
    colour = vec4(sqrt(albedo * 0.9), 1.0);
    facing = vec4(0.5, 0.5, 1.0, 0.5);
    return;
  }
  vec3 n = normalize(eye_normal.xyz);
  vec3 surface = albedo;
  if (dot(n, v) < 0.0) {
    n = -n;
    if (mark_back != 0) surface = back_colour.rgb * back_colour.rgb;
  }
  colour = vec4(sqrt(lit(surface, n, v)), 1.0);
  facing = vec4(0.5 * n + 0.5, 0.5);
}
)";

// Two ends per instance, four corners each: core profile has no wide lines.
inline constexpr const char* kLineVertex = R"(#version 450 core
layout(location = 0) in vec3 start;
layout(location = 1) in vec3 stop;
layout(location = 2) in vec4 colour;
uniform mat4 view, projection;
uniform int orthographic;
uniform vec2 pixels;       // size of the view, samples
uniform float most_half_width, least_half_width;  // samples
uniform float edge_length;                        // of lines like these, scene units; 0 = any
uniform float near_plane;
uniform float eye_pixel;   // size of a sample, orthographic: scene units; perspective: at distance 1
out vec3 tint;
/// Full width from edges of about three pixels on, less in proportion.
float half_width_at(float eye_z) {
  if (edge_length <= 0.0) return most_half_width;
  float edge_samples = edge_length / (eye_pixel * (orthographic != 0 ? 1.0 : max(-eye_z, 1e-30)));
  return clamp(0.43 * edge_samples, least_half_width, most_half_width);
}
void main() {
  vec4 a = view * vec4(start, 1.0);
  vec4 b = view * vec4(stop, 1.0);
  if (orthographic == 0) {  // cut at the near plane, behind it the projection turns over
    float limit = -near_plane * 1.0001;
    if (a.z > limit && b.z > limit) { gl_Position = vec4(0.0, 0.0, 2.0, 1.0); tint = vec3(0.0); return; }
    if (a.z > limit) a.xyz = mix(b.xyz, a.xyz, (limit - b.z) / (a.z - b.z));
    if (b.z > limit) b.xyz = mix(a.xyz, b.xyz, (limit - a.z) / (b.z - a.z));
  }
  // Towards the viewer by a few times the line's width where it is, which is enough on steep faces and too little to
  // shine through a body. In perspective along the ray, so that it stays where it is on screen.
  float half_a = half_width_at(a.z), half_b = half_width_at(b.z);
  float width_a = 6.0 * half_a * eye_pixel * (orthographic != 0 ? 1.0 : -a.z);
  float width_b = 6.0 * half_b * eye_pixel * (orthographic != 0 ? 1.0 : -b.z);
  if (orthographic != 0) {
    a.z += width_a;
    b.z += width_b;
  } else {
    a.xyz *= max(1.0 - width_a / -a.z, 0.5);
    b.xyz *= max(1.0 - width_b / -b.z, 0.5);
  }
  vec4 p = projection * a;
  vec4 q = projection * b;
  vec2 along = (q.xy / q.w - p.xy / p.w) * pixels;
  float len = length(along);
  along = len > 1e-6 ? along / len : vec2(1.0, 0.0);
  vec2 across = vec2(-along.y, along.x);
  bool last = gl_VertexID >= 2;
  vec4 at = last ? q : p;
  vec2 shift = across * ((gl_VertexID & 1) != 0 ? 1.0 : -1.0) + along * (last ? 1.0 : -1.0);
  at.xy += shift * (last ? half_b : half_a) * 2.0 / pixels * at.w;
  tint = colour.rgb;
  gl_Position = at;
}
)";

inline constexpr const char* kLineFragment = R"(#version 450 core
in vec3 tint;
layout(location = 0) out vec4 colour;
layout(location = 1) out vec4 facing;
void main() {
  colour = vec4(tint, 1.0);
  facing = vec4(0.5, 0.5, 1.0, 1.0);
}
)";

inline constexpr const char* kScreenVertex = R"(#version 450 core
void main() {
  vec2 p = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
  gl_Position = vec4(p * 2.0 - 1.0, 0.0, 1.0);
}
)";

// facing.a: 1 on faces, 0.5 on points, whose normals are noisy: half the occlusion, no creases.
// One sample per pixel of the result, 20 taps on a spiral that turns from pixel to pixel in a 4 x 4 pattern;
// the last pass averages the pattern away.
inline constexpr const char* kOcclusionFragment = R"(#version 450 core
uniform sampler2D depths, facings;
uniform ivec4 rect;        // the view, pixels of the result; its beginning is below 0 where the band begins farther up
uniform int rows;          // of the band
uniform int samples;       // per pixel and axis
uniform int orthographic;
uniform vec2 half_size;
uniform vec2 planes;
uniform float radius;
uniform float strength;
layout(location = 0) out vec4 occlusion;
const int kTaps = 20;
vec3 position_at(ivec2 at, float d) {
  vec2 ndc = (vec2(at - rect.xy * samples) + 0.5) / vec2(rect.zw * samples) * 2.0 - 1.0;
  float z = orthographic != 0 ? mix(planes.x, planes.y, d)
                              : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
  return vec3(ndc * half_size * (orthographic != 0 ? 1.0 : z), -z);
}
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 at = pixel * samples + samples / 2;
  float d = texelFetch(depths, at, 0).r;
  occlusion = vec4(1.0);
  if (d >= 1.0) return;
  vec3 p = position_at(at, d);
  vec4 facing = texelFetch(facings, at, 0);
  vec3 n = normalize(facing.xyz * 2.0 - 1.0);
  float per_unit = float(rect.w * samples) / (2.0 * half_size.y * (orthographic != 0 ? 1.0 : -p.z));
  float reach = clamp(radius * per_unit, 4.0 * float(samples), 0.3 * float(rect.w * samples));
  // Turn by one of 16 angles (Bayer order), then by the golden angle from tap to tap: rotations by multiplication.
  int cell = (((pixel.x - rect.x) & 3) << 2) | ((pixel.y - rect.y) & 3);
  const int bayer[16] = int[16](0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5);
  vec2 turn = vec2(1.0, 0.0);
  const vec2 step16 = vec2(0.9238795, 0.3826834);
  for (int i = 0; i < bayer[cell]; ++i)
    turn = vec2(turn.x * step16.x - turn.y * step16.y, turn.x * step16.y + turn.y * step16.x);
  const vec2 golden = vec2(-0.7373689, 0.6754903);
  float sum = 0.0;
  ivec2 low = ivec2(rect.x, max(rect.y, 0)) * samples;
  ivec2 high = ivec2(rect.x + rect.z, min(rect.y + rect.w, rows)) * samples - 1;
  for (int i = 0; i < kTaps; ++i) {
    float share = (float(i) + 0.5) / float(kTaps);
    float r = reach * share * sqrt(share);
    turn = vec2(turn.x * golden.x - turn.y * golden.y, turn.x * golden.y + turn.y * golden.x);
    ivec2 there = at + ivec2(floor(turn * max(r, float(samples)) + 0.5));
    if (any(lessThan(there, low)) || any(greaterThan(there, high))) continue;
    float dd = texelFetch(depths, there, 0).r;
    if (dd >= 1.0) continue;
    vec3 v = position_at(there, dd) - p;
    float vv = dot(v, v);
    float world = max(r, float(samples)) / per_unit;
    // Only what stands clearly above the tangent plane, and not far in front of it, counts.
    float rise = max(dot(v, n) * inversesqrt(max(vv, 1e-30)) - 0.12, 0.0);
    float fade = max(1.0 - vv / (9.0 * world * world), 0.0);
    sum += rise * fade;
  }
  occlusion = vec4(1.0 - clamp(strength * facing.a * 1.9 * sum / float(kTaps), 0.0, 0.85));
}
)";

inline constexpr const char* kComposeFragment = R"(#version 450 core
uniform sampler2D colours, depths, facings, occlusions;
uniform ivec4 rect;
uniform int rows;
uniform int samples;
uniform int orthographic;
uniform vec2 planes;
uniform float near_size;   // depth difference that separates surfaces, scene units
layout(location = 0) out vec4 result;
float distance_at(ivec2 pixel) {
  float d = texelFetch(depths, pixel * samples + samples / 2, 0).r;
  return orthographic != 0 ? mix(planes.x, planes.y, d)
                           : planes.x * planes.y / (planes.y - d * (planes.y - planes.x));
}
/// 1 on a crease between here and there: faces that meet at 50 degrees or more, on one surface.
float crease(vec4 facing, float mine, ivec2 there) {
  vec4 other = texelFetch(facings, there * samples + samples / 2, 0);
  if (facing.a < 0.9 || other.a < 0.9 || abs(distance_at(there) - mine) > near_size) return 0.0;
  return 1.0 - smoothstep(0.40, 0.75, dot(normalize(facing.xyz * 2.0 - 1.0), normalize(other.xyz * 2.0 - 1.0)));
}
void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 sum = vec3(0.0);
  float cover = 0.0;
  for (int y = 0; y < samples; ++y) {
    for (int x = 0; x < samples; ++x) {
      vec4 c = texelFetch(colours, pixel * samples + ivec2(x, y), 0);
      sum += c.rgb * c.rgb * c.a;
      cover += c.a;
    }
  }
  float inverse = 1.0 / float(samples * samples);
  float mine = distance_at(pixel);
  float light = 0.0, weight = 0.0;
  ivec2 low = ivec2(rect.x, max(rect.y, 0));
  ivec2 last = ivec2(rect.x + rect.z, min(rect.y + rect.w, rows)) - 1;
  for (int y = -2; y < 2; ++y) {
    for (int x = -2; x < 2; ++x) {
      ivec2 there = clamp(pixel + ivec2(x, y), low, last);
      float w = max(1.0 - abs(distance_at(there) - mine) / near_size, 0.001);
      light += w * texelFetch(occlusions, there, 0).r;
      weight += w;
    }
  }
  vec4 facing = texelFetch(facings, pixel * samples + samples / 2, 0);
  float edge = max(crease(facing, mine, min(pixel + ivec2(1, 0), last)), crease(facing, mine, min(pixel + ivec2(0, 1), last)));
  light *= 1.0 - 0.45 * edge;
  float height = (float(pixel.y - rect.y) + 0.5) / float(rect.w);
  vec3 background = mix(vec3(0.70, 0.72, 0.74), vec3(0.93, 0.94, 0.95), height);
  vec3 linear = sum * inverse * (light / weight) + background * background * (1.0 - cover * inverse);
  result = vec4(sqrt(linear), 1.0);
}
)";

}  // namespace tessera::shaders
