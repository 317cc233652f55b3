#include "stream/points/point_store.h"

#include <algorithm>
#include <cassert>
#include <optional>

#include "octree/error.h"
#include "stream/files/task_files.h"
#include "stream/points/point_overlay.h"

namespace tessera {
namespace {

constexpr int kBlockQuantumBits = kLeafBits + kQuantumBits;
constexpr int kBlocksPerAxis = kBrickCells / kLeafCells;
// A chunk of records fits the second-level cache together with what is made of it.
constexpr std::uint64_t kChunkPoints = 12288;
// Reading over a gap of this many points is cheaper than a second request.
constexpr std::uint64_t kGapPoints = 512;

struct DiskBlock {
  std::uint32_t code = 0;   ///< 9-bit Morton code of the 8^3-cell block in its brick
  std::uint32_t first = 0;  ///< index of its first point in the brick
};
static_assert(sizeof(DiskBlock) == 8 && sizeof(BrickEntry) == 48);

std::uint32_t block_code(const Int3& q) {
  constexpr std::uint32_t kSpread[kBlocksPerAxis] = {0, 1, 8, 9, 64, 65, 72, 73};
  const auto at = [&](std::size_t axis) {
    return kSpread[static_cast<std::uint32_t>(q[axis]) >> kBlockQuantumBits & (kBlocksPerAxis - 1)];
  };
  return at(0) | at(1) << 1 | at(2) << 2;
}

}  // namespace

PointFileWriter::PointFileWriter(const std::filesystem::path& path, std::size_t buffer_bytes)
    : file_(path, kPointFile, buffer_bytes) {}

void PointFileWriter::brick(std::uint64_t key, std::span<const PointRecord> points) {
  assert(!points.empty() && (table_.empty() || table_.back().key < key));
  std::vector<DiskBlock> blocks;
  std::uint32_t last = ~0u;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::uint32_t code = block_code(points[i].q);
    if (code == last) continue;
    assert(last == ~0u || code > last);
    blocks.push_back({code, static_cast<std::uint32_t>(i)});
    last = code;
  }
  const Section records = file_.append(std::as_bytes(points));
  const Section table = file_.append(bytes_of(blocks));
  table_.push_back({key, points.size(), records.offset, records.hash, table.hash, blocks.size()});
}

const BrickEntry* find_brick(std::span<const BrickEntry> bricks, std::uint64_t key) {
  const auto at = std::lower_bound(bricks.begin(), bricks.end(), key,
                                   [](const BrickEntry& b, std::uint64_t k) { return b.key < k; });
  return at != bricks.end() && at->key == key ? &*at : nullptr;
}

struct PointStore::Impl {
  PackedTables<BrickEntry> bricks;
  std::shared_ptr<const PointOverlay> overlay;
  bool holds_samples = false;  ///< of the top surface, told by their flags

  std::vector<DiskBlock> blocks_of(const BrickEntry& brick) const {
    return bricks.file_of(brick).load<DiskBlock>(brick.block_table());
  }
  /// Calls use(records, count) for points [first, first + count) of a brick, in order, in chunks, as the overlay
  /// has them.
  template <typename Use>
  void stream(const BrickEntry& brick, std::uint64_t first, std::uint64_t count,
              std::vector<PointRecord>& buffer, const Use& use) const;
};

template <typename Use>
void PointStore::Impl::stream(const BrickEntry& brick, std::uint64_t first, std::uint64_t count,
                              std::vector<PointRecord>& buffer, const Use& use) const {
  const PackedFile& file = bricks.file_of(brick);
  std::optional<SectionReader> whole;
  if (count == brick.points) whole.emplace(file, brick.records());
  buffer.resize(std::max<std::size_t>(buffer.size(), std::min(count, kChunkPoints)));
  for (std::uint64_t done = 0; done < count;) {
    const std::uint64_t part = std::min(count - done, kChunkPoints);
    const std::uint64_t bytes = part * sizeof(PointRecord);
    if (whole)
      whole->next(buffer.data(), bytes);
    else
      file.read_part(brick.records(), (first + done) * sizeof(PointRecord), buffer.data(), bytes);
    if (overlay) overlay->apply(brick.key, first + done, {buffer.data(), static_cast<std::size_t>(part)});
    use(buffer.data(), static_cast<std::size_t>(part));
    done += part;
  }
}

PointStore::PointStore(const std::vector<std::filesystem::path>& files,
                       std::shared_ptr<const PointOverlay> overlay)
    : impl_(new Impl{{files, kPointFile}, std::move(overlay)}) {}
PointStore::PointStore(PointStore&&) noexcept = default;
PointStore::~PointStore() = default;

