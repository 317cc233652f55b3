/// \file surfel_scene.h
/// The coarse surfels of a whole job as disks in a sparse grid, and the first of them along a ray. Source: Amanatides,
/// Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

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

/// Disks of the surfels. What faces alike in one slab of a coarse voxel is one disk, whatever patches it has: a voxel
/// holds at most 24, so a ray costs the same in a crown of leaves as along a wall, and the two sides of a wall stay two.
class SurfelScene {
 public:
  static constexpr std::uint32_t kNobody = 0xffffffffu;

  /// \pre positions from 0 to 2^24 cells \cost a sort
  explicit SurfelScene(std::span<const JobSurfel> surfels);

  struct Visibility {
    bool met = false;
    std::uint32_t disk = 0;  ///< the one that is met
    float distance = 0.0f;   ///< cells
    float cosine = 0.0f;     ///< between its normal and the way back: positive = its front is met
  };
  /// The first disk along a ray.
  /// \param direction  unit, no component 0
  /// \param near,far  distances between which a disk is met, cells
  /// \param own  a disk that is not met, or kNobody
  Visibility look(const Float3& from, const Float3& direction, float near, float far,
                  std::uint32_t own) const;

  /// The disk that a surfel is part of.
  std::uint32_t disk_of(std::size_t surfel) const { return disk_of_[surfel]; }
  /// The patch that most of a disk belongs to; kNobody where that is mixed.
  std::uint32_t patch_of(std::uint32_t disk) const { return disks_[disk].patch; }

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
  struct Disk {
    Float3 position{};
    Float3 normal{};
    float radius2 = 0.0f;
    std::uint32_t patch = kNobody;
  };
  void make_disks(std::span<const JobSurfel> surfels);
  const Slot* find(std::uint64_t key) const;
  void insert(std::uint64_t key, std::uint32_t brick);
  void meet(std::uint32_t voxel, const Float3& from, const Float3& direction, float near, std::uint32_t own,
            Visibility& best) const;

  std::vector<Disk> disks_;                 ///< by brick, voxel, facing, slab
  std::vector<std::uint32_t> disk_of_;      ///< per surfel
  std::vector<std::uint32_t> voxel_begin_;  ///< of every occupied voxel in disks_, and the end
  std::vector<Brick> bricks_;
  std::vector<Slot> slots_;  ///< hash table with open addresses: bricks and regions that hold disks
  Int3 end_{};               ///< voxels
};

/// The coarse voxel of a position.
Int3 coarse_voxel_of(const Float3& position);
/// Of a voxel, brick or region: 21 bits a coordinate.
std::uint64_t voxel_key(const Int3& at);

}  // namespace tessera
