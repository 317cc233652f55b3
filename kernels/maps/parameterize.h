/// \file parameterize.h
/// Maps a disk-like mesh into the plane, in core.
///
/// conformal  minimises the Dirichlet energy with the border on a circle or square by arc length: one
/// Laplacian system,
///            two right-hand sides. Pinkall and Polthier 1993; Desbrun, Meyer, Alliez 2002; thesis 7.3.7.
/// lscm       minimises the least-squares conformal energy with a free border: Dirichlet energy minus area,
/// which is
///            the sum over faces of the squared Cauchy-Riemann residual (Levy, Petitjean, Ray, Maillot 2002;
///            the identity is in Pinkall and Polthier 1993). Two far apart border vertices are pinned. A factor
///            solves one system of twice the size; where it would not fit, multigrid solves the complex
///            form to a residual of 1e-8 (hermitian_multigrid.h).
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "solvers/laplacian.h"
#include "solvers/linear_solver.h"

namespace tessera {

enum class ParameterMethod : std::uint8_t { kConformal, kLeastSquaresConformal };
enum class ParameterBorder : std::uint8_t { kCircle, kSquare };

struct ParameterizeOptions {
  ParameterMethod method = ParameterMethod::kLeastSquaresConformal;
  ParameterBorder border = ParameterBorder::kCircle;  ///< conformal only
  /// Conformal only: negative cotangents become 0; then no triangle flips (Tutte 1963).
  bool clamp_weights = false;
  /// Beside the mesh; 0 = no limit. A factor that is predicted not to fit is not tried: multigrid serves.
  std::uint64_t memory_bytes = 0;
};

/// How far a map is from conformal, over all faces with an area.
struct ParameterDistortion {
  double mean_angle_deg = 0.0;  ///< mean change of an angle
  double largest_angle_deg = 0.0;
  double mean_quasi_conformal = 0.0;  ///< mean, by area, of the ratio of the two stretches; 1 = conformal
  double largest_area_ratio = 0.0;    ///< largest area scale over the mean area scale
  std::uint64_t flipped = 0;          ///< faces with negative area in the plane
  std::uint64_t collapsed = 0;        ///< faces with no area in the plane
};

struct ParameterizeReport {
  std::size_t unknowns = 0;
  std::size_t negative_weights = 0;
  FactorReport factor;
  std::string choice;  ///< a sentence for the log, which solver and why
  SolveReport solve;
  ParameterDistortion distortion;
};

struct Parameterization {
  std::vector<Double2> uv;  ///< n, within [0, 1]^2, counter-clockwise faces stay so; unused vertices at 0
  ParameterizeReport report;
};

/// The least that parameterize() takes beside the mesh, in bytes: by multigrid, and the coordinates.
[[nodiscard]] std::uint64_t parameterize_bytes(std::uint64_t vertices, ParameterMethod method);

/// \param mesh  a disk (disk_topology.h)
/// \throws InputError     not a disk (says what it is), a vertex that is not finite, a face without an area
/// \throws ResourceError  less memory than parameterize_bytes(), or multigrid does not converge
[[nodiscard]] Parameterization parameterize(const TriangleSpan& mesh, const ParameterizeOptions& options);

[[nodiscard]] ParameterDistortion measure_distortion(const TriangleSpan& mesh,
                                                     const std::vector<Double2>& uv);

}  // namespace tessera
