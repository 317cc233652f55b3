#include "kernels/merge/blend_field.h"

namespace tessera {
namespace {

constexpr double kNearCells =
    3.0;  ///< how far from the surface nodes get a value: a cell and a half would do for roots

class BlendSampler : public FieldSampler {
 public:
  BlendSampler(const BlendBlock& block, const MergeBlend& blend) : block_(block), blend_(blend) {}
  Sample at(const Int3& node, std::size_t axis, double t) const override {
    const double h = block_.lattice.h;
    const MergeBlend::Value v = blend_.at(block_.at(node, axis, t), kNearCells * h);
    return {v.share > 0.0, v.distance / h, v.normal};
  }

 private:
  const BlendBlock& block_;
  const MergeBlend& blend_;
};

}  // namespace

Double3 BlendBlock::at(const Int3& node, std::size_t axis, double t) const {
  Double3 p;
  for (std::size_t k = 0; k < 3; ++k)
    p[k] = lattice.world(static_cast<int>(k), node[k] + (k == axis ? t : 0.0)) - origin[k];
  return p;
}

DirectedField build_blend_field(const BlendBlock& block, std::span<const Int3> leaves,
                                const MergeBlend& blend, const std::function<void()>& pause) {
  return build_sampled_field(block.corner, block.cells, leaves, BlendSampler(block, blend), kNearCells,
                             pause);
}

}  // namespace tessera
