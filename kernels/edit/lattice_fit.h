/// \file lattice_fit.h
/// The smoothest displacement of space that brings points of a surface onto planes: weighted least squares of the distances along
/// normals, with the energy of derivatives of one order (2: thin plate) as the price.
///
/// Sources: Chen, Medioni, "Object modelling by registration of multiple range images", 1992 (distances to planes: surfaces slide
/// along each other freely); Eilers, Marx, "Flexible smoothing with B-splines and penalties", 1996 (differences of coefficients
/// for derivatives); Bramble, Pasciak, Xu, "Parallel multilevel preconditioners", 1990. Sums run in the order of samples and nodes.
#pragma once
#include <cstddef>
#include <span>

#include "kernels/edit/displacement_lattice.h"

namespace tessera {

/// A place of the surface that shall come to lie on a plane.
struct PlaneSample {
  Double3 at{};         ///< before it is moved
  Double3 normal{};     ///< unit, of the plane
  double offset = 0.0;  ///< the displacement's component along the normal that is asked for
  double weight = 1.0;  ///< >= 0
};

struct LatticeFitOptions {
  int order = 2;  ///< of the derivatives that cost, 1 to 3; polynomials of a lower degree cost nothing
  double stiffness = 1.0;  ///< mean square that a unit of energy (integral over space) costs, > 0
  double hold =
      1e-4;  ///< of the displacement itself, against the data: it does not slide where nothing asks for it
  double tolerance = 1e-4;  ///< residual of the equations, of the one at rest
  int max_iterations = 200;
};

struct LatticeFitReport {
  int iterations = 0;
  double residual = 0.0;  ///< as LatticeFitOptions::tolerance
};

/// Fits. \param lattice  in: where the iteration begins
/// \param coarser  how often the lattice was refined since it was made: levels of the preconditioner
/// \pre weights add up to more than 0
LatticeFitReport fit_lattice(DisplacementLattice& lattice, std::size_t coarser,
                             std::span<const PlaneSample> samples, const LatticeFitOptions& options);

/// Upper bound of what it allocates beside the samples.
constexpr std::size_t lattice_fit_bytes(std::size_t nodes) {
  return nodes * sizeof(Double3) * 12;
}

}  // namespace tessera
