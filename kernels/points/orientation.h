/// \file orientation.h
/// Consistent signs for unoriented normals, the part that one brick can do: surfels, links between them,
/// patches whose signs are beyond doubt, votes between patches, and what the whole job needs to know of each.
/// Sources: Hoppe et al., "Surface Reconstruction from Unorganized Points", 1992; Xie et al., "Surface
/// Reconstruction of Noisy and Defective Data Sets", 2004 (reflection rule for the sign of a link);
/// Schertler, Savchynskyy, Gumhold, "Towards Globally Optimal Normal Orientations for Large Point Clouds",
/// 2017 (patches, then a reduced graph).
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/sign_solver.h"
#include "octree/lattice.h"

namespace tessera {

inline constexpr int kSurfelCells = 2;  ///< edge of the voxel that a surfel lies in
inline constexpr int kSurfelsPerBrick = kBrickCells / kSurfelCells;  ///< voxels along a brick's edge
inline constexpr int kCoarseCells = 8;                               ///< edge of the voxel of a coarse surfel
inline constexpr std::uint16_t kNoPatch = 0xffff;                    ///< sign decided already, or no normal
inline constexpr std::uint16_t kGivenPatch = 0xfffe;  ///< the point keeps the normal it came with

/// The mean plane of the points of one voxel that lie on one sheet. Position in cells relative to the brick's
/// corner.
struct Surfel {
  std::array<std::uint8_t, 3> voxel{};  ///< coordinates inside the brick
  std::uint8_t vague = 0;               ///< its points' neighbourhoods are no planes: edges, dust
  std::uint16_t patch = 0;
  std::uint16_t points = 0;
  Float3 position{};
  Float3 normal{};
};

/// Sign and weight of a link between two surfels: the normal of `a`, carried to `b` along a circular arc,
/// against the normal of `b`. Positive = same side. 0 when no arc joins the two; magnitude at most
/// kVoteScale.
/// \param offset  b's position minus a's, cells
[[nodiscard]] std::int32_t link_vote(const Surfel& a, const Surfel& b, const Float3& offset);
inline constexpr std::int32_t kVoteScale = 4096;

/// A vote of two surfels, by their places in the lists given to link_voxels.
struct SurfelLink {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::int32_t vote = 0;
};

/// Links between the surfels of two voxels: of all pairs those that are the best for at least one of the two,
/// so that the two sides of a thin wall follow their own sides. `a` and `b` may be the same list: then each
/// pair once.
/// \param shift  added to b's positions, cells
/// \param links  appended to
void link_voxels(std::span<const Surfel> a, std::span<const Surfel> b, const Float3& shift,
                 std::vector<SurfelLink>& links);

/// What a whole job keeps of the surfels of one patch in one voxel of kCoarseCells that face the same way.
struct CoarseSurfel {
  Float3 position{};  ///< mean, cells relative to the brick's corner
  Float3 area{};      ///< summed normal times area, cells^2
  std::uint32_t patch = 0;
  std::uint32_t surfels = 0;
};

/// What is known of one patch, all relative to the side that its points' normals show.
struct PatchStats {
  std::uint32_t points = 0;
  std::uint32_t surfels = 0;
  std::uint32_t agree = 0;          ///< points whose given normal, kept aside, shows the same side
  std::uint32_t disagree = 0;       ///< and the other
  std::uint32_t agree_near = 0;     ///< of these, with the given normal within 60 degrees of the plane's axis
  std::uint32_t disagree_near = 0;  ///< as far as that is from it, neither side is the right one
  std::int64_t seen = 0;            ///< votes of sensors and `up` for this side, kVoteScale a surfel at most
  std::int64_t hidden = 0;          ///< and for the other
  std::uint32_t volumetric = 0;     ///< points that lie on no surface; the caller's to count
  std::uint32_t unused = 0;
};

struct BrickOrientation {
  std::vector<Float3> normal;        ///< input normals, flipped to agree with their patch
  std::vector<std::uint16_t> patch;  ///< per point; kNoPatch without normal
  std::uint16_t patches = 0;
  std::vector<PatchStats> stats;     ///< per patch
  std::vector<PatchVote> votes;      ///< between patches of this brick, merged
  std::vector<Surfel> boundary;      ///< surfels whose voxel touches a face of the brick, by voxel z, y, x
  std::vector<CoarseSurfel> coarse;  ///< by coarse voxel, patch, direction
};

inline constexpr float kNeverSure = 2.0f;

/// The points of a brick, canonical order. Positions in cells relative to the brick, normals unit or zero.
struct OrientationInput {
  std::span<const Float3> position;
  std::span<const Float3> normal;
  std::span<const float> variation;  ///< PointShape::variation
  std::span<const Float3> given;     ///< normals that came with the points, only compared with; empty = none
  /// Cosine of the normal with the way to the sensor or up; empty = unknown, as 0.
  std::span<const float> visible;
  /// Magnitude of it from which a point's side is beyond doubt: surfels of such points are one patch.
  float sure = kNeverSure;
};

/// Patches of one brick and what they say of each other.
[[nodiscard]] BrickOrientation orient_brick(const OrientationInput& points);

}  // namespace tessera
