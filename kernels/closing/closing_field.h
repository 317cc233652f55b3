/// \file closing_field.h
/// The field that closes a surface where its samples end.
///
/// The quadric that fits the samples around a gap continues the surface smoothly; the winding number knows which side
/// is which however large the gap. Where the quadric explains the normals its distance is taken; where it does not,
/// or denies what the winding number is sure of, the first-order distance to the winding number's level fades in.
#pragma once
#include <algorithm>
#include <span>

#include "octree/quadric_field.h"
#include "octree/winding_number.h"

namespace tessera {

class ClosingField {
 public:
  /// \param far, near  as WindingField wants them
  /// \param radius     support radius of a sample, cells
  /// \param noise      of the samples, cells: normals at the rims of noisy scans bend, so quadrics lose their say there and
  ///                   holes get membranes
  ClosingField(const MultipoleTree& far, const MultipoleTree& near, float radius, float noise = 0.0f)
      : winding_(far, near), quadric_(far, near, kCoreRadii * radius), noisy_(noisiness(noise)) {}
  ClosingField(const MultipoleTree& tree, float radius, float noise = 0.0f)
      : winding_(tree), quadric_(tree, kCoreRadii * radius), noisy_(noisiness(noise)) {}

  [[nodiscard]] const WindingField& winding() const { return winding_; }

  /// Signed distance, cells, positive outside; at most kFarthest in size.
  /// \param level  of the winding number that counts as the surface
  /// \param queries  as WindingField::evaluate() wants them
  void evaluate(std::span<const Int3> queries, float level, std::span<float> value) const;

  static constexpr float kFarthest = 64.0f;
  /// Noise up to which samples count as exact, and from which as noisy: cells.
  static constexpr float kExactNoise = 0.03f, kFullNoise = 0.1f;

 private:
  static float noisiness(float noise) {
    return std::clamp((noise - kExactNoise) / (kFullNoise - kExactNoise), 0.0f, 1.0f);
  }

  /// So that 1 / (d^2 + core^2)^4 falls off beside a sample as the kernel of the local fit, (1 - d^2 / r^2)^4, does.
  static constexpr float kCoreRadii = 1.0f;

  WindingField winding_;
  QuadricField quadric_;
  float noisy_;  ///< 0 exact, 1 noisy
};

}  // namespace tessera
