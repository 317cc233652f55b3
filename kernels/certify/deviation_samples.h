/// \file deviation_samples.h
/// A surface cut into triangles small enough for a picture, with the distance to a reference at their
/// corners.
#pragma once
#include <array>
#include <functional>

#include "kernels/certify/certificate.h"
#include "kernels/mesh/closest_face.h"

namespace tessera {

struct DeviationTriangle {
  std::array<Double3, 3> corner;   ///< world
  std::array<float, 3> deviation;  ///< scan units; infinite beyond the limit
  Float3 normal;                   ///< of the face, not normalised
};

struct DeviationSampling {
  double edge = 0.0;       ///< > 0: no side of a triangle is longer; needles are cut along their length alone
  double limit = 0.0;      ///< > 0: the reference is complete within it of the core
  bool with_sign = false;  ///< negative behind the closest triangle of the reference
};

/// Hands out the triangles whose centroid lies in `core` (half-open), so that boxes which tile space give
/// each once.
void sample_deviation(const SurfaceFaces& surface, const Box3& core, const ClosestFaces& reference,
                      const DeviationSampling& options,
                      const std::function<void(const DeviationTriangle&)>& sink);

}  // namespace tessera
