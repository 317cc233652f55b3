/// \file certificate.h
/// An upper bound, proven, of the distance of every point of one surface to another, and the report that goes
/// with it: where it is largest, and of the area by measured distances (distance_samples.h) RMS and a histogram. One
/// direction; call it twice for both.
///
/// How it is proven. The distance to a convex set is convex, so over a convex piece of a face it is largest
/// at a corner: one triangle of the other surface that is within t of all corners of the piece proves t for
/// all of it. And the distance to any set is 1-Lipschitz, so the distance at the centroid plus the radius
/// bounds the piece. A piece that neither proves is cut where the closest triangle changes: at the sides of
/// that triangle, seen along the normal of the face, at the bisector of two triangles' planes, or in the
/// middle. Any cut is right; a good one ends the recursion after about one piece per overlap. (Subdivision
/// bounds: Guthe, Borodin, Klein, "Fast and accurate Hausdorff distance calculation between meshes", 2005;
/// convexity of the distance to one triangle makes the bound exact where they halve.)
///
/// The bound is tight: pieces are refined until the largest bound is at most `tightness` times the largest
/// distance that was found at a point, unless that is below tolerance / 1000 or below `enough`.
///
/// Rounding. u = 2^-53, R the largest coordinate relative to the origin. A cut moves its new corners by at
/// most 8 u R off the segment that they cut; at most kMaxCuts = 160 cuts follow each other, so the pieces
/// cover the face within 1280 u R. A distance is at most 32 u R too small (closest_face.h), positions lose u
/// R each by subtracting the origin. certificate_rounding(R) = 2^-42 R = 2048 u R covers the sum and is added
/// to every bound. Nothing here is shared with the test inside the decimation loop.
///
/// Border curves: pass both border polylines as faces (a, b, b); lengths then stand for areas.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "octree/lattice.h"

namespace tessera {

inline constexpr double kMinTarget = 1e-3;  ///< of the tolerance: below it nobody asks for a tight bound
inline constexpr int kDeviationBins = 32;   ///< of width tolerance / 32; then up to reach, then beyond

[[nodiscard]] constexpr double certificate_rounding(double largest_coordinate) {
  return 0x1p-42 * largest_coordinate;
}

struct Box3 {
  Double3 low, high;
};

struct CertificateOptions {
  double tolerance = 0.0;  ///< scan units, > 0
  /// >= tolerance: the other surface is complete within it; larger distances are "beyond".
  double max_distance = 0.0;
  double tightness = 1.03;  ///< > 1
  double enough = 0.0;      ///< >= 0: bounds up to here need not be tight
  double area_unit = 0.0;   ///< > 0: areas in the histogram are integers in it (lengths, of its root)
  /// Most points at which distances are measured for RMS and histogram; 0 leaves both out.
  std::size_t samples = 4096;
  std::function<void()> check_stop = {};  ///< called every few thousand pieces, may throw; may be empty
};

struct DeviationReport {
  /// No point is farther: proven, rounding included. Infinite when some are beyond reach.
  double upper = 0.0;
  double lower = 0.0;  ///< some point is this far: `witness`. With points beyond reach: the reach
  Double3 witness = {0, 0, 0};
  std::uint32_t witness_face = 0;
  bool beyond = false;                ///< some point has no other surface within reach
  std::uint64_t faces = 0;            ///< looked at
  std::uint64_t faces_exceeding = 0;  ///< not proven to stay within the tolerance
  double area = 0.0;                  ///< of what was looked at
  std::uint64_t samples = 0;          ///< points of equal shares of the area, their distances measured
  double square_integral = 0.0;       ///< of the distance, by these; what is beyond reach counts as reach
  std::array<std::uint64_t, kDeviationBins + 2> histogram{};  ///< area by distance, in area_unit
  std::uint64_t pieces = 0, queries = 0;                      ///< work

  double rms() const;  ///< by the samples; less than the truth where something is beyond reach
  /// Adds another part of the same surface. \pre same options
  void merge(const DeviationReport& other);
};

/// The faces of a surface, (a, b, b) for a segment of a border curve.
struct SurfaceFaces {
  std::span<const Double3> position;                    ///< n, world
  std::span<const std::array<std::uint32_t, 3>> faces;  ///< m, indices below n
};

/// \param surface    what is measured
/// \param core       only what lies in this box (all of it: nullptr); boxes that tile space count every point once
/// \param reference  what is measured against; complete within `max_distance` of the measured part. May be empty
/// \param face_bound m bounds, rounded up, one per face (infinite: beyond), or nullptr
/// \post  the result depends on the arguments alone
/// \cost  about 1 us per face and overlap; 20 bytes per vertex, 4 per face
DeviationReport certify_deviation(const SurfaceFaces& surface, const Box3* core,
                                  const ClosestFaces& reference, const CertificateOptions& options,
                                  std::vector<float>* face_bound = nullptr);

}  // namespace tessera
