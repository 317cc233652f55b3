#include "kernels/points/surfel_scene.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "kernels/points/orientation.h"
#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr float kDiskSpread = 1.4f;  ///< radius over that of the disk's area: neighbours leave no gap
constexpr float kMinRadius = 2.5f;   ///< cells
constexpr float kMaxRadius = 7.0f;
constexpr float kGrazingDisk = 0.1f;  ///< cosine; flatter disks are not met
constexpr std::int32_t kSlabCells = 2;
constexpr float kOwned = 0.7f;  ///< share of a disk's area from which it belongs to one patch

constexpr std::uint64_t kEmpty = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t kRegion = std::uint64_t{1} << 63;

Int3 divided(const Int3& at, std::int32_t by) {
  return {at[0] / by, at[1] / by, at[2] / by};
}

/// The axis that a normal is nearest to, its sign, and the slab of the voxel across that axis: below 24.
std::uint32_t layer_of(const JobSurfel& s) {
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(s.area[a]) > std::fabs(s.area[axis])) axis = a;
  const auto cell = static_cast<std::int32_t>(std::max(s.position[axis], 0.0f)) % kCoarseCells;
  return static_cast<std::uint32_t>(axis) * 8 + (s.area[axis] < 0.0f ? 4 : 0) +
         static_cast<std::uint32_t>(cell / kSlabCells);
}

}  // namespace

std::uint64_t voxel_key(const Int3& at) {
  return (static_cast<std::uint64_t>(at[2]) << 42) | (static_cast<std::uint64_t>(at[1]) << 21) |
         static_cast<std::uint64_t>(at[0]);
}

Int3 coarse_voxel_of(const Float3& p) {
  Int3 v;
  for (std::size_t a = 0; a < 3; ++a) v[a] = static_cast<std::int32_t>(std::max(p[a], 0.0f)) / kCoarseCells;
  return v;
}

SurfelScene::SurfelScene(std::span<const JobSurfel> surfels) {
  make_disks(surfels);
}

void SurfelScene::make_disks(std::span<const JobSurfel> surfels) {
  struct Item {
    std::uint64_t brick;
    std::uint32_t slot;  ///< voxel in the brick, facing, slab
    std::uint32_t surfel;
  };
  std::vector<Item> items;
  items.reserve(surfels.size());
  disk_of_.assign(surfels.size(), kNobody);
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    const Int3 v = coarse_voxel_of(surfels[i].position);
    for (std::size_t a = 0; a < 3; ++a) end_[a] = std::max(end_[a], v[a] + 1);
    if (!(dot(surfels[i].area, surfels[i].area) > 0.0f)) continue;
    std::uint32_t inside = 0;
    for (std::size_t a = 3; a-- > 0;) inside = inside * kVoxels + static_cast<std::uint32_t>(v[a] % kVoxels);
    items.push_back({voxel_key(divided(v, kVoxels)), inside * 32 + layer_of(surfels[i]), i});
  }
  std::sort(items.begin(), items.end(), [&](const Item& l, const Item& r) {
    if (l.brick != r.brick) return l.brick < r.brick;
    if (l.slot != r.slot) return l.slot < r.slot;
    const std::uint32_t lp = surfels[l.surfel].patch, rp = surfels[r.surfel].patch;
    return lp != rp ? lp < rp : l.surfel < r.surfel;
  });

  std::vector<std::uint64_t> keys;
  for (std::size_t i = 0; i < items.size();) {
    const Item& first = items[i];
    const bool new_brick = i == 0 || first.brick != items[i - 1].brick;
    if (new_brick) {
      keys.push_back(first.brick);
      bricks_.emplace_back();
    }
    const std::uint32_t voxel = first.slot / 32;
    if (new_brick || voxel != items[i - 1].slot / 32) {
      bricks_.back().occupied[voxel / 64] |= std::uint64_t{1} << (voxel % 64);
      voxel_begin_.push_back(static_cast<std::uint32_t>(disks_.size()));
    }
    Disk disk;
    float whole = 0.0f, maximum = 0.0f, own = 0.0f;
    Float3 area{};
    std::size_t end = i;
    for (; end < items.size() && items[end].brick == first.brick && items[end].slot == first.slot; ++end) {
      const JobSurfel& s = surfels[items[end].surfel];
      const float size = norm(s.area);
      own = end > i && s.patch == surfels[items[end - 1].surfel].patch ? own + size : size;
      if (own > maximum) maximum = own, disk.patch = s.patch;
      whole += size;
      area = area + s.area;
      disk.position = disk.position + s.position * size;
      disk_of_[items[end].surfel] = static_cast<std::uint32_t>(disks_.size());
    }
    i = end;
    if (maximum < kOwned * whole) disk.patch = kNobody;
    disk.position = disk.position * (1.0f / whole);
    const float size = norm(area);  // of one facing, so never near 0
    disk.normal = area * (1.0f / size);
    const float radius = std::clamp(kDiskSpread * std::sqrt(size * 0.31830989f), kMinRadius, kMaxRadius);
    disk.radius2 = radius * radius;
    disks_.push_back(disk);
  }
  voxel_begin_.push_back(static_cast<std::uint32_t>(disks_.size()));
  std::uint32_t before = 0;
  for (Brick& b : bricks_)
    for (std::size_t w = 0; w < b.occupied.size(); ++w) {
      b.before[w] = before;
      before += static_cast<std::uint32_t>(std::popcount(b.occupied[w]));
    }
  slots_.assign(std::bit_ceil(3 * keys.size() + 2), {kEmpty, 0});
  for (std::uint32_t b = 0; b < keys.size(); ++b) {
    insert(keys[b], b);
    constexpr std::uint64_t kMask = (1u << 21) - 1;
    const Int3 at = {static_cast<std::int32_t>(keys[b] & kMask),
                     static_cast<std::int32_t>(keys[b] >> 21 & kMask),
                     static_cast<std::int32_t>(keys[b] >> 42)};
    insert(voxel_key(divided(at, kVoxels)) | kRegion, 0);
  }
}

