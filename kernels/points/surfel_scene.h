/// \file surfel_scene.h
/// The coarse surfels of a whole job as disks in a sparse grid, and the first of them along rays. The grid knows the
/// bricks of the whole job; their disks come and go part by part, and a ray waits where it needs a part that is not in
/// memory. Sources: Amanatides, Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987; Pharr, Kolb, Gershbein,
/// Hanrahan, "Rendering Complex Scenes with Memory-Coherent Ray Tracing", 1997 (rays that wait for their part).
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Runs a body for every index of [0, count), in any order, several at once if it likes.
using ForEach = std::function<void(std::size_t count, const std::function<void(std::size_t)>& body)>;

/// A coarse surfel in the frame of the job.
struct JobSurfel {
  Float3 position{};        ///< cells from the lattice origin
  Float3 area{};            ///< summed normal times area of its patch's side, cells^2
  std::uint32_t patch = 0;  ///< or group of patches
  std::uint32_t surfels = 0;
  float points = 0.0f;  ///< of the scan, in one fine surfel
};

/// The surfels of a job in parts that are loaded one by one, the same ones in the same order every time.
struct SurfelParts {
  struct Part {
    std::uint64_t surfels = 0;
    std::uint32_t first_group = 0;  ///< its own groups: those of the job from here on
  };
  std::vector<Part> parts;
  std::uint32_t first_shared = 0xffffffffu,
                shared = 0;  ///< groups that several parts have, behind all others
  std::uint64_t largest() const;
  /// Their `patch` is the group of the job, their area has the side of that. No two parts have surfels in one cube of
  /// eight coarse voxels. Called from several threads at once.
  std::function<std::vector<JobSurfel>(std::size_t part)> load;
};

/// The disks of one part. What faces alike in one slab of a coarse voxel is one disk, whatever patches it has: a voxel
/// holds at most 24, so a ray costs the same in a crown of leaves as along a wall, and the two sides of a wall stay two.
class SurfelDisks {
 public:
  static constexpr std::uint32_t kNobody = 0xffffffffu;
  static constexpr std::int32_t kVoxels =
      8;  ///< along the edge of a brick, and bricks along that of a region

  struct Disk {
    Float3 position{};
    Float3 normal{};
    float radius2 = 0.0f;
    std::uint32_t patch = kNobody;  ///< the one that most of it belongs to; kNobody where that is mixed
  };
  struct Brick {
    std::uint64_t key = 0;
    std::array<std::uint64_t, kVoxels> occupied{};  ///< bit per coarse voxel, x lowest
    std::array<std::uint32_t, kVoxels> before{};    ///< occupied voxels of the part before each word
  };

  /// \pre positions from 0 to 2^24 cells \param of  becomes the disk that each surfel is part of; null = not asked for
  explicit SurfelDisks(std::span<const JobSurfel> surfels, std::vector<std::uint32_t>* of = nullptr);
  const Brick* find(std::uint64_t key) const;
  /// The disks of an occupied voxel of a brick.
  std::span<const Disk> disks(const Brick& brick, std::size_t word, std::uint64_t bit) const;
  const Disk& disk(std::uint32_t index) const { return disks_[index]; }
  std::uint32_t index_of(const Disk& disk) const { return static_cast<std::uint32_t>(&disk - disks_.data()); }
  /// Bytes at most, while it is made, and then. \param surfels  of the part
  static std::uint64_t making_bytes(std::uint64_t surfels) { return 136 * surfels + (1u << 18); }
  static std::uint64_t bytes(std::uint64_t surfels) { return 40 * surfels + (1u << 17); }

 private:
  std::vector<Disk> disks_;                 ///< by brick, voxel, facing, slab
  std::vector<std::uint32_t> voxel_begin_;  ///< of every occupied voxel in disks_, and the end
  std::vector<Brick> bricks_;               ///< ascending key
};

/// A look from a point, and what it met.
struct SightRay {
  static constexpr std::uint32_t kDone = 0xffffffffu;

  Float3 from{};
  Float3 direction{};  ///< unit, no component 0
  float near = 0.0f;   ///< distances between which a disk is met, cells
  float far = std::numeric_limits<float>::infinity();
  std::uint32_t own_part = SurfelDisks::kNobody, own_disk = SurfelDisks::kNobody;  ///< a disk that is not met

  bool met = false;
  float distance = 0.0f;  ///< cells
  float cosine = 0.0f;    ///< between the disk's normal and the way back: positive = its front
  std::uint32_t patch = SurfelDisks::kNobody;  ///< of the disk
  Int3 voxel{};                                ///< where it waits
  std::uint32_t waits_for = kDone;             ///< the part
};

/// The bricks of a whole job, and the disks of as many parts as fit.
class SurfelScene {
 public:
  /// \param bytes  for disks; one part is held whatever it takes
  SurfelScene(const SurfelParts& parts, std::uint64_t bytes, ForEach for_each);
  /// Every part once, ascending; then finish().
  void add(std::size_t part, std::span<const JobSurfel> surfels);
  void finish();

  /// Follows rays to the first disk that they meet. The result does not hang on `bytes`.
  void trace(std::span<SightRay> rays);

  /// Bytes that it holds at most, those for disks left out. \param bricks  with surfels
  static std::uint64_t grid_bytes(std::uint64_t bricks) { return (bricks + 1) * 8 * sizeof(Slot); }

 private:
  struct Slot {
    std::uint64_t key;
    std::uint32_t part;  ///< not used by regions
  };
  const Slot* find(std::uint64_t key) const;
  void insert(std::uint64_t key, std::uint32_t part);
  void advance(SightRay& ray) const;
  void load_for(const std::vector<std::uint64_t>& waiting);

  const SurfelParts& parts_;
  std::uint64_t bytes_;
  ForEach for_each_;
  std::vector<std::unique_ptr<SurfelDisks>> loaded_;
  std::vector<Slot> bricks_;  ///< until finish()
  std::vector<Slot> slots_;   ///< hash table with open addresses: bricks and regions that hold disks
  Int3 end_{};                ///< voxels
};

/// The coarse voxel of a position.
[[nodiscard]] Int3 coarse_voxel_of(const Float3& position);
/// Of a voxel, brick or region: 21 bits a coordinate.
[[nodiscard]] std::uint64_t voxel_key(const Int3& at);

}  // namespace tessera
