#include "stream/points/point_store.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <string>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"
#include "stream/points/point_overlay.h"

namespace tessera {
namespace {

constexpr std::uint64_t kHeadMagic = 0x3130544e504c5354ULL;  // "TSLPNT01", little endian
constexpr std::uint64_t kFootMagic = 0x3130444e454c5354ULL;  // "TSLEND01"
constexpr int kBrickQuantumBits = kBrickBits + kQuantumBits;
constexpr int kBlockQuantumBits = kLeafBits + kQuantumBits;
constexpr int kBlocksPerAxis = kBrickCells / kLeafCells;
// A chunk of records fits the second-level cache together with what is made of it.
constexpr std::uint64_t kChunkPoints = 12288;
// Reading over a gap of this many points is cheaper than a second request.
constexpr std::uint64_t kGapPoints = 512;

struct FileHeader {
  std::uint64_t magic = kHeadMagic;
  std::uint64_t record_bytes = sizeof(PointRecord);
  std::uint64_t reserved[6] = {};
};
struct FileFooter {
  std::uint64_t bricks = 0;
  std::uint64_t points = 0;
  std::uint64_t table_offset = 0;    ///< of the brick table
  std::uint64_t table_checksum = 0;  ///< XXH3 of the brick table
  std::uint64_t reserved[2] = {};
  std::uint64_t checksum = 0;  ///< XXH3 of the fields above
  std::uint64_t magic = kFootMagic;
};
struct DiskBlock {
  std::uint32_t code = 0;   ///< 9-bit Morton code of the 8^3-cell block in its brick
  std::uint32_t first = 0;  ///< index of its first point in the brick
};
struct DiskBrick {
  std::uint64_t key, points, first, table;
  std::uint64_t blocks;
  std::uint64_t points_checksum, blocks_checksum;
};
static_assert(sizeof(FileHeader) == 64 && sizeof(FileFooter) == 64 && sizeof(DiskBlock) == 8 &&
              sizeof(DiskBrick) == 56);

std::uint64_t hash_of(const void* data, std::size_t bytes) {
  return XXH3_64bits(data, bytes);
}

std::uint32_t block_code(const Int3& q) {
  constexpr std::uint32_t kSpread[kBlocksPerAxis] = {0, 1, 8, 9, 64, 65, 72, 73};
  const auto at = [&](std::size_t axis) {
    return kSpread[static_cast<std::uint32_t>(q[axis]) >> kBlockQuantumBits & (kBlocksPerAxis - 1)];
  };
  return at(0) | at(1) << 1 | at(2) << 2;
}

struct XxhState {
  XXH3_state_t* state = XXH3_createState();
  XxhState() { XXH3_64bits_reset(state); }
  ~XxhState() { XXH3_freeState(state); }
  XxhState(const XxhState&) = delete;
  XxhState& operator=(const XxhState&) = delete;
};

}  // namespace

struct PointFileWriter::Impl {
  Impl(const std::filesystem::path& path, std::size_t buffer_bytes) : file(path, buffer_bytes) {
    const FileHeader header;
    file.write(&header, sizeof header);
  }
  DirectFile file;
  std::vector<DiskBlock> blocks;
  std::vector<DiskBrick> bricks;
  std::uint64_t points = 0;
};

PointFileWriter::PointFileWriter(const std::filesystem::path& path, std::size_t buffer_bytes)
    : impl_(std::make_unique<Impl>(path, buffer_bytes)) {}
PointFileWriter::~PointFileWriter() = default;

void PointFileWriter::expect(std::uint64_t bricks, std::uint64_t points) {
  constexpr std::uint64_t kMostBlocks = kBlocksPerAxis * kBlocksPerAxis * kBlocksPerAxis;
  impl_->bricks.reserve(bricks);
  impl_->blocks.reserve(std::min(points, bricks * kMostBlocks));
}

void PointFileWriter::brick(std::uint64_t key, std::span<const PointRecord> points) {
  assert(!points.empty() && (impl_->bricks.empty() || impl_->bricks.back().key < key));
  const std::size_t first_block = impl_->blocks.size();
  std::uint32_t last = ~0u;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::uint32_t code = block_code(points[i].q);
    if (code == last) continue;
    assert(last == ~0u || code > last);
    impl_->blocks.push_back({code, static_cast<std::uint32_t>(i)});
    last = code;
  }
  const std::size_t blocks = impl_->blocks.size() - first_block;
  impl_->bricks.push_back({key, points.size(), impl_->points, first_block * sizeof(DiskBlock), blocks,
                           hash_of(points.data(), points.size_bytes()),
                           hash_of(impl_->blocks.data() + first_block, blocks * sizeof(DiskBlock))});
  impl_->points += points.size();
  impl_->file.write(points.data(), points.size_bytes());
}

