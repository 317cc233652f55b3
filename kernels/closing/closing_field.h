/// \file closing_field.h
/// The field that closes a surface where its samples end.
///
/// The quadric that fits the samples around a gap continues the surface smoothly; the winding number knows which side
/// is which however large the gap. Where the quadric explains the normals its distance is taken; where it does not,
/// or denies what the winding number is sure of, the first-order distance to the winding number's level fades in.
#pragma once
#include <span>

#include "octree/quadric_field.h"
#include "octree/winding_number.h"

namespace tessera {

class ClosingField {
 public:
  /// \param far, near  as WindingField wants them
  /// \param radius     support radius of a sample, cells
  ClosingField(const MultipoleTree& far, const MultipoleTree& near, float radius)
      : winding_(far, near), quadric_(far, near, kCoreRadii * radius) {}
  ClosingField(const MultipoleTree& tree, float radius)
      : winding_(tree), quadric_(tree, kCoreRadii * radius) {}

  const WindingField& winding() const { return winding_; }

  /// Signed distance, cells, positive outside; at most kFarthest in size.
  /// \param level  of the winding number that counts as the surface
  /// \param queries  as WindingField::evaluate() wants them
  void evaluate(std::span<const Int3> queries, float level, std::span<float> value) const;

  static constexpr float kFarthest = 64.0f;

 private:
  /// So that 1 / (d^2 + core^2)^4 falls off beside a sample as the kernel of the local fit, (1 - d^2 / r^2)^4, does.
  static constexpr float kCoreRadii = 1.0f;

  WindingField winding_;
  QuadricField quadric_;
};

}  // namespace tessera
