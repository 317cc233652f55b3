#include "kernels/edit/coarse_layer.h"

#include <algorithm>
#include <cmath>

#include "kernels/edit/normal_displacement.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/remesh/remesh.h"
#include "octree/edge_faces.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;

constexpr double kCreaseAngle = 40.0;
/// Edges between 4/5 and 4/3 of the length make so many more faces than equilateral ones would.
constexpr double kMoreFaces = 1.2;
constexpr double kOnVertex = 1e-3;  ///< weights below it do not make a coarse vertex free

std::vector<Face> manifold_part(std::span<const Face> faces, std::span<const std::uint8_t> free) {
  std::vector<Face> part;
  for (const Face& f : faces)
    if ((free[f[0]] || free[f[1]] || free[f[2]]) && f[0] != f[1] && f[1] != f[2] && f[2] != f[0])
      part.push_back(f);
  const auto from = [&](std::uint32_t half) { return part[half / 3][half % 3]; };
  std::vector<std::uint8_t> bad(part.size(), 0);
  EdgeFaces(free.size(), part)
      .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
        if (half.size() == 1 || (half.size() == 2 && from(half[0]) != from(half[1]))) return;
        for (const std::uint32_t h : half) bad[h / 3] = 1;
      });
  std::vector<Face> out;
  for (std::size_t f = 0; f < part.size(); ++f)
    if (!bad[f]) out.push_back(part[f]);
  return out;
}

}  // namespace

std::vector<Double3> CoarseLayer::at(std::span<const Double3> fine) const {
  std::vector<Double3> out;
  out.reserve(on.size());
  for (std::size_t v = 0; v < on.size(); ++v)
    out.push_back(fine[on[v][0]] * weight[v][0] + fine[on[v][1]] * weight[v][1] +
                  fine[on[v][2]] * weight[v][2]);
  return out;
}

CoarseLayer coarse_layer(std::span<const Double3> surface, std::span<const Face> faces,
                         std::span<const std::uint8_t> free, std::size_t wanted_faces) {
  CoarseLayer out;
  MeshBlock block;
  block.faces = manifold_part(faces, free);
  if (block.faces.empty()) return out;
  std::vector<std::uint32_t> number(surface.size(), 0);
  for (const Face& f : block.faces)
    for (const std::uint32_t v : f) number[v] = 1;
  for (std::uint32_t v = 0; v < surface.size(); ++v) {
    if (number[v] == 0) continue;
    number[v] = static_cast<std::uint32_t>(block.key.size());
    block.key.push_back(v);
    block.position.push_back(surface[v]);
  }
  block.vertex_class.assign(block.key.size(), VertexClass{});
  double area = 0.0;
  for (Face& f : block.faces) {
    for (std::uint32_t& v : f) v = number[v];
    area += 0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
  }
  if (!(area > 0.0)) return out;
  block.face_flags.assign(block.faces.size(), 0);
  EdgeFaces(block.key.size(), block.faces)
      .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
        if (half.size() == 1) block.face_flags[half[0] / 3] |= static_cast<std::uint8_t>(1u << half[0] % 3);
      });
  canonicalise(block);  // remesh() wants its reference so
  const std::vector<Face> part = block.faces;
  const std::vector<Double3> part_position = block.position;
  const std::vector<std::uint64_t> part_key = block.key;

  RemeshOptions remeshing;
  remeshing.edge = std::sqrt(kMoreFaces * 4.0 * area / (std::sqrt(3.0) * static_cast<double>(wanted_faces)));
  remeshing.float_positions = false;
  remeshing.feature_angle_deg = kCreaseAngle;
  remeshing.last_relaxations = 0;  // prisms on it need no cells alike
  remeshing.find_creases = true;
  remeshing.max_faces = std::max(2 * wanted_faces, block.faces.size());
  remeshing.first_key = std::uint64_t{1} << 40;
  const MeshBlock reference = block;
  remesh(block, reference, remeshing);

  out.surface = std::move(block.position);
  out.faces = std::move(block.faces);
  const BaseState fine(part_position, part);
  const DisplacementEncoder encoder(fine);
  const double far = norm(out.surface.front()) + remeshing.edge;
  for (const Double3& p : out.surface) {
    TangentRest unused;
    const NormalDisplacement d = encoder.encode(p, far, unused);
    const Face& f = part[d.face & ~kHasTangent];
    const double u = d.u / 65535.0, v = d.v / 65535.0;
    const std::array<double, 3> weight = {1.0 - u - v, u, v};
    std::array<std::uint32_t, 3> on{};
    std::uint8_t is_free = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      on[k] = static_cast<std::uint32_t>(part_key[f[k]]);
      if (weight[k] > kOnVertex && free[on[k]]) is_free = 1;
    }
    out.on.push_back(on);
    out.weight.push_back(weight);
    out.free.push_back(is_free);
  }
  EdgeFaces(out.surface.size(), out.faces)
      .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
        if (half.size() == 1) out.free[low] = out.free[high] = 0;
      });
  return out;
}

}  // namespace tessera