std::uint64_t PointFileWriter::finish() {
  const std::uint64_t blocks_offset = impl_->file.offset();
  for (DiskBrick& b : impl_->bricks) b.table += blocks_offset;
  impl_->file.write(impl_->blocks.data(), impl_->blocks.size() * sizeof(DiskBlock));
  FileFooter footer;
  footer.bricks = impl_->bricks.size();
  footer.points = impl_->points;
  footer.table_offset = impl_->file.offset();
  footer.table_checksum = hash_of(impl_->bricks.data(), impl_->bricks.size() * sizeof(DiskBrick));
  footer.checksum = hash_of(&footer, offsetof(FileFooter, checksum));
  impl_->file.write(impl_->bricks.data(), impl_->bricks.size() * sizeof(DiskBrick));
  impl_->file.write(&footer, sizeof footer);
  return impl_->file.finish();
}

struct PointStore::Impl {
  struct Checks {
    std::uint64_t points = 0, blocks = 0;
  };
  std::vector<ReadFile> files;
  std::vector<BrickEntry> bricks;
  std::vector<Checks> checks;  ///< parallel to bricks
  std::uint64_t points = 0;
  std::shared_ptr<const PointOverlay> overlay;

  void open(const std::filesystem::path& path);
  [[noreturn]] void damaged(const BrickEntry& brick, const char* what) const;
  std::vector<DiskBlock> blocks_of(const BrickEntry& brick) const;
  const BrickEntry* find(std::uint64_t key) const {
    const auto at = std::lower_bound(bricks.begin(), bricks.end(), key,
                                     [](const BrickEntry& b, std::uint64_t k) { return b.key < k; });
    return at != bricks.end() && at->key == key ? &*at : nullptr;
  }
  /// Calls use(records, count) for points [first, first + count) of a brick, in order, in chunks, as the overlay
  /// has them.
  template <typename Use>
  void stream(const BrickEntry& brick, std::uint64_t first, std::uint64_t count,
              std::vector<PointRecord>& buffer, const Use& use) const;
};

namespace {

[[noreturn]] void damaged_file(const std::filesystem::path& path, const std::string& what) {
  throw InputError(path.string() + ": " + what + "; the work directory is damaged, run again with --force");
}

}  // namespace

void PointStore::Impl::open(const std::filesystem::path& path) {
  ReadFile file(path);
  FileHeader header;
  FileFooter footer;
  if (file.size() < sizeof header + sizeof footer) damaged_file(path, "too short for a point file");
  file.read_at(0, &header, sizeof header);
  file.read_at(file.size() - sizeof footer, &footer, sizeof footer);
  if (header.magic != kHeadMagic || header.record_bytes != sizeof(PointRecord))
    damaged_file(path, "not a point file of this version");
  if (footer.magic != kFootMagic || footer.checksum != hash_of(&footer, offsetof(FileFooter, checksum)) ||
      footer.bricks > file.size() / sizeof(DiskBrick) ||
      footer.table_offset + footer.bricks * sizeof(DiskBrick) + sizeof footer != file.size())
    damaged_file(path, "byte " + std::to_string(file.size() - sizeof footer) + ": damaged footer");
  std::vector<DiskBrick> table(footer.bricks);
  file.read_at(footer.table_offset, table.data(), table.size() * sizeof(DiskBrick));
  if (hash_of(table.data(), table.size() * sizeof(DiskBrick)) != footer.table_checksum)
    damaged_file(path, "byte " + std::to_string(footer.table_offset) + ": damaged brick table (checksum)");
  for (const DiskBrick& d : table) {
    if (!bricks.empty() && bricks.back().key >= d.key)
      damaged_file(path, "bricks out of order (is it the file of another job?)");
    bricks.push_back({d.key, d.points, static_cast<std::uint32_t>(files.size()),
                      static_cast<std::uint32_t>(d.blocks), d.first, d.table});
    checks.push_back({d.points_checksum, d.blocks_checksum});
  }
  points += footer.points;
  files.push_back(std::move(file));
}

void PointStore::Impl::damaged(const BrickEntry& brick, const char* what) const {
  damaged_file(files[brick.file].path(),
               std::string("brick ") + std::to_string(brick.key) + " at byte " +
                   std::to_string(sizeof(FileHeader) + brick.first * sizeof(PointRecord)) + ": " + what +
                   " (checksum)");
}

std::vector<DiskBlock> PointStore::Impl::blocks_of(const BrickEntry& brick) const {
  std::vector<DiskBlock> blocks(brick.blocks);
  files[brick.file].read_at(brick.table, blocks.data(), blocks.size() * sizeof(DiskBlock));
  const auto at = static_cast<std::size_t>(&brick - bricks.data());
  if (hash_of(blocks.data(), blocks.size() * sizeof(DiskBlock)) != checks[at].blocks)
    damaged(brick, "damaged block table");
  return blocks;
}

