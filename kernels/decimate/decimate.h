/// \file decimate.h
/// Edge-collapse decimation of one block of mesh inside a two-sided tolerance to the reference.
/// A vertex is free if its star is complete: each edge at it has two faces in the block, or one and the flag of a
/// border. All other vertices are locked: they keep key, position and attributes bit for bit, and edges between two
/// locked vertices with less than two faces in the block stay. So blocks of one pass may run in any order or at once.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "kernels/decimate/auto_tolerance.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// What decides the order of collapses. Lower is earlier; equal costs fall to the lower place in the block.
enum class DecimatePriority : std::uint8_t {
  kQuadric,          ///< area-weighted squared distance to the planes of the original faces
  kProbabilistic,    ///< the same with uncertain planes: well posed everywhere, rounder triangles
  kSampleDistance,   ///< one-sided distance from the original samples to the new faces
  kNormalDeviation,  ///< largest turn of a new face against the original normals that it stands for
  kMeanRatio,        ///< worst triangle first out
  kEdgeLength,       ///< shortest edge first
};

enum class DecimatePlacement : std::uint8_t {
  kEndpoint,  ///< halfedge collapse into the better endpoint: vertices stay a subset of the input's
  kOptimal,   ///< minimum of the quadric where it is legal, otherwise the better endpoint
};

/// Costs are put into classes, eight to a factor of two of the (squared) cost in scan units: integers, so
/// that histograms of many blocks add up in any order and one threshold means the same in all of them.
inline constexpr std::size_t kCostClasses = 2048;

struct DecimateOptions {
  /// Two-sided distance to the reference, scan units; 0 = not tested (plain quadrics).
  double tolerance = 0.0;
  std::uint32_t max_cost_class = kCostClasses - 1;  ///< collapses of a higher class are not done
  DecimatePriority priority = DecimatePriority::kQuadric;
  DecimatePlacement placement = DecimatePlacement::kEndpoint;
  bool float_positions = true;  ///< new positions (kOptimal) are rounded to float, as the file will hold them
  /// First passes with a tolerance do cheap collapses in the order of places. Costs then are no threshold: off where
  /// their histogram is to give one. Only with kQuadric, kEndpoint, no limits of cost or turn.
  bool sweep = true;
  double noise = 0.0;  ///< kProbabilistic: standard deviation of positions, scan units; 0 = tolerance / 8
  /// Edges that turn by more are creases as well; 0 = only by vertex_class. Creases deviate by half the tolerance.
  double feature_angle_deg = 0.0;
  /// Largest angle of a new face to the original faces it stands for; 0 = free. Not counted where moving one
  /// corner of the original face by half the tolerance and a 32nd of the largest height of the faces around
  /// its corners explains the turn: noise turns slivers.
  double max_normal_deviation_deg = 0.0;
  /// Smallest 4 sqrt(3) area / (sum of squared edges), unless it was worse before.
  double min_mean_ratio = 0.02;
  bool allow_crossings = false;  ///< do collapses too that make faces meet others beyond what they share
  double colour_weight = 0.0;    ///< scan units that the full range of a colour channel is worth; 0 = ignored
  double colour_tolerance = 0.0;  ///< levels of 255, or kAutoColourTolerance (colour_guard.h); 0 = any change

  void validate() const;  ///< throws UsageError naming the field
};

enum class DecimateStop : std::uint8_t { kNoLegalCollapse, kCostLimit };

struct DecimateReport {
  std::size_t faces_in = 0, faces_out = 0;
  std::size_t vertices_in = 0, vertices_out = 0;
  std::size_t locked_vertices = 0;
  std::size_t flat_faces = 0;  ///< without area, turned or dropped where the surface is (flat_faces.h)
  std::size_t collapses = 0;
  std::size_t candidates = 0;  ///< popped and tried
  /// Why candidates were refused.
  std::size_t by_link = 0, by_fold = 0, by_shape = 0, by_normal = 0, by_colour = 0, by_tolerance = 0,
              by_crossing = 0;
  std::size_t exact_tests = 0;  ///< tolerance tests that had to look at the reference
  std::size_t exact_accepted = 0;
  std::uint64_t reference_faces_walked = 0;  ///< by them
  double bound = 0.0;                        ///< largest face_bound of the result, scan units
  double colour_tolerance = 0.0;             ///< that was held, levels; 0 = none
  std::size_t kept_for_colour = 0;           ///< vertices of the result that only their colours keep
  DecimateStop stop = DecimateStop::kNoLegalCollapse;
  std::array<std::uint64_t, kCostClasses> cost_histogram{};  ///< faces removed per cost class
};

/// Simplifies `block` in place.
/// \param block      any order; comes back canonical (MeshBlock). Vertices without a face are dropped.
///                   block.face_bound (m, or empty = all 0): every point of a face lies within it of the
///                   reference, and the part of the reference that the face stands for lies within it of the
///                   block. It comes back with m' values; carry it with the faces into the next pass.
/// \param reference  the original surface with a halo of 2 x tolerance around the block, same frame. Its vertices
///                   that are vertices of the block still have the same key. May be `block` itself in a
///                   first pass, which takes less time and memory than a copy; else keys ascend. Not looked
///                   at when tolerance is 0. Where it was moved before, its face_bound says how far each face may
///                   be from what it was, both ways: that counts, and bounds are to what it was.
/// \param pinned       keys, ascending, of vertices that are neither moved nor removed
/// Faces with kFaceDone are where an earlier pass had complete stars and could do no more: this one begins elsewhere, and
/// comes there when something near changes. A first pass, whose block is its own reference, begins everywhere.
/// \pre    every edge of the block has at most two faces, oppositely directed; positions are finite
/// \post   pure function of the set of faces and the options; locked vertices unchanged; edge-manifold,
///         vertex-manifold where it was; block.face_bound <= tolerance if the input's was
/// \cost   about 1 us per face removed; decimate_bytes() of memory above the two blocks
/// \throws InputError  an edge with more than two faces or with two faces of the same direction, sizes that differ
/// \throws UsageError  from options.validate()
DecimateReport decimate(MeshBlock& block, const MeshBlock& reference, const DecimateOptions& options,
                        std::span<const std::uint64_t> pinned = {});

/// Upper bound of what decimate() allocates above its arguments; reference_faces = 0 where the block is its own.
/// 184 bytes per face of the block, 112 per face of the reference.
[[nodiscard]] std::size_t decimate_bytes(std::size_t block_faces, std::size_t reference_faces);

/// The cost class up to which collapses must be done to come from `faces` down to `target_faces`, from the
/// sum of the histograms of an unlimited run over all blocks.
[[nodiscard]] std::uint32_t cost_class_for(const std::array<std::uint64_t, kCostClasses>& histogram,
                                           std::uint64_t faces, std::uint64_t target_faces);

}  // namespace tessera