PointStore PointStore::of_surface(const std::filesystem::path& work) {
  const auto made = list_task_files(work / kSurfacePointFolder, kPointExtension);
  if (!made.empty()) {
    PointStore store(made);
    store.impl_->holds_samples = true;
    return store;
  }
  return PointStore(list_task_files(work / kScanPointFolder, kPointExtension), PointOverlay::open(work));
}

std::span<const BrickEntry> PointStore::bricks() const {
  return impl_->bricks.entries();
}
const BrickEntry* PointStore::find(std::uint64_t key) const {
  return impl_->bricks.find(key);
}
std::size_t PointStore::file_count() const {
  return impl_->bricks.file_count();
}
std::pair<std::size_t, std::size_t> PointStore::file_range(std::size_t file) const {
  return impl_->bricks.file_range(file);
}
std::uint64_t PointStore::point_count() const {
  std::uint64_t points = 0;
  for (const BrickEntry& b : bricks()) points += b.points;
  return points;
}

namespace {

/// A half-open box of the lattice, in cells.
struct CellBox {
  Int3 min, max;
  bool holds_brick(const Int3& brick) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (brick[a] * kBrickCells < min[a] || (brick[a] + 1) * kBrickCells > max[a]) return false;
    return true;
  }
};

CellBox cell_box_of(const Int3& origin, const Int3& cells, int halo) {
  CellBox box{};
  for (std::size_t a = 0; a < 3; ++a) {
    box.min[a] = std::max(0, origin[a] - halo);
    box.max[a] = std::min(1 << kMaxCellBits, origin[a] + cells[a] + halo);
  }
  return box;
}

/// Consecutive points of a brick that are to be read.
struct Segment {
  const BrickEntry* brick;
  std::uint64_t first, count;
  bool inside;  ///< every point lies in the box
};

/// Runs of the blocks of `brick` that touch the box; small gaps are read over and filtered.
void partial_segments(const BrickEntry& brick, const std::vector<DiskBlock>& blocks, const Int3& at,
                      const CellBox& box, std::vector<Segment>& out) {
  const std::size_t before = out.size();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const auto c = morton_decode(blocks[b].code);
    bool touches = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const int low = at[a] * kBrickCells + static_cast<int>(c[a]) * kLeafCells;
      touches = touches && low < box.max[a] && low + kLeafCells > box.min[a];
    }
    if (!touches) continue;
    const std::uint64_t first = blocks[b].first;
    const std::uint64_t end = b + 1 < blocks.size() ? blocks[b + 1].first : brick.points;
    if (out.size() > before && first - (out.back().first + out.back().count) <= kGapPoints)
      out.back().count = end - out.back().first;
    else
      out.push_back({&brick, first, end - first, false});
  }
}

/// Calls use(brick entry, brick coordinates, whole) for the occupied bricks that touch the box, ascending
/// key.
template <typename Bricks, typename Use>
void for_bricks(const Bricks& store, const CellBox& box, const Use& use) {
  std::vector<std::uint64_t> keys;
  Int3 low{};
  Int3 high{};
  for (std::size_t a = 0; a < 3; ++a) {
    if (box.min[a] >= box.max[a]) return;
    low[a] = box.min[a] >> kBrickBits;
    high[a] = (box.max[a] - 1) >> kBrickBits;
  }
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i) keys.push_back(brick_key({i, j, k}));
  std::sort(keys.begin(), keys.end());
  for (const std::uint64_t key : keys) {
    const BrickEntry* brick = store.find(key);
    if (!brick) continue;
    const Int3 at = brick_of_key(key);
    use(*brick, at, box.holds_brick(at));
  }
}

}  // namespace

