/// \file orientation.h
/// Consistent signs for unoriented normals: surfels, confident links, brick-local patches, and the voting between
/// patches of different bricks.
/// Sources: Xie et al., "Surface Reconstruction of Noisy and Defective Data Sets", 2004 (reflection rule for the
/// sign of a link); Schertler, Savchynskyy, Gumhold, "Towards Globally Optimal Normal Orientations for Large Point
/// Clouds", 2017 (patches, then a reduced graph).
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

inline constexpr int kSurfelCells = 2;                             ///< edge of the voxel that one surfel stands for
inline constexpr int kSurfelsPerBrick = kBrickCells / kSurfelCells;  ///< voxels along a brick's edge
inline constexpr std::uint16_t kNoPatch = 0xffff;     ///< sign decided already, or no normal
inline constexpr std::uint16_t kGivenPatch = 0xfffe;  ///< the point keeps the normal it came with

/// The mean plane of one voxel. Position in cells relative to the brick's min corner.
struct Surfel {
  std::array<std::uint8_t, 3> voxel{};  ///< coordinates inside the brick
  std::uint8_t unused = 0;
  std::uint16_t patch = 0;
  std::uint16_t points = 0;
  Float3 position{};
  Float3 normal{};
};

/// Sign and weight of a link between two surfels: the normal of `a`, carried to `b` along a circular arc, against
/// the normal of `b`. Positive = same side. 0 when the link says nothing; magnitude at most 4096.
/// \param offset  b's position minus a's, cells
std::int32_t link_vote(const Surfel& a, const Surfel& b, const Float3& offset);

struct BrickOrientation {
  std::vector<Float3> normal;          ///< input normals, flipped to agree with their patch
  std::vector<std::uint16_t> patch;    ///< per point; kNoPatch without normal
  std::uint16_t patches = 0;
  std::vector<Surfel> boundary;        ///< surfels whose voxel touches a face of the brick, by voxel z, y, x
  /// Per patch and axis: minus the lowest coordinate (1/16 cell), what the normal there says of outward (positive =
  /// it points out), the highest coordinate, and the same there.
  std::vector<std::array<std::int32_t, 12>> extremes;
};

/// Patches of one brick. \param position, normal  the brick's points in canonical order, cells relative to the brick
BrickOrientation orient_brick(std::span<const Float3> position, std::span<const Float3> normal);

/// A vote between two patches, or its negation.
struct PatchVote {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::int64_t same = 0;      ///< summed weight of links that say "same side"
  std::int64_t opposite = 0;  ///< and of those that say "opposite"
};

struct SignSolution {
  std::vector<std::int8_t> sign;       ///< per patch, +1 or -1, relative to the smallest patch of its component
  std::vector<std::uint32_t> component;  ///< per patch, the smallest patch of its component
  std::vector<std::uint8_t> uncertain;  ///< per patch: its strongest tie to the rest is contradicted by a quarter or more
  std::uint64_t frustrated_votes = 0;  ///< weight of votes that the solution breaks
  std::uint64_t total_votes = 0;
};

/// Maximum spanning forest over |same - opposite|, then flips of single patches in index order while one gains, at
/// most a fixed number of rounds. Deterministic: ties by patch indices.
/// \pre votes have a < b, ascending, no repeats
SignSolution solve_signs(std::size_t patches, std::span<const PatchVote> votes);

}  // namespace tessera
