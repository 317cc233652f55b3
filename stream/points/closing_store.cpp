#include "stream/points/closing_store.h"

#include <xxhash.h>

#include <algorithm>
#include <string>

#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"

namespace tessera {
namespace {

constexpr char kMagic[8] = {'T', 'S', 'C', 'L', 'O', 'S', 'E', '1'};

struct Footer {
  std::uint64_t table_offset = 0;
  std::uint64_t bricks = 0;
  std::uint64_t table_hash = 0;
  char magic[8] = {};
};

}  // namespace

struct BrickSectionWriter::Impl {
  explicit Impl(const std::filesystem::path& path) : file(path) { file.write(kMagic, sizeof kMagic); }

  template <typename Item>
  void section(std::uint64_t key, const std::vector<Item>& items, const std::vector<Int3>& extra) {
    std::vector<char> bytes;
    const auto append = [&](const void* data, std::size_t size) {
      const auto* from = static_cast<const char*>(data);
      bytes.insert(bytes.end(), from, from + size);
    };
    append(items.data(), items.size() * sizeof(Item));
    append(extra.data(), extra.size() * sizeof(Int3));
    table.push_back(
        {key, file.offset(), XXH3_64bits(bytes.data(), bytes.size()), items.size(), extra.size()});
    file.write(bytes.data(), bytes.size());
  }

  DirectFile file;
  std::vector<BrickSection> table;
};

BrickSectionWriter::BrickSectionWriter(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}
BrickSectionWriter::~BrickSectionWriter() = default;

void BrickSectionWriter::signs(std::uint64_t key, const std::vector<BandSigns>& signs,
                               const std::vector<Int3>& rims) {
  impl_->section(key, signs, rims);
}
void BrickSectionWriter::cells(std::uint64_t key, const std::vector<ClosingLeaf>& leaves) {
  impl_->section(key, leaves, {});
}

std::uint64_t BrickSectionWriter::finish() {
  Footer footer;
  footer.table_offset = impl_->file.offset();
  footer.bricks = impl_->table.size();
  footer.table_hash = XXH3_64bits(impl_->table.data(), impl_->table.size() * sizeof(BrickSection));
  std::copy(std::begin(kMagic), std::end(kMagic), footer.magic);
  impl_->file.write(impl_->table.data(), impl_->table.size() * sizeof(BrickSection));
  impl_->file.write(&footer, sizeof footer);
  return impl_->file.finish();
}

struct BrickSectionStore::Impl {
  std::vector<ReadFile> files;
  std::vector<std::size_t> file_end;  ///< per file: index of the brick after its last
  std::vector<BrickSection> bricks;

  template <typename Item>
  void read(const BrickSection& brick, std::vector<Item>* items, std::vector<Int3>* extra) const {
    const auto index = static_cast<std::size_t>(&brick - bricks.data());
    const auto file = static_cast<std::size_t>(std::upper_bound(file_end.begin(), file_end.end(), index) -
                                               file_end.begin());
    std::vector<char> bytes(brick.count * sizeof(Item) + brick.extra * sizeof(Int3));
    files[file].read_at(brick.offset, bytes.data(), bytes.size());
    if (XXH3_64bits(bytes.data(), bytes.size()) != brick.hash)
      throw InputError(files[file].path().string() + ": byte " + std::to_string(brick.offset) +
                       ": checksum of a brick differs, the file is damaged; run again with --force");
    const char* from = bytes.data();
    if (items) {
      const std::size_t old = items->size();
      items->resize(old + brick.count);
      std::copy(from, from + brick.count * sizeof(Item), reinterpret_cast<char*>(items->data() + old));
    }
    from += brick.count * sizeof(Item);
    if (extra) {
      extra->resize(brick.extra);
      std::copy(from, from + brick.extra * sizeof(Int3), reinterpret_cast<char*>(extra->data()));
    }
  }
};

BrickSectionStore::BrickSectionStore(const std::vector<std::filesystem::path>& paths)
    : impl_(std::make_unique<Impl>()) {
  for (const auto& path : paths) {
    ReadFile file(path);
    const auto damaged = [&](const char* what) {
      return InputError(path.string() + ": " + what + ", the file is damaged; run again with --force");
    };
    Footer footer;
    if (file.size() < sizeof footer + sizeof kMagic) throw damaged("too short for a file of bricks");
    file.read_at(file.size() - sizeof footer, &footer, sizeof footer);
    if (!std::equal(std::begin(kMagic), std::end(kMagic), footer.magic)) throw damaged("no footer");
    if (footer.bricks > file.size() ||
        footer.table_offset + footer.bricks * sizeof(BrickSection) + sizeof footer != file.size())
      throw damaged("brick table does not fit");
    const std::size_t old = impl_->bricks.size();
    impl_->bricks.resize(old + footer.bricks);
    const std::uint64_t bytes = footer.bricks * sizeof(BrickSection);
    if (bytes != 0) file.read_at(footer.table_offset, impl_->bricks.data() + old, bytes);
    if (XXH3_64bits(impl_->bricks.data() + old, bytes) != footer.table_hash)
      throw damaged("checksum of the brick table differs");
    impl_->files.push_back(std::move(file));
    impl_->file_end.push_back(impl_->bricks.size());
  }
}
BrickSectionStore::~BrickSectionStore() = default;

std::span<const BrickSection> BrickSectionStore::bricks() const {
  return impl_->bricks;
}

const BrickSection* BrickSectionStore::find(const Int3& brick) const {
  for (const int c : brick)
    if (c < 0) return nullptr;
  const std::uint64_t key = brick_key(brick);
  const auto it = std::lower_bound(impl_->bricks.begin(), impl_->bricks.end(), key,
                                   [](const BrickSection& b, std::uint64_t k) { return b.key < k; });
  return it == impl_->bricks.end() || it->key != key ? nullptr : &*it;
}

std::vector<BandSigns> BrickSectionStore::signs_around(const Int3& brick) const {
  std::vector<BandSigns> out;
  for (int d = 0; d < 8; ++d) {
    const BrickSection* found = find({brick[0] + (d & 1), brick[1] + (d >> 1 & 1), brick[2] + (d >> 2)});
    if (!found) continue;
    const std::size_t old = out.size();
    impl_->read(*found, &out, nullptr);
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

std::vector<Int3> BrickSectionStore::rims(const BrickSection& brick) const {
  std::vector<Int3> out;
  impl_->read<BandSigns>(brick, nullptr, &out);
  return out;
}

std::vector<ClosingLeaf> BrickSectionStore::cells_around(const Int3& origin, const Int3& cells) const {
  Int3 low, high;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = (origin[a] - 1) >> kBrickBits;
    high[a] = (origin[a] + cells[a]) >> kBrickBits;
  }
  std::vector<ClosingLeaf> out;
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i)
        if (const BrickSection* found = find({i, j, k})) impl_->read(*found, &out, nullptr);
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
