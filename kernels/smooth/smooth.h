/// \file smooth.h
/// Smoothing of a mesh as a list of rounds. A round is one local rule on one block: it reads round_rings()
/// rings around a vertex and nothing else, so a mesh of any size is smoothed block by block with the same
/// bits as in one piece.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "kernels/smooth/coarse_system.h"
#include "kernels/smooth/denoise.h"
#include "kernels/smooth/normal_filter.h"
#include "kernels/smooth/polynomial_filter.h"
#include "kernels/smooth/surface_rows.h"

namespace tessera {

/// What the user asks for.
struct SmoothOptions {
  /// implicit, laplacian, bilaplacian, taubin, bilateral, denoise, curvature-flow (the whole mesh in core)
  std::string method = "implicit";
  std::string weights = "cotangent";  ///< or uniform
  int steps = 1;           ///< implicit, bilateral, denoise: passes with fresh weights; others: steps
  double lambda = 0.0;     ///< strength, no unit; 0 = the method's own
  int order = 0;           ///< 1 = membrane, 2 = thin plate; 0 = 2 for denoise, else 1
  int degree = 0;          ///< implicit: Chebyshev steps; 0 = as many as an error of 1e-3 asks for
  double tolerance = 0.0;  ///< no vertex moves farther, scan units; 0 = no limit
  double feature_angle_deg = 40.0;  ///< edges whose faces open more are kept as creases; 0 = none
  int normal_rounds = 8;            ///< bilateral, denoise
  int vertex_rounds = 10;           ///< bilateral
  double noise = 0.0;  ///< denoise: standard deviation along the normal, scan units; 0 = measured
  std::string crossings = "refuse";  ///< of jobs: faces that come to cross others give way; or keep

  void validate() const;  ///< throws UsageError naming the option; changes nothing
};

/// One local rule.
struct SmoothRound {
  bool by_normals = false;
  bool by_fits = false;  ///< denoise.h
  /// Implicit curvature flow (curvature_flow.h): no local rule, the block is the whole mesh.
  bool by_flow = false;
  NormalFilterOptions normals;  ///< by_normals, by_fits
  double noise = 0.0;           ///< by_fits
  SurfaceRowOptions rows;       ///< else; by_flow: creases, corners and borders stay where they are
  FilterOptions filter;         ///< else; by_flow: `degree` steps of strength `lambda`
  /// >= 0: the implicit step takes kCoarseCycles rounds, in each a coarse level and then a filter for what that leaves;
  /// degree and lowest eigenvalue of the filter are those of coarse_options()
  int cycle = -1;
  /// After by_fits: faces that lie turned over at the end are spread out (flipped_faces.h).
  bool unflips = false;
};
/// Each leaves about a tenth of the error: three make less than 1e-3 of the displacement.
constexpr int kCoarseCycles = 3;

/// The rounds that the options mean, in order. Long explicit methods are cut into rounds of at most 32 rings,
/// always at the same steps.
/// \throws UsageError from validate()
[[nodiscard]] std::vector<SmoothRound> smooth_rounds(const SmoothOptions& options);

[[nodiscard]] int round_rings(const SmoothRound& round);
/// Mean edges around a vertex that mostly hold all that a round reads there, where that is much less than the rings; else
/// 0.
double round_edges(const SmoothRound& round);

struct SmoothCounts {
  std::uint64_t vertices = 0;  ///< whose result is right
  std::uint64_t line = 0;      ///< of these, smoothed along a crease or border
  std::uint64_t fixed = 0;     ///< corners, junctions, non-manifold vertices
  std::uint64_t degenerate_faces = 0;
  /// by_flow: solved; more than steps where steps were cut, so as to fold no face.
  std::uint64_t flow_systems = 0;
  /// by_flow: whose vertices moved as one for the same reason, in every step.
  std::uint64_t faces_as_one = 0;
};

struct SmoothedBlock {
  std::vector<Double3> position;  ///< n
  std::vector<Float3> laplacian;  ///< n after a cycle of order 2, else empty
  std::vector<VertexRole> role;   ///< n
  /// n; 1 = wanted, round_rings() rings are in the block, the position is right.
  std::vector<std::uint8_t> complete;
  SmoothCounts counts;
};

/// \param wanted  n flags, 1 or 0, of the vertices to move, or empty: all
/// \pre the block is canonical, fewer than 2^30 faces
/// \throws InputError for a position that is not finite; by_flow: when the linear system has no solution
/// \throws ValidationError  by_flow: where even the shortest steps fold faces over
[[nodiscard]] SmoothedBlock smooth_block(const MeshBlock& block, const SmoothRound& round,
                                         std::span<const std::uint8_t> wanted = {});

/// Values of the coarse level's unknowns, by ascending name: those of the whole mesh, or all that a block sees.
struct CoarseSolution {
  std::vector<std::uint64_t> name;
  std::vector<CoarseValue> value;
};

/// One cycle of an implicit step with a coarse level.
/// \param block  as the step found it: what the rows are made from
/// \param now   n, where the vertices are after the cycles before
/// \param laplacian  order 2: n, what these cycles said of it, or empty in the first
/// \pre round.cycle >= 0; the solution holds all unknowns of the wanted vertices' surroundings
/// \throws as smooth_block()
[[nodiscard]] SmoothedBlock smooth_cycle(const MeshBlock& block, std::span<const Double3> now,
                                         std::span<const Float3> laplacian, const SmoothRound& round,
                                         const CoarseOptions& coarse, const CoarseSolution& solution,
                                         std::span<const std::uint8_t> wanted = {});

/// Where a vertex comes to rest: `to`, rounded to floats if a mesh of floats holds it, and drawn towards
/// `from` until it is no farther than `tolerance` (0 = no limit) from it. The distance computed from the
/// result does not exceed it.
/// \pre with `floats`, `from` is a float exactly
[[nodiscard]] Double3 limit_move(const Double3& from, const Double3& to, double tolerance, bool floats);

/// Bytes that smooth_block() or smooth_cycle() allocates for a block of so many vertices and faces.
[[nodiscard]] std::uint64_t smooth_bytes(std::uint64_t vertices, std::uint64_t faces,
                                         const SmoothRound& round);

}  // namespace tessera
