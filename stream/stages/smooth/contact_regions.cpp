#include "stream/stages/smooth/contact_regions.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "kernels/mesh/block_contacts.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/record_file.h"

namespace tessera {
namespace {

/// Bounds of distances are computed, not exact.
constexpr double kRegionRounding = 1.0 + 1e-9;
/// Of a tile, then of a patch: where there are more, all of it is one.
constexpr std::size_t kMaxOfTile = 65536, kMaxOfPatch = 64;
constexpr std::size_t kRegionPage = 1024;  ///< records read at a time

/// What a box is around; those of a tile's other patches and of its contacts follow that of its first patch.
enum class Around : std::uint64_t { kContact, kFirstPatch, kPatch };
struct RegionRecord {
  MeshBox box;
  Around around = Around::kContact;
};
struct TilePatch {
  MeshBox box;
  std::size_t tile = 0;
};

MeshBox nothing() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
}
void cover(MeshBox& box, const Double3& p) {
  for (std::size_t a = 0; a < 3; ++a)
    box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
}

void add_overlaps(std::vector<TilePatch> patches, std::vector<MeshBox>& boxes) {
  std::sort(patches.begin(), patches.end(),
            [](const TilePatch& a, const TilePatch& b) { return a.box.low < b.box.low; });
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const MeshBox& one = patches[i].box;
    for (std::size_t j = i + 1; j < patches.size() && patches[j].box.low[0] <= one.high[0]; ++j) {
      const MeshBox& other = patches[j].box;
      if (patches[i].tile == patches[j].tile || !overlap(one, other)) continue;
      MeshBox both;
      for (std::size_t a = 0; a < 3; ++a) {
        both.low[a] = std::max(one.low[a], other.low[a]);
        both.high[a] = std::min(one.high[a], other.high[a]);
      }
      boxes.push_back(both);
    }
  }
}

}  // namespace

MeshBox box_around(std::span<const Double3> vertices) {
  MeshBox box = nothing();
  for (const Double3& p : vertices) cover(box, p);
  return box;
}

SearchedTile search_tile(const MeshBlock& block, std::span<const std::uint8_t> core,
                         std::vector<MeshBox> patches) {
  SearchedTile out;
  out.patches = std::move(patches);
  bool too_many = false;
  core_contacts(block, core, [&](const ContactFace& one, const ContactFace& other) {
    if (too_many) return;
    MeshBox box = nothing();
    for (const ContactFace* f : {&one, &other})
      for (const Double3& p : f->corner) cover(box, p);
    out.contacts.push_back(box);
    too_many = out.contacts.size() > kMaxOfTile;
  });
  if (too_many) out.contacts = out.patches;
  return out;
}

std::uint64_t search_tile_bytes(std::uint64_t faces) {
  return faces * (sizeof(ContactFace) + 4) + block_contacts_bytes(faces) +
         kMaxOfTile * (sizeof(MeshBox) + sizeof(RegionRecord));
}

SearchedTile unsearched_tile(std::span<const Double3> vertices) {
  const MeshBox box = box_around(vertices);
  return {{box}, {box}};
}

std::uint64_t save_searched(const std::filesystem::path& path, std::span<const SearchedTile> tiles) {
  DirectFile file(path);
  for (const SearchedTile& tile : tiles) {
    std::vector<RegionRecord> records;
    for (const MeshBox& box : tile.patches)
      records.push_back({box, records.empty() ? Around::kFirstPatch : Around::kPatch});
    for (const MeshBox& box : tile.contacts) records.push_back({box, Around::kContact});
    file.write(records.data(), records.size() * sizeof(RegionRecord));
  }
  return file.finish();
}

