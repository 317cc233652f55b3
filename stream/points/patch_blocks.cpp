#include "stream/points/patch_blocks.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kLinksKind = {"TSLINKS1", "a file of links between patches"};
constexpr PackedKind kSceneKind = {"TSSCENE2", "a file of the scene's tops"};
constexpr PackedKind kAnchorsKind = {"TSANCHR1", "a file of patches and what they hang on"};

constexpr int kBlockBits = 3;  ///< bricks along the edge of the largest block, as a power of two
constexpr int kMortonBits = 63;
constexpr std::uint64_t kMaxPatches = 1 << 16;
constexpr std::uint64_t kTaskBricks = 512;

struct SceneInfo {
  double covered = 0.0, roofed = 0.0, level = 0.0, ground = 0.0;
  std::uint64_t from_above = 0;
};

}  // namespace

std::vector<PatchBlock> list_patch_blocks(const PointOverlay& overlay) {
  const std::span<const OverlayBrick> bricks = overlay.bricks();
  const std::span<const std::uint64_t> first_patch = overlay.first_patch();
  std::vector<PatchBlock> blocks;
  // Cubes of the octree are ranges of Morton keys: the key of a cube is that of its bricks without their last bits.
  const auto split = [&](const auto& self, std::size_t first, std::size_t last, int bits) -> void {
    const std::uint64_t patches = first_patch[last] - first_patch[first];
    if (bits <= 3 * kBlockBits && (bits == 0 || patches <= kMaxPatches)) {
      PatchBlock& block = blocks.emplace_back(
          PatchBlock{first, last, first_patch[first], static_cast<std::uint32_t>(patches), 0});
      for (const OverlayBrick& b : bricks.subspan(first, last - first)) block.coarse += b.coarse;
      return;
    }
    for (std::size_t begin = first; begin < last;) {
      const std::uint64_t cube = bricks[begin].key >> (bits - 3);
      std::size_t end = begin + 1;
      while (end < last && bricks[end].key >> (bits - 3) == cube) ++end;
      self(self, begin, end, bits - 3);
      begin = end;
    }
  };
  if (!bricks.empty()) split(split, 0, bricks.size(), kMortonBits);
  return blocks;
}

std::vector<PatchBlockRange> group_patch_blocks(const std::vector<PatchBlock>& blocks) {
  std::vector<PatchBlockRange> ranges;
  std::uint64_t patches = 0, bricks = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    patches += blocks[b].patches, bricks += blocks[b].last_brick - blocks[b].first_brick;
    if (patches < kMaxPatches && bricks < kTaskBricks && b + 1 < blocks.size()) continue;
    ranges.push_back({ranges.empty() ? 0 : ranges.back().last, b + 1});
    patches = bricks = 0;
  }
  return ranges;
}

LinksFileWriter::LinksFileWriter(const std::filesystem::path& path) : file_(path, kLinksKind) {}

void LinksFileWriter::block(std::uint64_t key, const std::vector<PatchVote>& inner,
                            const std::vector<PatchVote>& outer, const PatchGroups& groups) {
  std::vector<PatchGroup> group(groups.of.size());
  for (std::size_t p = 0; p < group.size(); ++p) group[p] = {groups.of[p], groups.sign[p]};
  LinksEntry e;
  e.key = key;
  e.inner = file_.append(bytes_of(inner));
  e.outer = file_.append(bytes_of(outer));
  e.group = file_.append(bytes_of(group));
  table_.push_back(e);
}

PatchLinks::PatchLinks(const std::filesystem::path& work)
    : tables_(list_task_files(work / kFolder, kExtension), kLinksKind) {}

std::vector<PatchVote> PatchLinks::outer() const {
  std::vector<PatchVote> all;
  for (std::size_t b = 0; b < block_count(); ++b) {
    const std::vector<PatchVote> of = outer(b);
    all.insert(all.end(), of.begin(), of.end());
  }
  return all;
}

PatchGroups PatchLinks::groups(std::size_t block, const std::vector<std::uint64_t>& weight) const {
  PatchGroups groups;
  for (const PatchGroup& g : load<PatchGroup>(block, tables_[block].group)) {
    if (g.group >= groups.size.size()) groups.size.resize(g.group + std::size_t{1}, 0);
    groups.size[g.group] += weight[groups.of.size()];
    groups.of.push_back(g.group);
    groups.sign.push_back(static_cast<std::int8_t>(g.sign));
  }
  return groups;
}