template <typename Use>
void PointStore::Impl::stream(const BrickEntry& brick, std::uint64_t first, std::uint64_t count,
                              std::vector<PointRecord>& buffer, const Use& use) const {
  const ReadFile& file = files[brick.file];
  const bool whole = count == brick.points;
  const XxhState hash;
  buffer.resize(std::max<std::size_t>(buffer.size(), std::min(count, kChunkPoints)));
  for (std::uint64_t done = 0; done < count;) {
    const std::uint64_t part = std::min(count - done, kChunkPoints);
    file.read_at(sizeof(FileHeader) + (brick.first + first + done) * sizeof(PointRecord), buffer.data(),
                 part * sizeof(PointRecord));
    if (whole) XXH3_64bits_update(hash.state, buffer.data(), part * sizeof(PointRecord));
    if (overlay) overlay->apply(brick.key, first + done, {buffer.data(), static_cast<std::size_t>(part)});
    use(buffer.data(), static_cast<std::size_t>(part));
    done += part;
  }
  const auto at = static_cast<std::size_t>(&brick - bricks.data());
  if (whole && XXH3_64bits_digest(hash.state) != checks[at].points) damaged(brick, "damaged points");
}

PointStore::PointStore(const std::vector<std::filesystem::path>& files,
                       std::shared_ptr<const PointOverlay> overlay)
    : impl_(std::make_unique<Impl>()) {
  impl_->overlay = std::move(overlay);
  impl_->files.reserve(files.size());
  for (const auto& path : files) impl_->open(path);
}
PointStore::~PointStore() = default;

std::span<const BrickEntry> PointStore::bricks() const {
  return impl_->bricks;
}
const BrickEntry* PointStore::find(std::uint64_t key) const {
  return impl_->find(key);
}
std::uint64_t PointStore::point_count() const {
  return impl_->points;
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

CellBox box_of(const Int3& origin, const Int3& cells, int halo) {
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
                            bool with_sensor) const {
  const CellBox box = box_of(origin_cells, cells, halo_cells);
  std::vector<Segment> segments;
  for_bricks(*impl_, box, [&](const BrickEntry& brick, const Int3& at, bool whole) {
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
  for (auto* v : {&out.x, &out.y, &out.z, &out.nx, &out.ny, &out.nz}) v->resize(bound);
  out.rgba.resize(bound);
  if (with_sensor) out.sensor.resize(bound);
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
        out.rgba[n] = p[i].rgba;
        codes[n - start] = p[i].normal;
        if (with_sensor) out.sensor[n] = p[i].sensor;
        const bool in_box = s.inside || (q[0] >= low[0] && q[0] < high[0] && q[1] >= low[1] &&
                                         q[1] < high[1] && q[2] >= low[2] && q[2] < high[2]);
        const bool stays = in_box && !(p[i].flags & kPointOutlier);
        any_colour |= stays ? p[i].rgba : 0;
        n += stays ? 1 : 0;
      }
      decode_normals(codes.data(), n - start, out.nx.data() + start, out.ny.data() + start,
                     out.nz.data() + start);
    });
  }
  for (auto* v : {&out.x, &out.y, &out.z, &out.nx, &out.ny, &out.nz}) v->resize(n);
  out.rgba.resize(any_colour ? n : 0);
  if (with_sensor) out.sensor.resize(n);
  return out;
}

void PointStore::prefetch(const Int3& origin_cells, const Int3& cells, int halo_cells) const {
  for_bricks(*impl_, box_of(origin_cells, cells, halo_cells),
             [&](const BrickEntry& brick, const Int3&, bool) {
               const ReadFile& file = impl_->files[brick.file];
               file.will_need(sizeof(FileHeader) + brick.first * sizeof(PointRecord),
                              brick.points * sizeof(PointRecord));
               file.will_need(brick.table, brick.blocks * sizeof(DiskBlock));
               if (impl_->overlay) impl_->overlay->prefetch(brick.key);
             });
}

std::vector<PointRecord> PointStore::load_brick(const BrickEntry& brick) const {
  const BrickEntry* own = impl_->find(brick.key);  // the argument may be a copy
  assert(own);
  std::vector<PointRecord> records;
  std::vector<PointRecord> buffer;
  records.reserve(own->points);
  impl_->stream(*own, 0, own->points, buffer, [&](const PointRecord* p, std::size_t count) {
    records.insert(records.end(), p, p + count);
  });
  return records;
}

std::uint64_t PointStore::count_bound(const Int3& origin_cells, const Int3& cells, int halo_cells) const {
  const CellBox box = box_of(origin_cells, cells, halo_cells);
  std::uint64_t bound = 0;
  std::vector<Segment> segments;
  for_bricks(*impl_, box, [&](const BrickEntry& brick, const Int3& at, bool whole) {
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
