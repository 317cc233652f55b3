#include "kernels/extract/extended_marching_cubes.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "kernels/extract/brick_extractor.h"
#include "octree/morton.h"

namespace tessera {

ExtractReport extract_surface(const DirectedField& field, const ExtractOptions& options,
                              const std::function<void(Patch&&)>& sink) {
  Int3 bricks;
  for (std::size_t a = 0; a < 3; ++a) {
    assert(field.cells[a] % kBrickCells == 0 && field.origin[a] % kBrickCells == 0);
    bricks[a] = field.cells[a] >> kBrickBits;
  }
  std::vector<std::pair<std::uint64_t, Int3>> order;
  for (int k = 0; k < bricks[2]; ++k) {
    for (int j = 0; j < bricks[1]; ++j) {
      for (int i = 0; i < bricks[0]; ++i) {
        const Int3 global = {(field.origin[0] >> kBrickBits) + i, (field.origin[1] >> kBrickBits) + j,
                             (field.origin[2] >> kBrickBits) + k};
        order.push_back({brick_key(global), {i, j, k}});
      }
    }
  }
  std::sort(order.begin(), order.end());
  ExtractReport report;
  BrickExtractor extractor(field, options);
  for (const auto& entry : order) {
    Patch patch = extractor.extract(entry.second, report);
    if (!patch.empty()) sink(std::move(patch));
  }
  return report;
}

Patch extract_level_brick(const LevelFields& fields, const LevelSurroundings& around, int level,
                          const ExtractOptions& options, ExtractReport& report) {
  const DirectedField mixed = mix_levels(fields, around);
  const LevelCells cells(fields, around, mixed);
  return BrickExtractor(mixed, options, level, &cells).extract({0, 0, 0}, report);
}

}  // namespace tessera
