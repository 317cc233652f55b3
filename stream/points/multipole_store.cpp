#include "stream/points/multipole_store.h"

#include <algorithm>

#include "kernels/closing/area_weights.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kMultipoleKind = {"TSMULTI4", "a multipole file"};

struct BrickSlot {
  Section leaves;
  std::uint64_t file = 0;
};

constexpr std::uint64_t kCopies = 2;  ///< of the leaves in near(): as read, and in the tree

/// Calls use(brick) for the bricks that nodes [-1, cells] of a block may be adjacent to.
template <typename Use>
void for_each_brick_near(const Int3& origin, const Int3& cells, const Use& use) {
  Int3 low, high;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = ((origin[a] - 1) >> kBrickBits) - 1;
    high[a] = ((origin[a] + cells[a]) >> kBrickBits) + 1;
  }
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i) use(Int3{i, j, k});
}

}  // namespace

MultipoleFileWriter::MultipoleFileWriter(const std::filesystem::path& path) : file_(path, kMultipoleKind) {}

void MultipoleFileWriter::brick(const std::vector<Multipole>& leaves) {
  // The brick's own is merged level by level, as a tree over all points would.
  const MultipoleTree tree(leaves, std::vector<Dipole>{}, kLeafBits, kBrickBits);
  table_.push_back({file_.append(bytes_of(leaves)), tree.level(kBrickBits).cells.front()});
}

struct MultipoleStore::Impl {
  std::vector<PackedFile> files;
  std::vector<BrickSlot> slots;  ///< per brick of the summary
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

  template <typename Use>
  void for_each_near(const Int3& origin, const Int3& cells, const Use& use) const {
    for_each_brick_near(origin, cells, [&](const Int3& brick) {
      const std::int64_t found = find(brick);
      if (found >= 0) use(static_cast<std::size_t>(found));
    });
  }
};

MultipoleStore::MultipoleStore(const std::filesystem::path& work) : impl_(std::make_unique<Impl>()) {
  std::vector<Multipole> bricks;
  for (const auto& path : list_task_files(work / kFolder, kExtension)) {
    const PackedFile& file =
        impl_->files.emplace_back(path, kMultipoleKind, sizeof(MultipoleFileWriter::Entry));
    for (const auto& e : file.table<MultipoleFileWriter::Entry>()) {
      bricks.push_back(e.whole);
      impl_->slots.push_back({e.leaves, impl_->files.size() - 1});
    }
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
    const BrickSlot& slot = impl_->slots[b];
    const std::vector<Multipole> own = impl_->files[slot.file].load<Multipole>(slot.leaves);
    leaves.insert(leaves.end(), own.begin(), own.end());
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
  std::uint64_t bytes = 0;
  impl_->for_each_near(origin, cells, [&](std::size_t b) { bytes += impl_->slots[b].leaves.bytes; });
  return kCopies * bytes;
}

std::uint64_t MultipoleStore::near_bytes(std::span<const BrickEntry> bricks, const Int3& origin,
                                         const Int3& cells) {
  std::uint64_t leaves = 0;  // one per occupied block at most
  for_each_brick_near(origin, cells, [&](const Int3& at) {
    if (at[0] < 0 || at[1] < 0 || at[2] < 0) return;
    if (const BrickEntry* brick = find_brick(bricks, brick_key(at))) leaves += brick->blocks;
  });
  return kCopies * leaves * sizeof(Multipole);
}

}  // namespace tessera
