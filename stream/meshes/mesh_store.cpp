#include "stream/meshes/mesh_store.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <string>

#include "kernels/mesh/box_mask.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/packed_file.h"
#include "stream/meshes/patch_coding.h"

namespace tessera {
namespace {

constexpr PackedKind kStoreKind = {"TSMESH03", "a mesh file"};
constexpr std::uint32_t kShortIndices = 65536;  ///< up to so many vertices faces have 16-bit corners

/// MeshStoreInfo without padding.
struct DiskInfo {
  double h = 0.0;
  std::array<std::int64_t, 3> origin_brick{};
  Double3 shift{};
  std::uint32_t double_positions = 0;
  std::uint32_t colour = 0;
};
static_assert(sizeof(DiskInfo) == 64);
static_assert(sizeof(MeshPatchEntry) == 104);

MeshBox empty_box() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
}
void include(MeshBox& box, const Double3& p) {
  for (std::size_t a = 0; a < 3; ++a) {
    box.low[a] = std::min(box.low[a], p[a]);
    box.high[a] = std::max(box.high[a], p[a]);
  }
}
void include(MeshBox& box, const MeshBox& other) {
  include(box, other.low);
  include(box, other.high);
}

/// Per face: 1 where its box meets this one. A box lies apart from another when all corners are beyond one side.
std::vector<std::uint8_t> faces_that_meet(const MeshBlock& block, const MeshBox& box) {
  const std::vector<std::uint8_t> beyond = beyond_sides(block.position, box.low, box.high);
  std::vector<std::uint8_t> meets(block.faces.size());
  for (std::size_t f = 0; f < meets.size(); ++f) {
    const auto& c = block.faces[f];
    meets[f] = (beyond[c[0]] & beyond[c[1]] & beyond[c[2]]) == 0;
  }
  return meets;
}

struct StoreLayout {
  std::uint64_t key, position, rgba, vertex_class, corners, flags, bound;
  StoreLayout(const MeshStoreInfo& info, std::uint64_t vertices, std::uint64_t faces, bool bounds)
      : key(8 * vertices),
        position((info.double_positions ? 24 : 12) * vertices),
        rgba(info.colour ? 4 * vertices : 0),
        vertex_class((vertices + 3) / 4 * 4),
        corners((vertices <= kShortIndices ? 6 : 12) * faces),
        flags((faces + 3) / 4 * 4),
        bound(bounds ? 4 * faces : 0) {}
  std::uint64_t vertices() const { return key + position + rgba + vertex_class; }
  std::uint64_t faces() const { return corners + flags + bound; }
};

template <class T>
void put(char*& to, const T* values, std::size_t count, std::uint64_t bytes) {
  if (count > 0) std::memcpy(to, values, count * sizeof(T));
  std::memset(to + count * sizeof(T), 0, bytes - count * sizeof(T));
  to += bytes;
}
template <class T>
void take(const char*& from, std::vector<T>& values, std::size_t count, std::uint64_t bytes) {
  values.resize(count);
  if (count > 0) std::memcpy(values.data(), from, count * sizeof(T));
  from += bytes;
}

}  // namespace

bool overlap(const MeshBox& a, const MeshBox& b) {
  for (std::size_t i = 0; i < 3; ++i)
    if (a.low[i] > b.high[i] || b.low[i] > a.high[i]) return false;
  return true;
}

MeshBox grown(const MeshBox& box, double margin) {
  MeshBox out = box;
  for (std::size_t a = 0; a < 3; ++a) {
    out.low[a] -= margin;
    out.high[a] += margin;
  }
  return out;
}

struct MeshFileWriter::Impl {
  PackedWriter file;
  MeshStoreInfo info;
  std::vector<MeshPatchEntry> table;
  std::vector<char> buffer;

