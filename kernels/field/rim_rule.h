/// \file rim_rule.h
/// Whether the samples go on around a foot point, however unevenly they lie.
#pragma once
#include "kernels/field/sample_clusters.h"

namespace tessera {

/// True if the samples that belong to the surface at the foot point of a node see it from all sides and one
/// of them from near: no angle of 135 degrees about it, in its tangent plane, is empty. Samples belong to the
/// surface if their normals lie within 60 degrees of its own and they themselves within `thickness` of its
/// tangent plane. Counts, not weights, decide: so it holds where dense samples on one side outweigh sparse
/// ones on the other, and in gaps of up to twice `within`, but never beyond the border of a half plane.
/// \param samples   within the radius, relative to the node
/// \param value     signed distance of the node from the surface
/// \param gradient  unit, outward
/// \param thickness, within  cells
[[nodiscard]] bool is_surrounded(const LocalSamples& samples, float value, const Float3& gradient,
                                 float thickness, float within);

}  // namespace tessera