PointBlock PointStore::load(const Int3& origin_cells, const Int3& cells, int halo_cells,
                            const PointFields& fields) const {
  const bool with_normals = fields.normals, with_sensor = fields.sensor,
             with_flags = fields.flags || impl_->holds_samples;
  const CellBox box = cell_box_of(origin_cells, cells, halo_cells);
  std::vector<Segment> segments;
  for_bricks(impl_->bricks, box, [&](const BrickEntry& brick, const Int3& at, bool whole) {
    if (whole)
      segments.push_back({&brick, 0, brick.points, true});
    else
      partial_segments(brick, impl_->blocks_of(brick), at, box, segments);
  });
  std::size_t bound = 0;
  for (const Segment& s : segments) bound += s.count;

  PointBlock out;
  out.origin = origin_cells;
  out.cells = cells;
  for (auto* v : {&out.x, &out.y, &out.z}) v->resize(bound);
  if (with_normals) {
    for (auto* v : {&out.nx, &out.ny, &out.nz}) v->resize(bound);
    out.rgba.resize(bound);
  }
  if (with_sensor) out.sensor.resize(bound);
  if (with_flags) out.flags.resize(bound);
  std::vector<PointRecord> buffer;
  std::vector<std::uint32_t> codes(std::min<std::size_t>(bound, kChunkPoints));
  std::size_t n = 0;
  std::uint32_t any_colour = 0;
  Int3 base{};
  Int3 low{};
  Int3 high{};
  for (std::size_t a = 0; a < 3; ++a) {
    base[a] = origin_cells[a] * kQuantaPerCell;
    low[a] = box.min[a] * kQuantaPerCell;
    high[a] = box.max[a] * kQuantaPerCell;
  }
  constexpr float kToCells = 1.0f / kQuantaPerCell;
  for (const Segment& s : segments) {
    impl_->stream(*s.brick, s.first, s.count, buffer, [&](const PointRecord* p, std::size_t count) {
      const std::size_t start = n;
      for (std::size_t i = 0; i < count; ++i) {  // every record is stored, n moves on for those that stay
        const Int3& q = p[i].q;
        out.x[n] = static_cast<float>(q[0] - base[0]) * kToCells;
        out.y[n] = static_cast<float>(q[1] - base[1]) * kToCells;
        out.z[n] = static_cast<float>(q[2] - base[2]) * kToCells;
        if (with_normals) {
          out.rgba[n] = p[i].rgba;
          codes[n - start] = p[i].normal;
        }
        if (with_sensor) out.sensor[n] = p[i].sensor;
        if (with_flags) out.flags[n] = p[i].flags;
        const bool in_box = s.inside || (q[0] >= low[0] && q[0] < high[0] && q[1] >= low[1] &&
                                         q[1] < high[1] && q[2] >= low[2] && q[2] < high[2]);
        const bool stays = in_box && !(p[i].flags & kPointOutlier);
        any_colour |= stays ? p[i].rgba : 0;
        n += stays ? 1 : 0;
      }
      if (with_normals)
        decode_normals(codes.data(), n - start, out.nx.data() + start, out.ny.data() + start,
                       out.nz.data() + start);
    });
  }
  for (auto* v : {&out.x, &out.y, &out.z}) v->resize(n);
  if (with_normals)
    for (auto* v : {&out.nx, &out.ny, &out.nz}) v->resize(n);
  out.rgba.resize(with_normals && any_colour ? n : 0);
  if (with_sensor) out.sensor.resize(n);
  if (with_flags) out.flags.resize(n);
  return out;
}

std::vector<PointRecord> PointStore::records(std::size_t brick) const {
  const BrickEntry& entry = impl_->bricks[brick];
  std::vector<PointRecord> out;
  out.reserve(entry.points);
  std::vector<PointRecord> buffer;
  impl_->stream(entry, 0, entry.points, buffer,
                [&](const PointRecord* p, std::size_t count) { out.insert(out.end(), p, p + count); });
  return out;
}

PointRecord PointStore::record(std::size_t brick, std::uint64_t index) const {
  PointRecord out;
  std::vector<PointRecord> buffer;
  impl_->stream(impl_->bricks[brick], index, 1, buffer, [&](const PointRecord* p, std::size_t) { out = *p; });
  return out;
}

bool PointStore::has_bodies() const {
  return impl_->overlay && impl_->overlay->volumetric() == VolumetricUse::kBodies;
}

void PointStore::prefetch(const Int3& origin_cells, const Int3& cells, int halo_cells) const {
  for_bricks(impl_->bricks, cell_box_of(origin_cells, cells, halo_cells),
             [&](const BrickEntry& brick, const Int3&, bool) {
               const PackedFile& file = impl_->bricks.file_of(brick);
               file.will_need(brick.records());
               file.will_need(brick.block_table());
               if (impl_->overlay) impl_->overlay->prefetch(brick.key);
             });
}

std::uint64_t PointStore::count_bound(const Int3& origin_cells, const Int3& cells, int halo_cells) const {
  const CellBox box = cell_box_of(origin_cells, cells, halo_cells);
  std::uint64_t bound = 0;
  std::vector<Segment> segments;
  for_bricks(impl_->bricks, box, [&](const BrickEntry& brick, const Int3& at, bool whole) {
    if (whole) {
      bound += brick.points;
      return;
    }
    segments.clear();
    partial_segments(brick, impl_->blocks_of(brick), at, box, segments);
    for (const Segment& s : segments) bound += s.count;
  });
  return bound;
}

}  // namespace tessera
