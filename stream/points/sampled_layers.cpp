#include "stream/points/sampled_layers.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>

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

}  // namespace

SampledLayers::SampledLayers(LayeredSampler& sampler) {
  for (std::size_t k = 0; k < layers_.size(); ++k) {
    CellSampler& from = sampler.layers()[k];
    layers_[k].cells = from.take();  // settles which cells are sampled
    layers_[k].size = from.size();
    layers_[k].share = from.share();
    layers_[k].crowded = from.any_crowded();
  }
}

std::vector<SpacingProbe> SampledLayers::probes() const {
  constexpr double kWidest = 8.0;  // spacings that a cell must hold, so that the 8th neighbour is in reach
  constexpr double kFactor = double{1 << LayeredSampler::kRatioBits};
  std::vector<SpacingProbe> out;
  for (const Layer& layer : layers_) {
    const double maximum =
        &layer == &layers_.front() ? std::numeric_limits<double>::infinity() : layer.size / kWidest;
    const double minimum = &layer == &layers_.back() ? 0.0 : layer.size / kWidest / kFactor;
    for (const CellSampler::Cell& c : layer.cells)
      measure_spacing({c.min, layer.size, c.points}, layer.share, minimum, maximum, out);
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
    for (const CellSampler::Cell& c : layers_[k].cells)
      measure_residuals({c.min, layers_[k].size, c.points}, std::min(radius, layers_[k].size / 4), out);
  return out;
}

}  // namespace tessera
