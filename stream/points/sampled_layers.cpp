#include "stream/points/sampled_layers.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>
#include <utility>

#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

/// Of the cells that cut a sampled cell so often per axis, how many hold a point.
template <int kPerAxis>
std::uint64_t occupied_cells(const CellSampler::Cell& cell, double size) {
  std::bitset<kPerAxis * kPerAxis * kPerAxis> hit;
  for (const Double3& p : cell.points) {
    std::size_t at = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double t = std::floor((p[a] - cell.min[a]) / (size / kPerAxis));
      at = at * kPerAxis + static_cast<std::size_t>(std::clamp(t, 0.0, kPerAxis - 1.0));
    }
    hit.set(at);
  }
  return hit.count();
}

/// Calls look(cell, part) for all cells, and then join(part) in their order: a part is what some cells after one another tell.
template <typename Part, typename Look, typename Join>
void for_all_cells(const std::vector<CellSampler::Cell>& cells, const Look& look, const Join& join) {
  constexpr std::size_t kCellsTogether = 64;  // a millisecond of work or so
  std::vector<Part> parts((cells.size() + kCellsTogether - 1) / kCellsTogether);
  parallel_for(parts.size(), [&](std::size_t k) {
    for (std::size_t c = k * kCellsTogether; c < std::min(cells.size(), (k + 1) * kCellsTogether); ++c)
      look(cells[c], parts[k]);
  });
  for (Part& part : parts) join(std::exchange(part, Part()));
}

}  // namespace

SampledLayers::SampledLayers(LayeredSampler& sampler) {
  parallel_for(layers_.size(), [&](std::size_t k) {
    CellSampler& from = sampler.layers()[k];
    layers_[k].cells = from.take();  // settles which cells are sampled
    layers_[k].size = from.size();
    layers_[k].share = from.share();
    layers_[k].crowded = from.any_crowded();
  });
}

std::vector<SpacingProbe> SampledLayers::probes() const {
  constexpr double kWidest = 8.0;  // spacings that a cell must hold, so that the 8th neighbour is in reach
  constexpr double kFactor = double{1 << LayeredSampler::kRatioBits};
  std::vector<SpacingProbe> out;
  for (const Layer& layer : layers_) {
    const double maximum =
        &layer == &layers_.front() ? std::numeric_limits<double>::infinity() : layer.size / kWidest;
    const double minimum = &layer == &layers_.back() ? 0.0 : layer.size / kWidest / kFactor;
    using Probes = std::vector<SpacingProbe>;
    for_all_cells<Probes>(
        layer.cells,
        [&](const CellSampler::Cell& c, Probes& found) {
          measure_spacing({c.min, layer.size, c.points}, layer.share, minimum, maximum, found);
        },
        [&](const Probes& found) { out.insert(out.end(), found.begin(), found.end()); });
  }
  return out;
}

double SampledLayers::double_cells_per_block(std::size_t layer) const {
  std::uint64_t blocks = 0, cells = 0;
  for (const CellSampler::Cell& c : layers_[layer].cells) {
    blocks += occupied_cells<2>(c, layers_[layer].size);
    cells +=
        std::max(occupied_cells<8>(c, layers_[layer].size), 4 * occupied_cells<4>(c, layers_[layer].size));
  }
  return blocks > 0 ? static_cast<double>(cells) / static_cast<double>(blocks) : 16.0;
}

ScaleHistogram SampledLayers::residuals(double radius) const {
  constexpr std::uint64_t kEnough = 100;
  ScaleHistogram out;
  std::size_t k = layers_.size() - 1;
  while (k > 0 && layers_[k].size < 4.0 * radius) --k;
  for (; k < layers_.size() && out.count() < kEnough; ++k)
    for_all_cells<ScaleHistogram>(
        layers_[k].cells,
        [&](const CellSampler::Cell& c, ScaleHistogram& found) {
          measure_residuals({c.min, layers_[k].size, c.points}, std::min(radius, layers_[k].size / 4), found);
        },
        [&](const ScaleHistogram& found) { out.add(found); });
  return out;
}

}  // namespace tessera
