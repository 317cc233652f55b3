#include "kernels/edit/layer_levels.h"

#include <algorithm>

#include "kernels/remesh/remesh.h"

namespace tessera {
namespace {

constexpr std::size_t kLevelRatio = 8,
                      kLevelStep = 4;  ///< of faces: a level more where so many wait, and its own

}  // namespace

std::vector<LayerLevel> layer_levels(std::span<const Double3> surface,
                                     std::span<const std::array<std::uint32_t, 3>> faces,
                                     std::span<const std::uint8_t> free, std::size_t coarse_faces) {
  std::vector<std::size_t> wanted;
  for (std::size_t w = coarse_faces; wanted.empty() || kLevelRatio * w < faces.size(); w *= kLevelStep)
    wanted.push_back(w);
  std::vector<LayerLevel> out;
  out.reserve(wanted.size());
  std::vector<Double3> fine(surface.begin(), surface.end());
  for (; !wanted.empty(); wanted.pop_back()) {
    LayerLevel next;
    next.coarse = coarse_layer(fine, faces, free, wanted.back());
    if (next.coarse.faces.empty()) break;
    std::vector<Double3> at = next.coarse.at(fine);
    const BaseState state(at, next.coarse.faces);
    const DisplacementEncoder encoder(state);
    double far = 0.0;
    for (const Double3& p : at) far = std::max(far, norm(p - at.front()));
    next.finer.of.resize(fine.size());
    for (std::uint32_t v = 0; v < fine.size(); ++v) {
      if (!free[v]) continue;
      TangentRest rest;
      next.finer.of[v] = encoder.encode(fine[v], far, rest);
      if ((next.finer.of[v].face & kHasTangent) == 0) continue;
      rest.point = v;
      next.finer.rest.push_back(rest);
    }
    out.push_back(std::move(next));
    fine = std::move(at);
    faces = out.back().coarse.faces;
    free = out.back().coarse.free;
  }
  return out;
}

std::uint64_t layer_levels_bytes(std::uint64_t faces) {
  const std::uint64_t maximum = faces + 20000;  // what the coarse copy may have besides
  return remesh_bytes(maximum, maximum, false) + 2 * DisplacementEncoder::bytes(maximum) + 300 * maximum;
}

}  // namespace tessera
