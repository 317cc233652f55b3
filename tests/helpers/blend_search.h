/// \file blend_search.h
/// The search for blends over one block, as the job does it over many.
#pragma once
#include <vector>

#include "kernels/blends/blend_curves.h"
#include "kernels/blends/curvature_tensors.h"

namespace tessera::test {

inline std::vector<BlendCurve> search_blends(const MeshBlock& block, double radius, double step) {
  BandOptions options;
  options.radius = radius;
  const std::vector<CurvatureTensor> curvatures =
      curvature_tensors(block, std::vector<std::uint8_t>(block.key.size(), 1), radius);
  constexpr std::uint32_t kNone = 0xffffffffu;
  std::vector<BandVertex> band;
  std::vector<std::uint32_t> slot(curvatures.size(), kNone);
  for (std::size_t v = 0; v < curvatures.size(); ++v) {
    if (!is_in_band(curvatures[v].across, curvatures[v].minimum, options)) continue;
    slot[v] = static_cast<std::uint32_t>(band.size());
    band.push_back(
        {block.key[v], block.position[v], curvatures[v].normal, curvatures[v].along, curvatures[v].across});
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> links;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = slot[f[k]], b = slot[f[(k + 1) % 3]];
      if (a != kNone && b != kNone) links.push_back({a, b});
    }
  return trace_bands(band, links, options, step);
}

}  // namespace tessera::test
