/// \file sampled_field.h
/// A field that can be asked for at any point, as directed distances on some leaves of a block.
/// Source: thesis 2.2, 4.2.1.
#pragma once
#include <functional>
#include <span>

#include "kernels/field/directed_field.h"

namespace tessera {

/// Who knows the field. A pure function of the point, whatever was asked before.
class FieldSampler {
 public:
  struct Sample {
    bool there = false;   ///< the field is defined here
    double value = 0.0;   ///< signed distance, cells, < 0 inside
    Double3 normal = {};  ///< outward; need not be unit; zero where unknown
  };
  virtual ~FieldSampler() = default;
  /// At a node (global), or at the point `t` cells behind it on its edge along `axis`.
  [[nodiscard]] virtual Sample at(const Int3& node, std::size_t axis, double t) const = 0;
};

/// Nodes that are farther than `near` cells from the surface, or not there, are not valid; roots come by regula falsi.
/// \param corner  global node coordinates of the block's min corner  \param cells  multiples of 64
/// \param leaves  relative to the block, in leaves, each coordinate within [-1, cells / 8], in any order, no repeats
/// \post  values, signs and roots are those of the sampler, whatever the block is
DirectedField build_sampled_field(const Int3& corner, const Int3& cells, std::span<const Int3> leaves,
                                  const FieldSampler& sampler, double near,
                                  const std::function<void()>& pause = {});

/// What the field of so many leaves takes at most.
[[nodiscard]] constexpr std::uint64_t sampled_field_bytes(std::uint64_t leaves) {
  return leaves * (4096 + 512 * 4 + 3 * 64 * sizeof(EdgeRoot));
}

}  // namespace tessera
