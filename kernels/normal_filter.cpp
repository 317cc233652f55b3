#include "kernels/normal_filter.h"

#include <cmath>

#include "kernels/face_corners.h"
#include "kernels/portable_math.h"

namespace tessera {
namespace {

using synth::Vec3;

Vec3 point(const Double3& p) {
  return {p[0], p[1], p[2]};
}

/// exp(-t), nearly: within 0.013 of it, zero from t = 16.
float bell(float t) {
  float u = 1.0F - t * 0.0625F;
  u = u > 0.0F ? u : 0.0F;
  u *= u;
  u *= u;
  u *= u;
  return u * u;
}

/// What stays the same over all rounds on normals.
struct FaceFrame {
  Vec3 centre;
  float area = 0.0F;
  float inverse_width = 0.0F;  ///< 1 / (2 x squared mean distance to the neighbours' centres)
};

void make_frames(const MeshBlock& block, std::vector<FaceFrame>& frames, std::vector<Float3>& normals) {
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    const auto& face = block.faces[f];
    const Vec3 p = point(block.position[face[0]]), q = point(block.position[face[1]]),
               r = point(block.position[face[2]]);
    frames[f].centre = (p + q + r) * (1.0 / 3.0);
    const Vec3 area = cross(q - p, r - p);
    const double doubled = length(area);
    if (!(doubled > 0.0)) continue;
    frames[f].area = static_cast<float>(0.5 * doubled);
    normals[f] = {static_cast<float>(area.x / doubled), static_cast<float>(area.y / doubled),
                  static_cast<float>(area.z / doubled)};
  }
}

/// Calls sink(g) for every face that shares a vertex with f, once for each vertex shared, f itself left out.
template <typename Sink>
void for_each_neighbour(const MeshBlock& block, const FaceCorners& corners, std::uint32_t f, Sink&& sink) {
  for (const std::uint32_t v : block.faces[f])
    for (const std::uint32_t corner : corners.at(v))
      if (corner >> 2 != f) sink(corner >> 2);
}

void set_widths(const MeshBlock& block, const FaceCorners& corners, std::vector<FaceFrame>& frames) {
  for (std::uint32_t f = 0; f < frames.size(); ++f) {
    double sum = 0.0;
    int count = 0;
    for_each_neighbour(block, corners, f, [&](std::uint32_t g) {
      sum += length(frames[g].centre - frames[f].centre);
      ++count;
    });
    if (count > 0 && sum > 0.0)
      frames[f].inverse_width = static_cast<float>(0.5 * count * count / (sum * sum));
  }
}

std::vector<Float3> filter_normals(const MeshBlock& block, const FaceCorners& corners,
                                   const NormalFilterOptions& options) {
  const std::size_t m = block.faces.size();
  std::vector<FaceFrame> frames(m);
  std::vector<Float3> normals(m, Float3{0, 0, 0}), next(m, Float3{0, 0, 0});
  make_frames(block, frames, normals);
  set_widths(block, corners, frames);
  const double range = 2.0 * synth::sin_cos(options.range_angle_deg * (synth::kPi / 360.0)).sin;
  const float inverse_range = static_cast<float>(0.5 / (range * range));
  for (int round = 0; round < options.normal_rounds; ++round) {
    for (std::uint32_t f = 0; f < m; ++f) {
      const FaceFrame& here = frames[f];
      const Float3 n = normals[f];
      float x = here.area * n[0], y = here.area * n[1], z = here.area * n[2];
      for_each_neighbour(block, corners, f, [&](std::uint32_t g) {
        const FaceFrame& there = frames[g];
        const Vec3 apart = there.centre - here.centre;
        const Float3& k = normals[g];
        const float a = k[0] - n[0], b = k[1] - n[1], c = k[2] - n[2];
        const float w = there.area * bell(static_cast<float>(dot(apart, apart)) * here.inverse_width) *
                        bell((a * a + b * b + c * c) * inverse_range);
        x += w * k[0];
        y += w * k[1];
        z += w * k[2];
      });
      const float size = std::sqrt(x * x + y * y + z * z);
      next[f] = size > 0.0F ? Float3{x / size, y / size, z / size} : n;
    }
    normals.swap(next);
  }
  return normals;
}

}  // namespace

int filter_rings(const NormalFilterOptions& options) {
  return options.normal_rounds + options.vertex_rounds;
}

std::vector<Float3> filter_normals(const MeshBlock& block, const NormalFilterOptions& options) {
  return filter_normals(block, FaceCorners(block), options);
}

std::vector<Double3> filter_by_normals(const MeshBlock& block, const NormalFilterOptions& options) {
  const FaceCorners corners(block);
  const std::vector<Float3> normals = filter_normals(block, corners, options);
  std::vector<Double3> now = block.position, next = block.position;
  for (int round = 0; round < options.vertex_rounds; ++round) {
    for (std::uint32_t v = 0; v < now.size(); ++v) {
      const auto star = corners.at(v);
      if (star.empty()) continue;
      const Vec3 here = point(now[v]);
      Vec3 move;
      for (const std::uint32_t corner : star) {
        const std::uint32_t f = corner >> 2;
        const auto& face = block.faces[f];
        const Vec3 to_centre =
            ((point(now[face[0]]) - here) + (point(now[face[1]]) - here) + (point(now[face[2]]) - here)) *
            (1.0 / 3.0);
        const Vec3 n = {normals[f][0], normals[f][1], normals[f][2]};
        move = move + n * dot(n, to_centre);
      }
      move = move * (1.0 / static_cast<double>(star.size()));
      next[v] = {here.x + move.x, here.y + move.y, here.z + move.z};
    }
    now.swap(next);
  }
  return now;
}

}  // namespace tessera
