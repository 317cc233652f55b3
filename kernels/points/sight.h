/// \file sight.h
/// What the surfels of a whole job see along straight lines: each other, or nothing. The scanner stood in free
/// space, so the front of a surface is the side with the longer sight; and of two surfels with nothing between
/// them both show their fronts, or both their backs. Sources: Takayama, Jacobson, Kavan, Sorkine-Hornung, "A
/// Simple Method for Correcting Facet Orientations in Polygon Meshes Based on Ray Casting", 2014 (rays from both
/// sides, the freer side is the front); Amanatides, Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/sign_solver.h"
#include "octree/lattice.h"

namespace tessera {

/// A coarse surfel in the frame of the job.
struct JobSurfel {
  Float3 position{};        ///< cells from the lattice origin
  Float3 area{};            ///< summed normal times area of its patch's side, cells^2
  std::uint32_t patch = 0;  ///< or group of patches
  std::uint32_t surfels = 0;
  float points = 0.0f;  ///< of the scan, in one fine surfel
};

/// The surfels of a job as small disks in a sparse grid of coarse voxels.
class SurfelScene {
 public:
  /// \param surfels  stay as long as the scene \pre positions from 0 to 2^24 cells \cost a sort
  explicit SurfelScene(std::span<const JobSurfel> surfels);

  struct Sight {
    bool met = false;
    std::uint32_t surfel = 0;  ///< the one that is met
    float distance = 0.0f;     ///< cells
    float cosine = 0.0f;       ///< between its normal and the way back: positive = its front is met
  };
  /// The first surfel along a ray.
  /// \param way  unit, no component 0
  /// \param near,far  distances between which a surfel is met, cells
  /// \param own  a surfel that is not met
  Sight look(const Float3& from, const Float3& way, float near, float far, std::uint32_t own) const;

 private:
  /// Along the edge of a brick, and bricks along that of a region.
  static constexpr std::int32_t kVoxels = 8;
  struct Brick {
    std::array<std::uint64_t, kVoxels> occupied{};  ///< bit per coarse voxel, x lowest
    std::array<std::uint32_t, kVoxels> before{};    ///< occupied voxels of the job before each word
  };
  struct Slot {
    std::uint64_t key;
    std::uint32_t brick;  ///< not used by regions
  };
  const Slot* find(std::uint64_t key) const;
  void insert(std::uint64_t key, std::uint32_t brick);
  void meet(std::uint32_t voxel, const Float3& from, const Float3& way, float near, std::uint32_t own,
            Sight& best) const;

  std::span<const JobSurfel> surfels_;
  std::vector<std::uint32_t> order_;        ///< surfels by voxel
  std::vector<std::uint32_t> voxel_begin_;  ///< of every occupied voxel in order_, and the end
  std::vector<Brick> bricks_;
  std::vector<Slot> slots_;  ///< hash table with open addresses: bricks and regions that hold surfels
  Int3 end_{};               ///< voxels
};

/// How a scene was scanned, told from what its surfels see. It decides which side of a surfel sees more.
enum class SceneKind : std::uint8_t {
  kObject,     ///< from around it: the side that sees more of the open
  kLand,       ///< from amid it: how far a side sees, and how much of the open
  kFromAbove,  ///< most surfels see the sky, steep ones with one side: the side that sees more of the sky
  kRoom,  ///< from inside it, some cannot be seen from outside the job, or far more points lie near than far
          ///< on what shuts the view out: how far a side sees
};

/// Votes of looks from surfels to both sides, in directions that hang on their place alone.
struct SightVotes {
  std::vector<PatchVote> pairs;  ///< between groups that see each other, merged; of objects and land
  std::vector<PatchVote> sides;  ///< of groups, for the side that they show; `b` is the number of groups
  double enclosed = 0.0;         ///< share of the surfels that cannot be seen from outside the job
  SceneKind scene = SceneKind::kLand;
};

/// \param surfels  with the signs that they have inside their group, which is their `patch`
/// \param up  unit
/// \param scale  weight of one fine surfel's votes while all its looks agree
/// \cost some millions of rays, whatever the job's size
SightVotes vote_by_sight(std::span<const JobSurfel> surfels, std::size_t groups, const Float3& up,
                         double scale);

/// Votes of sensors that nothing hides, for points that do not say which one saw them: the nearest of these
/// says most, and less the more it looks along the surface.
/// \param sensors  cells from the lattice origin, anywhere
/// \returns as SightVotes::sides
/// \cost as vote_by_sight
std::vector<PatchVote> vote_by_sensors(std::span<const JobSurfel> surfels, std::size_t groups,
                                       std::span<const Float3> sensors, double scale);

}  // namespace tessera