  /// Writes the buffer. \pre e.vertex_bytes is set
  void add_section(MeshPatchEntry& e) {
    const auto all = bytes_of(buffer);
    const Section vertices = file.append(all.first(e.vertex_bytes));
    const Section faces = file.append(all.subspan(e.vertex_bytes));
    e.offset = vertices.offset;
    e.vertex_hash = vertices.hash;
    e.face_hash = faces.hash;
    e.face_bytes = static_cast<std::uint32_t>(faces.bytes);
    table.push_back(e);
  }
};

MeshFileWriter::MeshFileWriter(const std::filesystem::path& path, const MeshStoreInfo& info)
    : impl_(new Impl{{path, kStoreKind}, info, {}, {}}) {}
MeshFileWriter::~MeshFileWriter() = default;

void MeshFileWriter::add(std::uint64_t brick, const MeshBlock& patch, unsigned content) {
  if (patch.faces.empty()) return;
  Impl& self = *impl_;
  const std::size_t n = patch.key.size();
  const std::size_t m = patch.faces.size();
  const StoreLayout layout(self.info, n, m, !patch.face_bound.empty());
  MeshPatchEntry e;
  e.key = brick;
  e.vertices = static_cast<std::uint32_t>(n);
  e.faces = static_cast<std::uint32_t>(m);
  e.content = content | (patch.face_bound.empty() ? 0u : unsigned{kPatchBounds});
  for (const std::uint8_t flags : patch.face_flags)
    if (flags & kFaceSynthetic) e.content |= kPatchSynthetic;
  if (content & kPatchCompact) {
    e.box = empty_box();
    for (const Double3& p : patch.position) include(e.box, p);
    self.buffer.clear();
    encode_vertices(patch, self.info, self.buffer);
    e.vertex_bytes = static_cast<std::uint32_t>(self.buffer.size());
    encode_faces(patch, self.buffer);
    self.add_section(e);
    return;
  }
  e.vertex_bytes = static_cast<std::uint32_t>(layout.vertices());
  self.buffer.resize(layout.vertices() + layout.faces());
  char* to = self.buffer.data();
  put(to, patch.key.data(), n, layout.key);
  to = put_positions(patch.position, e, to);
  if (self.info.colour) put(to, patch.rgba.data(), patch.rgba.size(), layout.rgba);
  put(to, patch.vertex_class.data(), n, layout.vertex_class);
  if (n <= kShortIndices) {
    for (const auto& f : patch.faces) {
      const std::array<std::uint16_t, 3> corners = {static_cast<std::uint16_t>(f[0]),
                                                    static_cast<std::uint16_t>(f[1]),
                                                    static_cast<std::uint16_t>(f[2])};
      std::memcpy(to, &corners, sizeof corners);
      to += sizeof corners;
    }
  } else {
    put(to, patch.faces.data(), m, layout.corners);
  }
  put(to, patch.face_flags.data(), m, layout.flags);
  put(to, patch.face_bound.data(), patch.face_bound.size(), layout.bound);
  self.add_section(e);
}

void MeshFileWriter::remove(std::uint64_t brick) {
  MeshPatchEntry e;
  e.key = brick;
  e.box = empty_box();
  impl_->table.push_back(e);
}

/// With their box.
char* MeshFileWriter::put_positions(std::span<const Double3> positions, MeshPatchEntry& entry,
                                    char* to) const {
  entry.box = empty_box();
  for (const Double3& p : positions) include(entry.box, p);
  if (impl_->info.double_positions) {
    put(to, positions.data(), positions.size(), positions.size() * sizeof(Double3));
    return to;
  }
  for (const Double3& p : positions) {
    const Float3 f = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    std::memcpy(to, &f, sizeof f);
    to += sizeof f;
  }
  return to;
}

std::uint64_t MeshFileWriter::finish() {
  const MeshStoreInfo& i = impl_->info;
  const DiskInfo info = {i.lattice.h, i.lattice.origin_brick, i.shift, i.double_positions, i.colour};
  return impl_->file.finish(impl_->table, std::as_bytes(std::span(&info, 1)));
}

