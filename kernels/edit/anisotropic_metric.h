/// \file anisotropic_metric.h
/// Operators under which a deformation spreads evenly over a long support: those of its conformal map into the plane,
/// scaled to be as wide as it is long. Source: Botsch, thesis 6.2.4; Levy, Petitjean, Ray, Maillot 2002 (the map).
#pragma once
#include <cstdint>
#include <span>

#include "kernels/edit/edit_basis.h"
#include "solvers/laplacian.h"

namespace tessera {

struct AnisotropicReport {
  double ratio = 1.0;       ///< of the map's length to its width, before scaling
  std::size_t flipped = 0;  ///< faces that the map turns over
  double mean_quasi_conformal = 0.0;
};

/// Operators of all n vertices; away from support, handles and `order` rings around them there are no faces, and no weights.
/// \param order  of the energy that they are for
/// \throws InputError  support, handles and those rings together are no disk (says what they are instead)
Laplacian anisotropic_metric(const TriangleSpan& mesh, std::span<const std::int32_t> role, int order,
                             AnisotropicReport& report);

}  // namespace tessera
