/// \file feature_sample.h
/// Detection and sampling of the sharp feature that one loop of a cell passes.
/// Source: thesis 4.2.2; Kobbelt, Botsch, Schwanecke, Seidel, "Feature Sensitive Surface Extraction", 2001.
/// Coordinates are in cells, relative to the cell's min corner, so decisions do not depend on the brick.
#pragma once
#include <array>

#include "kernels/extract/cell_loops.h"
#include "kernels/field/directed_field.h"

namespace tessera {

/// Node of each edge of a cell relative to the cell's, with 0 in place of the root's t along the edge.
inline constexpr std::array<Float3, kCellEdges> kEdgeBase = [] {
  std::array<Float3, kCellEdges> bases{};
  for (int e = 0; e < kCellEdges; ++e)
    for (int a = 0; a < 3; ++a)
      bases[static_cast<std::size_t>(e)][static_cast<std::size_t>(a)] = static_cast<float>(edge_offset(e, a));
  return bases;
}();

/// A root on an edge of a cell, where its vertex stands.
[[nodiscard]] inline Float3 point_in_cell(int edge, const EdgeRoot& root) {
  Float3 p = kEdgeBase[static_cast<std::size_t>(edge)];
  p[static_cast<std::size_t>(edge >> 2)] = root.t;
  return p + root.slide_offset();
}

/// Roots of one loop in order, with their tangent planes normal.(x - point) = offset.
struct LoopSamples {
  int size = 0;
  const std::uint8_t* edge = nullptr;  ///< cell edges, in order
  std::array<Float3, kCellEdges> point;
  std::array<Float3, kCellEdges> normal;
  std::array<float, kCellEdges> offset;
};

struct FeatureThresholds {
  float cone_cos = 0.0f;    ///< smallest dot of two normals without a feature
  float quick_dot = 0.0f;   ///< all normals this close to the first: surely no feature
  float corner_sin = 0.0f;  ///< largest |normal . crease direction| of a crease
  /// Normals and roots are exact: a sample may leave its cell by a cell, not a quarter, and its fan may lean over at
  /// segments that will be flipped.
  bool exact = true;
  bool in_faces = false;  ///< as ExtractOptions::in_faces
};

/// Angles in degrees, within (0, 180) and (0, 90). Exact on every machine: no libm.
[[nodiscard]] FeatureThresholds feature_thresholds(double feature_angle_deg, double corner_angle_deg);

enum class FeatureKind { kNone, kCrease, kCorner, kRejected };

struct FeatureSample {
  FeatureKind kind = FeatureKind::kNone;
  Float3 position = {0, 0, 0};
  /// false: the sample had to be drawn back towards the loop, it is not on the feature.
  bool on_feature = false;
};

/// Cone test, classification, least-squares sample and its clamp.
/// \post kind crease or corner: every triangle (point i, point i+1, position) has an area above zero, also in
///       brick coordinates rounded to float, and is not turned against its normals
[[nodiscard]] FeatureSample sample_feature(const LoopSamples& loop, const FeatureThresholds& thresholds);

/// True when the triangle's smallest height is too close to zero to survive rounding to float.
[[nodiscard]] bool is_sliver(const Float3& a, const Float3& b, const Float3& c);

}  // namespace tessera
