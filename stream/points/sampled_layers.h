/// \file sampled_layers.h
/// What the cells of a layered sample tell of spacing and noise, each place by the layer that its density suits.
#pragma once
#include <array>
#include <vector>

#include "kernels/points/spacing.h"
#include "stream/points/point_sample.h"

namespace tessera {

class SampledLayers {
 public:
  /// Takes the cells; the sampler is spent.
  explicit SampledLayers(LayeredSampler& sampler);

  /// Every place once: by the layer whose cells are 8 to 32 of its spacings wide, beyond the ends by the last.
  std::vector<SpacingProbe> probes() const;
  /// Residuals within `radius`, or as near to it as cells with enough points allow.
  ScaleHistogram residuals(double radius) const;
  /// Some cells of the finest layer hold too many points to be looked at.
  bool too_dense() const { return layers_.back().crowded; }
  /// Of cells that cut those of a layer eight times per axis, how many the surface crosses, for each of those that cut them
  /// twice: with cells of 16 h, which are hit wherever the surface is, cells of 2 h in a block of 8 h. Those that hold a
  /// point, but four, as of a plane, of each of twice the edge that does: points may lie farther apart. 16 without any.
  double double_cells_per_block(std::size_t layer) const;
  const std::vector<CellSampler::Cell>& cells(std::size_t layer) const { return layers_[layer].cells; }

 private:
  struct Layer {
    double size = 0.0;
    double share = 1.0;  ///< of all cells
    bool crowded = false;
    std::vector<CellSampler::Cell> cells;
  };
  std::array<Layer, LayeredSampler::kLayers> layers_;  ///< coarsest first
};

}  // namespace tessera
