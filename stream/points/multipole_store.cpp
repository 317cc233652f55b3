#include "stream/points/multipole_store.h"

#include <xxhash.h>

#include <algorithm>
#include <string>

#include "kernels/closing/area_weights.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr char kMagic[8] = {'T', 'S', 'M', 'U', 'L', 'T', 'I', '3'};

struct Entry {
  std::uint64_t key = 0;
  std::uint64_t offset = 0;
  std::uint64_t hash = 0;
  std::uint64_t leaves = 0;
  Multipole whole;
};
struct Footer {
  std::uint64_t table_offset = 0;
  std::uint64_t bricks = 0;
  std::uint64_t table_hash = 0;
  char magic[8] = {};
};
struct Place {
  std::uint64_t offset = 0;
  std::uint64_t hash = 0;
  std::uint32_t file = 0;
  std::uint32_t leaves = 0;
};

}  // namespace

struct MultipoleFileWriter::Impl {
  explicit Impl(const std::filesystem::path& path) : file(path) { file.write(kMagic, sizeof kMagic); }
  DirectFile file;
  std::vector<Entry> table;
};

MultipoleFileWriter::MultipoleFileWriter(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}
MultipoleFileWriter::~MultipoleFileWriter() = default;

void MultipoleFileWriter::brick(std::uint64_t key, const std::vector<Multipole>& leaves) {
  // The brick's own is merged level by level, as a tree over all points would.
  const MultipoleTree tree(leaves, std::vector<Dipole>{}, kLeafBits, kBrickBits);
  Entry e;
  e.key = key;
  e.offset = impl_->file.offset();
  e.leaves = leaves.size();
  e.hash = XXH3_64bits(leaves.data(), leaves.size() * sizeof(Multipole));
  e.whole = tree.level(kBrickBits).cells.front();
  impl_->file.write(leaves.data(), leaves.size() * sizeof(Multipole));
  impl_->table.push_back(e);
}

std::uint64_t MultipoleFileWriter::finish() {
  Footer footer;
  footer.table_offset = impl_->file.offset();
  footer.bricks = impl_->table.size();
  footer.table_hash = XXH3_64bits(impl_->table.data(), impl_->table.size() * sizeof(Entry));
  std::copy(std::begin(kMagic), std::end(kMagic), footer.magic);
  impl_->file.write(impl_->table.data(), impl_->table.size() * sizeof(Entry));
  impl_->file.write(&footer, sizeof footer);
  return impl_->file.finish();
}

struct MultipoleStore::Impl {
  std::vector<ReadFile> files;
  std::vector<Place> places;  ///< per brick of the summary
  std::unique_ptr<MultipoleTree> far;

  std::int64_t find(const Int3& brick) const {
    for (const int c : brick)
      if (c < 0) return -1;
    const std::uint64_t key = brick_key(brick);
    const auto& cells = far->level(kBrickBits).cells;
    const auto it = std::lower_bound(cells.begin(), cells.end(), key,
                                     [](const Multipole& m, std::uint64_t k) { return m.key < k; });
    return it == cells.end() || it->key != key ? -1 : it - cells.begin();
  }

  /// Calls use(index) for the bricks that nodes [-1, cells] of a block may be adjacent to.
  template <typename Use>
  void for_each_near(const Int3& origin, const Int3& cells, const Use& use) const {
    Int3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = ((origin[a] - 1) >> kBrickBits) - 1;
      high[a] = ((origin[a] + cells[a]) >> kBrickBits) + 1;
    }
    for (int k = low[2]; k <= high[2]; ++k)
      for (int j = low[1]; j <= high[1]; ++j)
        for (int i = low[0]; i <= high[0]; ++i) {
          const std::int64_t found = find({i, j, k});
          if (found >= 0) use(static_cast<std::size_t>(found));
        }
  }
};

MultipoleStore::MultipoleStore(const std::filesystem::path& work) : impl_(std::make_unique<Impl>()) {
  std::vector<Multipole> bricks;
  for (const auto& path : list_task_files(work / kFolder, kExtension)) {
    ReadFile file(path);
    const auto damaged = [&](const char* what) {
      return InputError(path.string() + ": " + what + ", the file is damaged; run again with --force");
    };
    Footer footer;
    if (file.size() < sizeof footer + sizeof kMagic) throw damaged("too short for a multipole file");
    file.read_at(file.size() - sizeof footer, &footer, sizeof footer);
    if (!std::equal(std::begin(kMagic), std::end(kMagic), footer.magic)) throw damaged("no multipole footer");
    if (footer.bricks > file.size() ||
        footer.table_offset + footer.bricks * sizeof(Entry) + sizeof footer != file.size())
      throw damaged("brick table does not fit");
    std::vector<Entry> table(footer.bricks);
    if (!table.empty()) file.read_at(footer.table_offset, table.data(), table.size() * sizeof(Entry));
    if (XXH3_64bits(table.data(), table.size() * sizeof(Entry)) != footer.table_hash)
      throw damaged("checksum of the brick table differs");
    for (const Entry& e : table) {
      bricks.push_back(e.whole);
      impl_->places.push_back({e.offset, e.hash, static_cast<std::uint32_t>(impl_->files.size()),
                               static_cast<std::uint32_t>(e.leaves)});
    }
    impl_->files.push_back(std::move(file));
  }
  impl_->far = std::make_unique<MultipoleTree>(std::move(bricks), std::vector<Dipole>{}, kBrickBits);
}
MultipoleStore::~MultipoleStore() = default;

const MultipoleTree& MultipoleStore::far() const {
  return *impl_->far;
}

MultipoleTree MultipoleStore::near(const PointBlock& points) const {
  std::vector<std::size_t> bricks;
  impl_->for_each_near(points.origin, points.cells, [&](std::size_t b) { bricks.push_back(b); });
  std::sort(bricks.begin(), bricks.end());  // the summary is in key order
  std::vector<Multipole> leaves;
  for (const std::size_t b : bricks) {
    const Place& place = impl_->places[b];
    const ReadFile& file = impl_->files[place.file];
    const std::size_t old = leaves.size();
    leaves.resize(old + place.leaves);
    const std::uint64_t bytes = place.leaves * sizeof(Multipole);
    file.read_at(place.offset, leaves.data() + old, bytes);
    if (XXH3_64bits(leaves.data() + old, bytes) != place.hash)
      throw InputError(
          file.path().string() + ": byte " + std::to_string(place.offset) +
          ": checksum of a brick's multipoles differs, the file is damaged; run again with --force");
  }
  std::vector<Dipole> dipoles = make_dipoles(points);
  std::erase_if(dipoles, [&](const Dipole& d) {
    bool in = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const int cell = (d.q[a] >> kQuantumBits) - points.origin[a];
      in &= cell >= -kHaloCells && cell < points.cells[a] + kHaloCells;
    }
    return !in;
  });
  return {std::move(leaves), std::move(dipoles), kLeafBits, kBrickBits};
}

std::uint64_t MultipoleStore::near_bytes(const Int3& origin, const Int3& cells) const {
  std::uint64_t leaves = 0;
  impl_->for_each_near(origin, cells, [&](std::size_t b) { leaves += impl_->places[b].leaves; });
  return leaves * sizeof(Multipole) * 2;
}

}  // namespace tessera
