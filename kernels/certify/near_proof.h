/// \file near_proof.h
/// Proves faces against few faces of another surface that are known to lie near, as the search of certificate.h does,
/// but without searching: what overlay_proof.h leaves of the fine surface lies over three coarse faces or more, and the
/// overlay has met them all.
///
/// The distance to one triangle is convex, so one that is within the limit of all corners of a convex piece proves it.
/// A piece that none proves is cut (convex_piece.h) between the triangles closest to its centroid and to its worst
/// corner. Which triangles are given decides only what can be proven, never whether it is true.
///
/// Rounding. At most kMaxCuts cuts follow each other, fewer than in certificate.h; what is derived there holds.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/certify/certificate.h"
#include "kernels/certify/convex_piece.h"

namespace tessera {

class NearProof {
 public:
  static constexpr std::size_t kMaxNear = 12;

  /// \param origin  subtracted from all positions
  NearProof(const SurfaceFaces& other, const Double3& origin);

  /// A bound of the distance of all points of a triangle to the nearest of some faces of the other surface, but for
  /// certificate_rounding(). \param corner  relative to the origin \param near  faces of the other surface, at most kMaxNear
  /// \return  above `limit` where that is not proven
  double bound(const std::array<Double3, 3>& corner, std::span<const std::uint32_t> near, double limit);

 private:
  bool prove(const ConvexPiece& piece, double limit2, double& square);

  ClosestFaces index_;
  std::vector<std::uint32_t> slot_of_;  ///< per face
  std::vector<ConvexPiece> stack_;
  std::array<std::uint32_t, kMaxNear> slots_{};  ///< at hand
  std::size_t count_ = 0;
  Double3 normal_{};
};

}  // namespace tessera
