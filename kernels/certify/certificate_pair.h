/// \file certificate_pair.h
/// The certificate of two surfaces, both ways: an overlay (overlay_proof.h), two where neither has far fewer faces, the
/// search of certificate.h for what it leaves open and for the largest distances, until bound and finding
/// meet.
#pragma once
#include "kernels/certify/certificate.h"

namespace tessera {

/// How far coarse faces are laid out beyond the core, in reaches.
inline constexpr double kPairMargin = 1.0;
/// What must be complete around the core, in reaches: more than the margin and the rounding of any distance.
inline constexpr double kPairHalo = 2.0 + 0x1p-10;

struct DeviationPair {
  DeviationReport there;                       ///< from a to b
  DeviationReport back;                        ///< from b to a
  std::vector<float> there_bound, back_bound;  ///< per face of a, of b, as certify_deviation()'s face_bound
};

/// \param core    as in certify_deviation(), or nullptr; both surfaces are complete within kPairHalo reaches of it
/// \param origin  subtracted from all positions: near them
/// \post  as certify_deviation(a against b) and (b against a), with the same tightness
/// \cost  0.2 to 0.4 us per face where one surface has far fewer faces; about 200 bytes per face
[[nodiscard]] DeviationPair certify_pair(const SurfaceFaces& a, const SurfaceFaces& b, const Box3* core,
                                         const Double3& origin, const CertificateOptions& options);

struct RasterProof {
  bool proven = false;         ///< both surfaces stay within the tolerance of each other
  std::uint64_t faces = 0;     ///< that meet the core, of both
  std::uint64_t searched = 0;  ///< of these, those that the raster left in doubt
};

/// The answer of certify_pair() alone, no distances: the raster (raster_filter.h) settles what it can, what it leaves is
/// searched as certify_deviation() does.
/// \pre   as certify_pair(), and the core has a volume
/// \post  where it is proven, certify_pair() finds both within the tolerance too: all that is taken for settled is so by
///   2^-11 of it, and search that narrow ends
/// \cost  about 0.5 us per face, and that of the search; raster_filter_bytes() of both
[[nodiscard]] RasterProof prove_by_raster(const SurfaceFaces& a, const SurfaceFaces& b, const Box3& core,
                                          const Double3& origin, const CertificateOptions& options);

}  // namespace tessera