struct MeshStore::Impl {
  std::vector<PackedFile> files;
  MeshStoreInfo info;
  std::vector<MeshPatchEntry> patches;
  std::uint64_t faces = 0;
  bool synthetic = false;
  MeshBox box = empty_box();

  StoreLayout layout(const MeshPatchEntry& e) const {
    return {info, e.vertices, e.faces, (e.content & kPatchBounds) != 0};
  }

  std::size_t section_bytes(std::size_t patch) const {
    return std::size_t{patches[patch].vertex_bytes} + patches[patch].face_bytes;
  }
  /// Both sections, checked. \param data  section_bytes()
  void read_sections(std::size_t patch, char* data) const {
    const MeshPatchEntry& e = patches[patch];
    const auto all = std::as_writable_bytes(std::span(data, section_bytes(patch)));
    files[e.file].read({e.offset, e.vertex_bytes, e.vertex_hash}, {all.first(e.vertex_bytes)});
    files[e.file].read({e.offset + e.vertex_bytes, e.face_bytes, e.face_hash}, {all.subspan(e.vertex_bytes)});
  }

  MeshBlock read(std::size_t patch) const {
    const MeshPatchEntry& e = patches[patch];
    const StoreLayout layout = this->layout(e);
    const auto data = std::make_unique_for_overwrite<char[]>(section_bytes(patch));
    read_sections(patch, data.get());
    if (e.content & kPatchCompact) {
      MeshBlock block;
      const std::span<const char> all(data.get(), section_bytes(patch));
      if (!decode_vertices(all.first(e.vertex_bytes), e.vertices, info, block) ||
          !decode_faces(all.subspan(e.vertex_bytes), e.faces, (e.content & kPatchBounds) != 0, block))
        files[e.file].damaged(e.offset, "a compact patch does not decode");
      return block;
    }
    if (layout.vertices() != e.vertex_bytes || layout.faces() != e.face_bytes)
      files[e.file].damaged(e.offset, "a mesh patch has another size than it must");
    const char* from = data.get();
    const std::size_t n = e.vertices;
    const std::size_t m = e.faces;
    MeshBlock block;
    take(from, block.key, n, layout.key);
    if (info.double_positions) {
      take(from, block.position, n, layout.position);
    } else {
      block.position.resize(n);
      for (Double3& p : block.position) {
        Float3 f;
        std::memcpy(&f, from, sizeof f);
        from += sizeof f;
        p = {f[0], f[1], f[2]};
      }
    }
    if (info.colour) take(from, block.rgba, n, layout.rgba);
    take(from, block.vertex_class, n, layout.vertex_class);
    block.faces.resize(m);
    if (n <= kShortIndices) {
      for (auto& f : block.faces) {
        std::array<std::uint16_t, 3> corners;
        std::memcpy(&corners, from, sizeof corners);
        from += sizeof corners;
        f = {corners[0], corners[1], corners[2]};
      }
    } else {
      take(from, block.faces, m, layout.corners);
    }
    take(from, block.face_flags, m, layout.flags);
    if (e.content & kPatchBounds) take(from, block.face_bound, m, layout.bound);
    return block;
  }