ContactRegions::ContactRegions(const std::vector<std::filesystem::path>& files) {
  std::vector<TilePatch> patches;
  std::size_t tiles = 0;
  for (const std::filesystem::path& file : files)
    for_each_page<RegionRecord>(file, kRegionPage, [&](std::span<const RegionRecord> page) {
      for (const RegionRecord& r : page) {
        tiles += r.around == Around::kFirstPatch;
        if (r.around == Around::kContact)
          boxes_.push_back(r.box);
        else
          patches.push_back({r.box, tiles});
      }
    });
  if (patches.empty()) throw InputError("smoothing left no list of where faces meet; run again with --force");
  add_overlaps(std::move(patches), boxes_);
  sort();
}

ContactRegions::ContactRegions(const MeshStore& store, std::span<const Double3> at, const PatchRange& longest,
                               double move, bool widely)
    : move_(move * kRegionRounding) {
  const auto longest_in = [&](const std::vector<std::size_t>& patches) {
    double edge = 0.0;
    for (const std::size_t p : patches) edge = std::max(edge, longest.longest_edge[p]);
    return edge + 2.0 * move_;
  };
  for (std::size_t p = 0; p < store.patches().size(); ++p) {
    const MeshBox& box = store.patches()[p].box;
    std::vector<MeshBox> own;
    for (const Double3& v : at) {
      if (!overlap(box, {v, v})) continue;
      own.push_back({v, v});
      if (own.size() <= kMaxOfPatch) continue;
      own.assign(1, box);
      break;
    }
    // Faces around the vertex are of patches that have it.
    const double around = (move_ + longest_in({p})) * kRegionRounding;
    for (const MeshBox& v : own) {
      MeshBox region = grown(v, around);
      if (widely) region = grown(region, longest_in(store.select(grown(region, move_))) * kRegionRounding);
      boxes_.push_back(region);
    }
  }
  sort();
}

void ContactRegions::sort() {
  std::sort(boxes_.begin(), boxes_.end(), [](const MeshBox& a, const MeshBox& b) { return a.low < b.low; });
  for (const MeshBox& b : boxes_) widest_ = std::max(widest_, (b.high[0] - b.low[0]) * kRegionRounding);
}

std::span<const MeshBox> ContactRegions::beside(const MeshBox& box) const {
  const auto lower = [&](const MeshBox& b, double x) { return b.low[0] + widest_ < x; };
  const auto higher = [](double x, const MeshBox& b) { return x < b.low[0]; };
  const auto first = std::lower_bound(boxes_.begin(), boxes_.end(), box.low[0], lower);
  return {first, std::upper_bound(first, boxes_.end(), box.high[0], higher)};
}

bool ContactRegions::near(const MeshBox& patch) const {
  const MeshBox box = grown(patch, move_);
  const std::span<const MeshBox> some = beside(box);
  return std::any_of(some.begin(), some.end(), [&](const MeshBox& b) { return overlap(b, box); });
}

std::vector<std::size_t> ContactRegions::patches(const MeshStore& store) const {
  std::vector<std::size_t> found;
  for (std::size_t p = 0; p < store.patches().size(); ++p)
    if (near(store.patches()[p].box)) found.push_back(p);
  return found;
}

std::vector<std::uint8_t> ContactRegions::faces(const MeshBlock& block, const MeshBox& patch) const {
  const MeshBox whole = grown(patch, move_);
  std::vector<MeshBox> near;
  for (const MeshBox& b : beside(whole)) {
    if (!overlap(b, whole)) continue;
    near.push_back(b);
    if (near.size() > kMaxOfPatch) return std::vector<std::uint8_t>(block.faces.size(), 1);
  }
  std::vector<std::uint8_t> found(block.faces.size(), 0);
  if (near.empty()) return found;
  for (std::size_t f = 0; f < found.size(); ++f) {
    MeshBox box = nothing();
    for (const std::uint32_t v : block.faces[f]) cover(box, block.position[v]);
    found[f] = std::any_of(near.begin(), near.end(), [&](const MeshBox& b) { return overlap(b, box); });
  }
  return found;
}

}  // namespace tessera
