#include "kernels/points/surfel_scene.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

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
constexpr std::size_t kRaysPerPart = 8192;
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

bool has_area(const JobSurfel& s) {
  return dot(s.area, s.area) > 0.0f;
}

/// The nearest so far.
void meet(const SurfelDisks::Disk& d, bool own, SightRay& ray) {
  const float cosine = -dot(d.normal, ray.direction);
  if (own || std::fabs(cosine) < kGrazingDisk) return;
  const Float3 to = d.position - ray.from;
  const float distance = -dot(d.normal, to) / cosine;
  if (distance < ray.near || (ray.met && distance >= ray.distance)) return;
  const Float3 off = to - ray.direction * distance;
  if (dot(off, off) > d.radius2) return;
  ray.met = true, ray.distance = distance, ray.cosine = cosine, ray.patch = d.patch;
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

std::uint64_t SurfelParts::largest() const {
  std::uint64_t most = 0;
  for (const Part& p : parts) most = std::max(most, p.surfels);
  return most;
}

SurfelDisks::SurfelDisks(std::span<const JobSurfel> surfels, std::vector<std::uint32_t>* of) {
  struct Item {
    std::uint64_t brick;
    std::uint32_t slot;  ///< voxel in the brick, facing, slab
    std::uint32_t surfel;
  };
  std::vector<Item> items;
  items.reserve(surfels.size());
  if (of != nullptr) of->assign(surfels.size(), kNobody);
  for (std::uint32_t i = 0; i < surfels.size(); ++i) {
    const Int3 v = coarse_voxel_of(surfels[i].position);
    if (!has_area(surfels[i])) continue;
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

  disks_.reserve(items.size());
  for (std::size_t i = 0; i < items.size();) {
    const Item& first = items[i];
    const bool new_brick = i == 0 || first.brick != items[i - 1].brick;
    if (new_brick) bricks_.emplace_back().key = first.brick;
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
      if (of != nullptr) (*of)[items[end].surfel] = static_cast<std::uint32_t>(disks_.size());
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
  items = {};
  disks_.shrink_to_fit(), voxel_begin_.shrink_to_fit(), bricks_.shrink_to_fit();
}

const SurfelDisks::Brick* SurfelDisks::find(std::uint64_t key) const {
  const auto at = std::lower_bound(bricks_.begin(), bricks_.end(), key,
                                   [](const Brick& b, std::uint64_t k) { return b.key < k; });
  return at != bricks_.end() && at->key == key ? &*at : nullptr;
}

std::span<const SurfelDisks::Disk> SurfelDisks::disks(const Brick& brick, std::size_t word,
                                                      std::uint64_t bit) const {
  const std::uint32_t voxel =
      brick.before[word] + static_cast<std::uint32_t>(std::popcount(brick.occupied[word] & (bit - 1)));
  return {disks_.data() + voxel_begin_[voxel], disks_.data() + voxel_begin_[voxel + 1]};
}

SurfelScene::SurfelScene(const SurfelParts& parts, std::uint64_t bytes, ForEach for_each)
    : parts_(parts), bytes_(bytes), for_each_(std::move(for_each)), loaded_(parts.parts.size()) {}

void SurfelScene::add(std::size_t part, std::span<const JobSurfel> surfels) {
  std::vector<std::uint64_t> keys;
  for (const JobSurfel& s : surfels) {
    const Int3 v = coarse_voxel_of(s.position);
    for (std::size_t a = 0; a < 3; ++a) end_[a] = std::max(end_[a], v[a] + 1);
    const std::uint64_t key = voxel_key(divided(v, SurfelDisks::kVoxels));
    if (has_area(s) && (keys.empty() || keys.back() != key)) keys.push_back(key);
  }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  for (const std::uint64_t key : keys) bricks_.push_back({key, static_cast<std::uint32_t>(part)});
}

void SurfelScene::finish() {
  slots_.assign(std::bit_ceil(3 * bricks_.size() + 2), {kEmpty, 0});
  for (const Slot& b : bricks_) {
    insert(b.key, b.part);
    constexpr std::uint64_t kMask = (1u << 21) - 1;
    const Int3 at = {static_cast<std::int32_t>(b.key & kMask), static_cast<std::int32_t>(b.key >> 21 & kMask),
                     static_cast<std::int32_t>(b.key >> 42)};
    insert(voxel_key(divided(at, SurfelDisks::kVoxels)) | kRegion, 0);
  }
  bricks_ = {};
}

const SurfelScene::Slot* SurfelScene::find(std::uint64_t key) const {
  for (std::size_t s = mix(key) & (slots_.size() - 1);; s = (s + 1) & (slots_.size() - 1)) {
    if (slots_[s].key == key) return &slots_[s];
    if (slots_[s].key == kEmpty) return nullptr;
  }
}

void SurfelScene::insert(std::uint64_t key, std::uint32_t part) {
  std::size_t s = mix(key) & (slots_.size() - 1);
  while (slots_[s].key != kEmpty && slots_[s].key != key) s = (s + 1) & (slots_.size() - 1);
  slots_[s] = {key, part};
}

void SurfelScene::trace(std::span<SightRay> rays) {
  std::vector<std::uint32_t> pending(rays.size());
  std::iota(pending.begin(), pending.end(), 0u);
  for (SightRay& ray : rays) ray.voxel = coarse_voxel_of(ray.from);
  std::vector<std::uint64_t> waiting(loaded_.size());
  while (!pending.empty()) {
    for_each_((pending.size() + kRaysPerPart - 1) / kRaysPerPart, [&](std::size_t chunk) {
      const std::size_t end = std::min(pending.size(), (chunk + 1) * kRaysPerPart);
      for (std::size_t i = chunk * kRaysPerPart; i < end; ++i) advance(rays[pending[i]]);
    });
    std::erase_if(pending, [&](std::uint32_t i) { return rays[i].waits_for == SightRay::kDone; });
    std::fill(waiting.begin(), waiting.end(), 0);
    for (const std::uint32_t i : pending) ++waiting[rays[i].waits_for];
    load_for(waiting);
  }
}

/// Loads what most rays wait for, and lets go of what none waits for where room is needed.
void SurfelScene::load_for(const std::vector<std::uint64_t>& waiting) {
  std::vector<std::uint32_t> wanted;
  std::uint64_t held = 0;
  for (std::uint32_t p = 0; p < waiting.size(); ++p) {
    if (waiting[p] > 0) wanted.push_back(p);
    if (loaded_[p]) held += SurfelDisks::bytes(parts_.parts[p].surfels);
  }
  std::sort(wanted.begin(), wanted.end(), [&](std::uint32_t l, std::uint32_t r) {
    return waiting[l] != waiting[r] ? waiting[l] > waiting[r] : l < r;
  });
  std::uint64_t needed = 0;
  std::size_t count = 0;
  for (; count < wanted.size(); ++count) {
    needed += SurfelDisks::bytes(parts_.parts[wanted[count]].surfels);
    if (count > 0 && needed > bytes_) break;
  }
  if (count < wanted.size()) needed -= SurfelDisks::bytes(parts_.parts[wanted[count]].surfels);
  wanted.resize(count);
  for (std::size_t p = 0; p < loaded_.size() && held > 0 && held + needed > bytes_; ++p)
    if (loaded_[p]) loaded_[p].reset(), held -= SurfelDisks::bytes(parts_.parts[p].surfels);
  // Making takes more than holding: a few at once.
  for (std::size_t first = 0; first < wanted.size();) {
    std::uint64_t making = 0;
    std::size_t last = first;
    for (; last < wanted.size(); ++last) {
      making += SurfelDisks::making_bytes(parts_.parts[wanted[last]].surfels);
      if (last > first && making > bytes_) break;
    }
    for_each_(last - first, [&](std::size_t k) {
      const std::uint32_t p = wanted[first + k];
      loaded_[p] = std::make_unique<SurfelDisks>(parts_.load(p));
    });
    first = last;
  }
}

void SurfelScene::advance(SightRay& ray) const {
  constexpr std::int32_t kVoxels = SurfelDisks::kVoxels;
  const Float3& from = ray.from;
  const Float3& direction = ray.direction;
  const Float3 per = {1.0f / direction[0], 1.0f / direction[1], 1.0f / direction[2]};
  Int3 voxel = ray.voxel;
  Int3 brick = {-1, -1, -1}, region = {-1, -1, -1};
  const SurfelDisks* part = nullptr;
  const SurfelDisks::Brick* here = nullptr;
  bool any = false, own = false;
  ray.waits_for = SightRay::kDone;
  for (;;) {
    if (const Int3 at = divided(voxel, kVoxels); at != brick) {
      brick = at;
      if (const Int3 around = divided(at, kVoxels); around != region) {
        region = around;
        any = find(voxel_key(around) | kRegion) != nullptr;
      }
      const Slot* slot = any ? find(voxel_key(at)) : nullptr;
      here = nullptr;
      if (slot != nullptr) {
        part = loaded_[slot->part].get();
        if (part == nullptr) {
          ray.voxel = voxel, ray.waits_for = slot->part;
          return;
        }
        here = part->find(slot->key);
        own = ray.own_part == slot->part;
      }
    }
    if (here != nullptr) {
      const auto row = static_cast<std::uint32_t>((voxel[1] % kVoxels) * kVoxels + voxel[0] % kVoxels);
      const auto word = static_cast<std::size_t>(voxel[2] % kVoxels);
      const std::uint64_t bit = std::uint64_t{1} << row;
      if ((here->occupied[word] & bit) != 0) {
        for (const SurfelDisks::Disk& d : part->disks(*here, word, bit))
          meet(d, own && part->index_of(d) == ray.own_disk, ray);
        if (ray.met) {
          ray.met = ray.distance <= ray.far;
          return;
        }
      }
    }
    // On to the next voxel, or past the whole brick or region where that is empty.
    const std::int32_t size = here != nullptr ? 1 : any ? kVoxels : kVoxels * kVoxels;
    float leave = std::numeric_limits<float>::infinity();
    std::size_t through = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::int32_t corner = voxel[a] / size * size + (direction[a] > 0.0f ? size : 0);
      const float t = (static_cast<float>(corner * kCoarseCells) - from[a]) * per[a];
      if (t < leave) leave = t, through = a;
    }
    if (leave > ray.far) return;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::int32_t low = voxel[a] / size * size;
      if (a == through) {
        voxel[a] = direction[a] > 0.0f ? low + size : low - 1;
      } else if (size > 1) {
        const float p = (from[a] + leave * direction[a]) / kCoarseCells;
        voxel[a] = std::clamp(static_cast<std::int32_t>(std::max(p, 0.0f)), low, low + size - 1);
      }
    }
    if (voxel[through] < 0 || voxel[through] >= end_[through]) return;
  }
}

}  // namespace tessera