  /// Patches `core` (all faces) and `halo` (those faces that meet the box). `near`: with what load_near() promises.
  MeshBlock merge(std::span<const std::size_t> core, std::span<const std::size_t> halo, const MeshBox& region,
                  std::vector<std::uint8_t>* tag, MeshHaloBlock* near = nullptr) const {
    std::vector<MeshBlock> pieces;
    std::vector<std::uint8_t> tags;
    std::vector<std::uint32_t> patch_of_piece;
    pieces.reserve(core.size() + halo.size());
    for (const std::size_t p : core) {
      pieces.push_back(read(p));
      tags.push_back(1);
      patch_of_piece.push_back(static_cast<std::uint32_t>(p));
    }
    for (const std::size_t p : halo) {
      MeshBlock piece = read(p);
      const std::vector<std::uint8_t> keep = faces_that_meet(piece, region);
      const auto kept = static_cast<std::size_t>(std::count(keep.begin(), keep.end(), std::uint8_t{1}));
      if (kept == 0) continue;
      pieces.push_back(kept == keep.size() ? std::move(piece) : select_faces(piece, keep));
      tags.push_back(0);
      patch_of_piece.push_back(static_cast<std::uint32_t>(p));
    }
    std::vector<const MeshBlock*> pointers;
    for (const MeshBlock& piece : pieces) pointers.push_back(&piece);
    std::vector<std::uint32_t> slot;
    MeshBlock block;
    if (pieces.size() == 1) {
      if (tag) tag->assign(pieces[0].faces.size(), tags[0]);
      block = std::move(pieces[0]);
      slot.resize(block.key.size());
      std::iota(slot.begin(), slot.end(), std::uint32_t{0});
    } else {
      block = merge_blocks(pointers, tags, tag, near ? &slot : nullptr);
    }
    if (!near) return block;
    near->first_patch.assign(block.key.size(), ~std::uint32_t{0});
    near->core_vertices.clear();
    auto at = slot.begin();
    for (std::size_t k = 0; k < pieces.size(); ++k) {
      const std::size_t count = pieces.size() == 1 ? block.key.size() : pieces[k].key.size();
      const auto end = at + static_cast<std::ptrdiff_t>(count);
      if (k < core.size()) near->core_vertices.emplace_back(at, end);
      for (; at != end; ++at) near->first_patch[*at] = std::min(near->first_patch[*at], patch_of_piece[k]);
    }
    return block;
  }
};

void MeshFileWriter::add_moved(const MeshStore& store, std::size_t patch,
                               std::span<const Double3> positions) {
  Impl& self = *impl_;
  const MeshStore::Impl& from = *store.impl_;
  MeshPatchEntry e = from.patches[patch];
  const StoreLayout layout = from.layout(e);
  self.buffer.resize(from.section_bytes(patch));
  from.read_sections(patch, self.buffer.data());
  put_positions(positions, e, self.buffer.data() + layout.key);
  e.file = 0;
  self.add_section(e);
}

MeshStore::MeshStore(const std::vector<std::filesystem::path>& files,
                     const std::vector<std::filesystem::path>& newer)
    : impl_(std::make_unique<Impl>()) {
  std::vector<std::filesystem::path> paths = files;
  paths.insert(paths.end(), newer.begin(), newer.end());
  // Newer files of one folder are one pass's; a pass stands in for those before it.
  std::vector<std::uint32_t> pass(paths.size(), 0);
  for (std::size_t f = files.size(); f < paths.size(); ++f)
    pass[f] = pass[f - (f > 0)] +
              (f == files.size() || paths[f].parent_path() != paths[f - 1].parent_path() ? 1u : 0u);
  for (const auto& path : paths) {
    const PackedFile& file =
        impl_->files.emplace_back(path, kStoreKind, sizeof(MeshPatchEntry), sizeof(DiskInfo));
    DiskInfo disk;
    std::memcpy(&disk, file.info().data(), sizeof disk);
    MeshStoreInfo info;
    info.lattice.h = disk.h;
    info.lattice.origin_brick = disk.origin_brick;
    info.shift = disk.shift;
    info.double_positions = disk.double_positions != 0;
    info.colour = disk.colour != 0;
    if (impl_->files.size() > 1 && !(info == impl_->info))
      throw InputError(path.string() +
                       ": belongs to another mesh than the files before it; run again with --force");
    impl_->info = info;
    const std::size_t first = impl_->patches.size();
    file.append_table(impl_->patches);
    for (std::size_t i = first; i < impl_->patches.size(); ++i)
      impl_->patches[i].file = static_cast<std::uint32_t>(impl_->files.size() - 1);
  }
  // Of one brick the newest comes first; older ones go.
  auto& table = impl_->patches;
  std::sort(table.begin(), table.end(), [](const MeshPatchEntry& a, const MeshPatchEntry& b) {
    return a.key != b.key ? a.key < b.key : a.file > b.file;
  });
  for (std::size_t i = 1; i < table.size(); ++i) {
    const bool replaced = pass[table[i - 1].file] > pass[table[i].file];
    if (table[i].key == table[i - 1].key && !replaced)
      throw InputError(impl_->files[table[i].file].path().string() + ": brick " +
                       std::to_string(table[i].key) +
                       " is in two files: files of different jobs were mixed; run again with --force");
  }
  table.erase(
      std::unique(table.begin(), table.end(), [](const auto& a, const auto& b) { return a.key == b.key; }),
      table.end());
  std::erase_if(table, [](const MeshPatchEntry& e) { return e.faces == 0; });
  for (const MeshPatchEntry& e : table) {
    impl_->faces += e.faces;
    impl_->synthetic |= (e.content & kPatchSynthetic) != 0;
    include(impl_->box, e.box);
  }
}
MeshStore::~MeshStore() = default;
MeshStore::MeshStore(MeshStore&&) noexcept = default;
MeshStore& MeshStore::operator=(MeshStore&&) noexcept = default;