const SurfelScene::Slot* SurfelScene::find(std::uint64_t key) const {
  for (std::size_t s = mix(key) & (slots_.size() - 1);; s = (s + 1) & (slots_.size() - 1)) {
    if (slots_[s].key == key) return &slots_[s];
    if (slots_[s].key == kEmpty) return nullptr;
  }
}

void SurfelScene::insert(std::uint64_t key, std::uint32_t brick) {
  std::size_t s = mix(key) & (slots_.size() - 1);
  while (slots_[s].key != kEmpty && slots_[s].key != key) s = (s + 1) & (slots_.size() - 1);
  slots_[s] = {key, brick};
}

void SurfelScene::meet(std::uint32_t voxel, const Float3& from, const Float3& direction, float near,
                       std::uint32_t own, Visibility& best) const {
  for (std::uint32_t k = voxel_begin_[voxel]; k < voxel_begin_[voxel + 1]; ++k) {
    const Disk& d = disks_[k];
    const float cosine = -dot(d.normal, direction);
    if (k == own || std::fabs(cosine) < kGrazingDisk) continue;
    const Float3 to = d.position - from;
    const float distance = -dot(d.normal, to) / cosine;
    if (distance < near || (best.met && distance >= best.distance)) continue;
    const Float3 off = to - direction * distance;
    if (dot(off, off) <= d.radius2) best = {true, k, distance, cosine};
  }
}

SurfelScene::Visibility SurfelScene::look(const Float3& from, const Float3& direction, float near, float far,
                                          std::uint32_t own) const {
  const Float3 per = {1.0f / direction[0], 1.0f / direction[1], 1.0f / direction[2]};
  Int3 voxel = coarse_voxel_of(from);
  Int3 brick = {-1, -1, -1}, region = {-1, -1, -1};
  const Slot* here = nullptr;
  bool any = false;
  for (;;) {
    if (const Int3 at = divided(voxel, kVoxels); at != brick) {
      brick = at;
      if (const Int3 around = divided(at, kVoxels); around != region) {
        region = around;
        any = find(voxel_key(around) | kRegion) != nullptr;
      }
      here = any ? find(voxel_key(at)) : nullptr;
    }
    if (here) {
      const Brick& b = bricks_[here->brick];
      const auto row = static_cast<std::uint32_t>((voxel[1] % kVoxels) * kVoxels + voxel[0] % kVoxels);
      const std::uint64_t word = b.occupied[static_cast<std::size_t>(voxel[2] % kVoxels)];
      const std::uint64_t bit = std::uint64_t{1} << row;
      if ((word & bit) != 0) {
        Visibility visibility;
        meet(b.before[static_cast<std::size_t>(voxel[2] % kVoxels)] +
                 static_cast<std::uint32_t>(std::popcount(word & (bit - 1))),
             from, direction, near, own, visibility);
        if (visibility.met) return visibility.distance <= far ? visibility : Visibility{};
      }
    }
    // On to the next voxel, or past the whole brick or region where that is empty.
    const std::int32_t size = here ? 1 : any ? kVoxels : kVoxels * kVoxels;
    float leave = std::numeric_limits<float>::infinity();
    std::size_t through = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::int32_t corner = voxel[a] / size * size + (direction[a] > 0.0f ? size : 0);
      const float t = (static_cast<float>(corner * kCoarseCells) - from[a]) * per[a];
      if (t < leave) leave = t, through = a;
    }
    if (leave > far) return {};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::int32_t low = voxel[a] / size * size;
      if (a == through) {
        voxel[a] = direction[a] > 0.0f ? low + size : low - 1;
      } else if (size > 1) {
        const float p = (from[a] + leave * direction[a]) / kCoarseCells;
        voxel[a] = std::clamp(static_cast<std::int32_t>(std::max(p, 0.0f)), low, low + size - 1);
      }
    }
    if (voxel[through] < 0 || voxel[through] >= end_[through]) return {};
  }
}

}  // namespace tessera
