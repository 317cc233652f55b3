#include "stream/stages/smooth/contact_regions.h"

#include <algorithm>
#include <limits>

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

/// A tile, or a box of contacts behind it.
struct RegionRecord {
  MeshBox box;
  std::uint64_t is_tile = 0;
};

MeshBox nothing() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
}
void cover(MeshBox& box, const Double3& p) {
  for (std::size_t a = 0; a < 3; ++a)
    box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
}

/// Tiles sorted by their low sides.
void add_overlaps(std::vector<MeshBox> tiles, std::vector<MeshBox>& boxes) {
  std::sort(tiles.begin(), tiles.end(), [](const MeshBox& a, const MeshBox& b) { return a.low < b.low; });
  for (std::size_t i = 0; i < tiles.size(); ++i)
    for (std::size_t j = i + 1; j < tiles.size() && tiles[j].low[0] <= tiles[i].high[0]; ++j) {
      if (!overlap(tiles[i], tiles[j])) continue;
      MeshBox both;
      for (std::size_t a = 0; a < 3; ++a) {
        both.low[a] = std::max(tiles[i].low[a], tiles[j].low[a]);
        both.high[a] = std::min(tiles[i].high[a], tiles[j].high[a]);
      }
      boxes.push_back(both);
    }
}

}  // namespace

SearchedTile search_tile(const MeshBlock& block, std::span<const std::uint8_t> core) {
  SearchedTile out;
  out.box = nothing();
  for (std::size_t f = 0; f < core.size(); ++f)
    if (core[f] != 0)
      for (const std::uint32_t v : block.faces[f]) cover(out.box, block.position[v]);
  bool too_many = false;
  core_contacts(block, core, [&](const ContactFace& one, const ContactFace& other) {
    if (too_many) return;
    MeshBox box = nothing();
    for (const ContactFace* f : {&one, &other})
      for (const Double3& p : f->corner) cover(box, p);
    out.contacts.push_back(box);
    too_many = out.contacts.size() > kMaxOfTile;
  });
  if (too_many) out.contacts.assign(1, out.box);
  return out;
}

std::uint64_t search_tile_bytes(std::uint64_t faces) {
  return faces * (sizeof(ContactFace) + 4) + block_contacts_bytes(faces) +
         kMaxOfTile * (sizeof(MeshBox) + sizeof(RegionRecord));
}

SearchedTile unsearched_tile(std::span<const Double3> vertices) {
  MeshBox box = nothing();
  for (const Double3& p : vertices) cover(box, p);
  return {box, {box}};
}

std::uint64_t save_searched(const std::filesystem::path& path, std::span<const SearchedTile> tiles) {
  DirectFile file(path);
  for (const SearchedTile& tile : tiles) {
    std::vector<RegionRecord> records = {{tile.box, 1}};
    for (const MeshBox& box : tile.contacts) records.push_back({box, 0});
    file.write(records.data(), records.size() * sizeof(RegionRecord));
  }
  return file.finish();
}

ContactRegions::ContactRegions(const std::vector<std::filesystem::path>& files) {
  std::vector<MeshBox> tiles;
  for (const std::filesystem::path& file : files)
    for_each_page<RegionRecord>(file, kRegionPage, [&](std::span<const RegionRecord> page) {
      for (const RegionRecord& r : page) (r.is_tile != 0 ? tiles : boxes_).push_back(r.box);
    });
  if (tiles.empty()) throw InputError("smoothing left no list of where faces meet; run again with --force");
  add_overlaps(std::move(tiles), boxes_);
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
}

std::vector<std::size_t> ContactRegions::patches(const MeshStore& store) const {
  std::vector<std::uint8_t> with(store.patches().size(), 0);
  for (std::size_t p = 0; p < with.size(); ++p) {
    const MeshBox box = grown(store.patches()[p].box, move_);
    with[p] = std::any_of(boxes_.begin(), boxes_.end(), [&](const MeshBox& b) { return overlap(b, box); });
  }
  std::vector<std::size_t> found;
  for (std::size_t p = 0; p < with.size(); ++p)
    if (with[p] != 0) found.push_back(p);
  return found;
}

std::vector<std::uint8_t> ContactRegions::faces(const MeshBlock& block, const MeshBox& patch) const {
  const MeshBox whole = grown(patch, move_);
  std::vector<MeshBox> near;
  for (const MeshBox& b : boxes_) {
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