const MeshStoreInfo& MeshStore::info() const {
  return impl_->info;
}
std::span<const MeshPatchEntry> MeshStore::patches() const {
  return impl_->patches;
}
std::uint64_t MeshStore::face_count() const {
  return impl_->faces;
}
bool MeshStore::has_synthetic() const {
  return impl_->synthetic;
}
const MeshBox& MeshStore::box() const {
  return impl_->box;
}

double MeshStore::diagonal() const {
  double sum = 0.0;
  for (std::size_t a = 0; a < 3 && !impl_->patches.empty(); ++a) {
    const double edge = impl_->box.high[a] - impl_->box.low[a];
    sum += edge * edge;
  }
  return std::sqrt(sum);
}

std::int64_t MeshStore::find(std::uint64_t key) const {
  const auto& p = impl_->patches;
  const auto it = std::lower_bound(p.begin(), p.end(), key,
                                   [](const MeshPatchEntry& e, std::uint64_t k) { return e.key < k; });
  return it == p.end() || it->key != key ? -1 : it - p.begin();
}

std::vector<std::size_t> MeshStore::select(const MeshBox& box) const {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < impl_->patches.size(); ++i)
    if (overlap(impl_->patches[i].box, box)) out.push_back(i);
  return out;
}

MeshBox MeshStore::box_of(std::span<const std::size_t> patches) const {
  MeshBox box = empty_box();
  for (const std::size_t p : patches) include(box, impl_->patches[p].box);
  return box;
}

MeshBlock MeshStore::load(std::span<const std::size_t> patches) const {
  return impl_->merge(patches, {}, empty_box(), nullptr);
}

MeshHaloBlock MeshStore::load_near(std::span<const std::size_t> core, double margin) const {
  const MeshBox near = grown(box_of(core), margin);
  std::vector<std::size_t> halo;
  const std::vector<std::size_t> all = select(near);
  std::set_difference(all.begin(), all.end(), core.begin(), core.end(), std::back_inserter(halo));
  MeshHaloBlock out;
  out.block = impl_->merge(core, halo, near, &out.core, &out);
  return out;
}

MeshBlock MeshStore::load_box(const MeshBox& box) const {
  return impl_->merge({}, select(box), box, nullptr);
}

std::uint64_t MeshStore::block_bytes(std::span<const std::size_t> patches) const {
  std::uint64_t bytes = 0;
  for (const std::size_t p : patches)
    bytes += block_bytes(impl_->patches[p].vertices, impl_->patches[p].faces);
  return bytes;
}

std::uint64_t MeshStore::largest_patch_bytes() const {
  std::uint64_t maximum = 0;
  for (const MeshPatchEntry& e : impl_->patches)
    maximum = std::max(maximum, block_bytes(e.vertices, e.faces));
  return maximum;
}

}  // namespace tessera
