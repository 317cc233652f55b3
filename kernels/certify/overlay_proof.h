/// \file overlay_proof.h
/// Proves most of a two-sided certificate at once, where one of two surfaces has far fewer faces: the fine
/// surface is laid over each coarse face, seen along its normal, and both distances are read off the overlay.
///
/// Coarse to fine. A coarse face T is covered when the fine faces over it, found by walking from one to the
/// next across every edge that meets T, are a chain without boundary over T: the number of times that the
/// chain covers a point, counted with orientation, is then the same for all of T, and at one point it is
/// counted. So every point of T has a point of the fine surface above or below; the height between both is
/// linear on the overlay and largest at one of its corners: a fine vertex, a crossing of edges, a corner of
/// T. It bounds the distance. Nothing is asked of the fine faces: they may fold.
///
/// Fine to coarse. A fine face that lies over T alone is within its largest height of T. One that lies over
/// T1 and T2, across their common edge and no other, is within the largest height over both or, for what is
/// over neither, the distance to the edge: that part lies between the two planes through the edge at right
/// angles to T1 and T2, and the distance is largest at a corner of the face or where its sides cross these
/// planes, as high there as over T1 or T2.
///
/// At the boundary of the core T is cut off by a margin m beyond it. A fine face that reaches beyond no edge of T
/// and is nowhere as high as m has what of it lies in the core over that part of T: so its largest height there
/// bounds it.
///
/// Fine faces over three coarse ones or more are cut and measured against these (near_proof.h). All that this does not
/// prove is left to certify_deviation(). Nothing here is shared with decimation.
///
/// Rounding. Fine vertices are projected once per T, so the overlay is that of a surface moved by less than
/// 32 u R (u = 2^-53, R the largest coordinate relative to the origin). T is grown by 64 u R, so that no
/// crossing is missed; what only comes as near as that to a side of T is not walked across, which leaves
/// strips no farther than 1024 u R from what is covered (needles are walked around in full).
/// certificate_rounding(R) covers the sum and is added to every bound.
#pragma once
#include <vector>

#include "kernels/certify/certificate.h"

namespace tessera {

/// What one surface has of it.
struct OverlaySide {
  /// Per face, rounded up: the part in the core is within it of the other surface. Infinite: not proven;
  /// 0: outside.
  std::vector<float> bound;
  DeviationReport report;  ///< faces, area and pieces of what is proven; all else is left to others
};
struct OverlayProof {
  OverlaySide coarse, fine;
};

/// \param core    the fine surface is complete within `margin` + tolerance of it; nullptr: all of it
/// \param margin  > tolerance: so far coarse faces are covered beyond the core
/// \param origin  subtracted from all positions
/// \param fine_too  else OverlaySide `fine` is left empty, which saves a fifth of the time
/// \post  a pure function of the arguments; no bound above options.tolerance
/// \cost  about 0.15 us per fine face; 80 bytes per fine face, 32 per fine vertex, 160 per coarse face
[[nodiscard]] OverlayProof prove_by_overlay(const SurfaceFaces& coarse, const SurfaceFaces& fine,
                                            const Box3* core, double margin, const Double3& origin,
                                            const CertificateOptions& options, bool fine_too = true);

}  // namespace tessera
