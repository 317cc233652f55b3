#include "stream/points/closing_store.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr PackedKind kClosingKind = {"TSCLOSE3", "a file of rims or closing cells"};

/// The items of a brick, behind what `items` holds.
template <typename Item>
void read(const PackedTables<BrickSection>& bricks, const BrickSection& brick, std::vector<Item>& items,
          std::vector<Int3>& extra) {
  const std::size_t old = items.size();
  items.resize(old + brick.count);
  extra.resize(brick.extra);
  const auto buffer = std::as_writable_bytes(std::span(items).subspan(old));
  bricks.file_of(brick).read(brick.section(sizeof(Item)), {buffer, buffer_of(extra)});
}

}  // namespace

BrickSectionWriter::BrickSectionWriter(const std::filesystem::path& path) : file_(path, kClosingKind) {}

void BrickSectionWriter::signs(std::uint64_t key, const std::vector<BandSigns>& signs,
                               const std::vector<Int3>& boundaries) {
  const Section s = file_.append({bytes_of(signs), bytes_of(boundaries)});
  table_.push_back({key, s.offset, s.hash, signs.size(), boundaries.size()});
}
void BrickSectionWriter::cells(std::uint64_t key, const std::vector<ClosingLeaf>& leaves) {
  const Section s = file_.append(bytes_of(leaves));
  table_.push_back({key, s.offset, s.hash, leaves.size(), 0});
}

BrickSectionStore::BrickSectionStore(const std::vector<std::filesystem::path>& paths)
    : bricks_(paths, kClosingKind) {}

const BrickSection* BrickSectionStore::find(const Int3& brick) const {
  for (const int c : brick)
    if (c < 0) return nullptr;
  return bricks_.find(brick_key(brick));
}

std::vector<BandSigns> BrickSectionStore::signs_around(const Int3& brick) const {
  std::vector<BandSigns> out;
  std::vector<Int3> boundaries;
  for (int d = 0; d < 8; ++d) {
    const BrickSection* found = find({brick[0] + (d & 1), brick[1] + (d >> 1 & 1), brick[2] + (d >> 2)});
    if (!found) continue;
    const std::size_t old = out.size();
    read(bricks_, *found, out, boundaries);
    if (d == 0) continue;
    const auto beyond = [&](const BandSigns& s) {
      for (std::size_t a = 0; a < 3; ++a)
        if (s.origin[a] > (brick[a] + 1) * kBrickCells) return true;
      return false;
    };
    out.erase(std::remove_if(out.begin() + static_cast<std::ptrdiff_t>(old), out.end(), beyond), out.end());
  }
  return out;
}

std::vector<Int3> BrickSectionStore::boundaries(const BrickSection& brick) const {
  std::vector<Int3> out;
  std::vector<BandSigns> signs;
  read(bricks_, brick, signs, out);
  return out;
}

std::vector<ClosingLeaf> BrickSectionStore::cells_around(const Int3& origin, const Int3& cells) const {
  Int3 low, high;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = (origin[a] - 1) >> kBrickBits;
    high[a] = (origin[a] + cells[a]) >> kBrickBits;
  }
  std::vector<ClosingLeaf> out;
  std::vector<Int3> none;
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i)
        if (const BrickSection* found = find({i, j, k})) read(bricks_, *found, out, none);
  std::erase_if(out, [&](const ClosingLeaf& leaf) {
    for (std::size_t a = 0; a < 3; ++a)
      if (leaf.origin[a] < origin[a] - kLeafCells || leaf.origin[a] > origin[a] + cells[a]) return true;
    return false;
  });
  return out;
}

std::vector<std::filesystem::path> closing_files(const std::filesystem::path& work) {
  const std::filesystem::path path = work / kClosingFile;
  if (!std::filesystem::exists(path)) return {};
  return {path};
}

}  // namespace tessera