void OrientationScene::save(const std::filesystem::path& path) const {
  PackedWriter file(path, kSceneKind);
  const std::vector<Section> table = {file.append(bytes_of(border)), file.append(bytes_of(columns))};
  const std::array<SceneInfo, 1> info = {
      {{covered, roofed, level, ground, from_above ? std::uint64_t{1} : 0}}};
  file.finish(table, std::as_bytes(std::span(info)));
}

OrientationScene OrientationScene::load(const std::filesystem::path& path) {
  const PackedFile file(path, kSceneKind, sizeof(Section), sizeof(SceneInfo));
  SceneInfo info;
  std::memcpy(&info, file.info().data(), sizeof info);
  const std::vector<Section> table = file.table<Section>();
  return {info.from_above != 0,
          info.covered,
          info.roofed,
          info.level,
          info.ground,
          file.load<std::uint32_t>(table.at(0)),
          file.load<TopColumns::Column>(table.at(1))};
}

std::vector<std::uint8_t> OrientationScene::border_of(const PatchBlock& block) const {
  std::vector<std::uint8_t> of(block.patches, 0);
  for (auto p = std::lower_bound(border.begin(), border.end(), block.first_patch);
       p != border.end() && *p < block.first_patch + block.patches; ++p)
    of[*p - block.first_patch] = 1;
  return of;
}

AnchorsFileWriter::AnchorsFileWriter(const std::filesystem::path& path) : file_(path, kAnchorsKind) {}

void AnchorsFileWriter::block(std::uint64_t key, const BlockSigns& signs) {
  AnchorsEntry e;
  e.key = key;
  e.patches = file_.append(bytes_of(signs.patches));
  e.weight = file_.append(bytes_of(signs.weight));
  e.links = file_.append(bytes_of(signs.links));
  e.sides = file_.append(bytes_of(signs.sides));
  e.broken_votes = signs.broken_votes, e.inner_votes = signs.inner_votes;
  table_.push_back(e);
}

PatchAnchors::PatchAnchors(const std::filesystem::path& work)
    : tables_(list_task_files(work / kFolder, kExtension), kAnchorsKind) {}

std::uint64_t PatchAnchors::anchor_count() const {
  std::uint64_t n = 0;
  for (const AnchorsEntry& e : entries()) n += e.weight.bytes / sizeof(std::uint64_t);
  return n;
}

std::uint64_t PatchAnchors::vote_count() const {
  std::uint64_t n = 0;
  for (const AnchorsEntry& e : entries()) n += (e.links.bytes + e.sides.bytes) / sizeof(PatchVote);
  return n;
}

std::vector<JobSurfel> load_surfels(const PointOverlay& overlay, const PatchBlock& block,
                                    const std::vector<PatchStats>& stats) {
  std::vector<JobSurfel> surfels;
  for (std::size_t b = block.first_brick; b < block.last_brick; ++b) {
    const Int3 brick = brick_of_key(overlay.bricks()[b].key);
    const auto first = static_cast<std::uint32_t>(overlay.first_patch()[b] - block.first_patch);
    for (const CoarseSurfel& c : overlay.load_coarse(b)) {
      JobSurfel s;
      for (std::size_t a = 0; a < 3; ++a) {  // far from the origin the sum may round into the next brick
        const float end = std::nextafter(static_cast<float>((brick[a] + 1) * kBrickCells), 0.0f);
        s.position[a] = std::min(static_cast<float>(brick[a] * kBrickCells) + c.position[a], end);
      }
      s.area = c.area;
      s.patch = first + c.patch;
      s.surfels = c.surfels;
      s.points = static_cast<float>(stats[s.patch].points) / static_cast<float>(stats[s.patch].surfels);
      surfels.push_back(s);
    }
  }
  return surfels;
}

std::vector<PatchStats> load_stats(const PointOverlay& overlay, const PatchBlock& block) {
  std::vector<PatchStats> stats;
  stats.reserve(block.patches);
  for (std::size_t b = block.first_brick; b < block.last_brick; ++b) {
    const std::vector<PatchStats> of = overlay.load_stats(b);
    stats.insert(stats.end(), of.begin(), of.end());
  }
  return stats;
}

}  // namespace tessera
