#include "stream/meshes/patch_store.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <string_view>

#include <xxhash.h>

#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"

namespace tessera {
namespace {

constexpr char kMagic[8] = {'T', 'S', 'P', 'A', 'T', 'C', 'H', '1'};

struct Footer {
  std::uint64_t table_offset = 0;
  std::uint64_t patches = 0;
  std::uint64_t table_hash = 0;
  char magic[8] = {};
};

/// Sections of a patch in file order, as byte sizes.
struct Layout {
  std::uint64_t foreign, exported_key, exported_index, component_of, component_counts, position, rgba,
      vertex_class, faces, synthetic;
  explicit Layout(const PatchEntry& e)
      : foreign(8ull * e.foreign),
        exported_key(8ull * e.exported),
        exported_index(4ull * e.exported),
        component_of(e.components > 1 ? 4ull * (e.vertices + std::uint64_t{e.foreign}) : 0),
        component_counts(8ull * e.components),
        position(12ull * e.vertices),
        rgba(e.has_colour ? 4ull * e.vertices : 0),
        vertex_class((e.vertices + 3ull) / 4 * 4),
        faces(12ull * e.faces),
        synthetic(e.has_synthetic ? e.faces : 0) {}
  std::uint64_t seam() const {
    return foreign + exported_key + exported_index + component_of + component_counts;
  }
  std::uint64_t vertices() const { return position + rgba + vertex_class; }
};

template <class T>
void append(std::vector<char>& out, const std::vector<T>& values) {
  const auto* first = reinterpret_cast<const char*>(values.data());
  out.insert(out.end(), first, first + values.size() * sizeof(T));
}

template <class T>
void take(const char*& from, std::vector<T>& values, std::uint64_t bytes) {
  values.resize(bytes / sizeof(T));
  if (bytes != 0) std::memcpy(values.data(), from, bytes);
  from += bytes;
}

}  // namespace

struct PatchFileWriter::Impl {
  DirectFile file;
  std::uint64_t offset = 0;
  std::vector<PatchEntry> table;
  std::vector<char> buffer;

  explicit Impl(const std::filesystem::path& path) : file(path) {}

  void put(const void* data, std::size_t bytes) {
    file.write(data, bytes);
    offset += bytes;
  }
  /// Writes `buffer`, clears it, returns its checksum.
  std::uint64_t put_buffer() {
    const std::uint64_t hash = XXH3_64bits(buffer.data(), buffer.size());
    put(buffer.data(), buffer.size());
    buffer.clear();
    return hash;
  }
};

PatchFileWriter::PatchFileWriter(const std::filesystem::path& path) : impl_(std::make_unique<Impl>(path)) {
  impl_->put(kMagic, sizeof kMagic);
}
PatchFileWriter::~PatchFileWriter() = default;

void PatchFileWriter::add(const Patch& patch, const PatchComponents& components) {
  Impl& self = *impl_;
  PatchEntry e;
  e.key = brick_key(patch.brick);
  e.offset = self.offset;
  e.vertices = static_cast<std::uint32_t>(patch.position.size());
  e.faces = static_cast<std::uint32_t>(patch.faces.size());
  e.foreign = static_cast<std::uint32_t>(patch.foreign.size());
  e.exported = static_cast<std::uint32_t>(patch.exported.size());
  e.components = components.count;
  e.has_colour = patch.rgba.empty() ? 0 : 1;
  e.has_synthetic = patch.synthetic.empty() ? 0 : 1;

  append(self.buffer, patch.foreign);
  std::vector<VertexKey> keys;
  std::vector<std::uint32_t> indices;
  keys.reserve(patch.exported.size());
  indices.reserve(patch.exported.size());
  for (const auto& [key, index] : patch.exported) {
    keys.push_back(key);
    indices.push_back(index);
  }
  append(self.buffer, keys);
  append(self.buffer, indices);
  if (components.count > 1) append(self.buffer, components.of_vertex);
  append(self.buffer, components.vertices);
  append(self.buffer, components.faces);
  e.seam_hash = self.put_buffer();

  append(self.buffer, patch.position);
  append(self.buffer, patch.rgba);
  append(self.buffer, patch.vertex_class);
  self.buffer.resize((self.buffer.size() + 3) / 4 * 4);
  e.vertex_hash = self.put_buffer();

  append(self.buffer, patch.faces);
  append(self.buffer, patch.synthetic);
  e.face_hash = self.put_buffer();
  self.table.push_back(e);
}

std::uint64_t PatchFileWriter::finish() {
  Impl& self = *impl_;
  Footer footer;
  footer.table_offset = self.offset;
  footer.patches = self.table.size();
  append(self.buffer, self.table);
  footer.table_hash = self.put_buffer();
  std::copy(std::begin(kMagic), std::end(kMagic), footer.magic);
  self.put(&footer, sizeof footer);
  self.file.finish();
  return self.offset;
}

struct PatchStore::Impl {
  struct File {
    ReadFile file;
    std::size_t first = 0;
    std::size_t last = 0;
  };
  std::vector<File> files;
  std::vector<PatchEntry> patches;

  std::size_t file_of(std::size_t patch) const {
    const auto it = std::upper_bound(files.begin(), files.end(), patch,
                                     [](std::size_t p, const File& f) { return p < f.last; });
    return static_cast<std::size_t>(it - files.begin());
  }

  /// One checked section group of a patch.
  std::vector<char> read(std::size_t patch, std::uint64_t offset, std::uint64_t bytes,
                         std::uint64_t hash) const {
    const ReadFile& file = files[file_of(patch)].file;
    std::vector<char> data(bytes);
    file.read_at(offset, data.data(), bytes);
    if (XXH3_64bits(data.data(), bytes) != hash)
      throw InputError(file.path().string() + ": byte " + std::to_string(offset) +
                       ": checksum of a patch differs, the file is damaged; run again with --force");
    return data;
  }
};

PatchStore::PatchStore(const std::vector<std::filesystem::path>& paths) : impl_(std::make_unique<Impl>()) {
  for (const auto& path : paths) {
    ReadFile file(path);
    const auto damaged = [&](const char* what) {
      return InputError(path.string() + ": " + what + ", the file is damaged; run again with --force");
    };
    Footer footer;
    if (file.size() < sizeof footer + sizeof kMagic) throw damaged("too short for a patch file");
    file.read_at(file.size() - sizeof footer, &footer, sizeof footer);
    if (!std::equal(std::begin(kMagic), std::end(kMagic), footer.magic)) throw damaged("no patch footer");
    const std::uint64_t bytes = footer.patches * sizeof(PatchEntry);
    if (footer.patches > file.size() || footer.table_offset + bytes + sizeof footer != file.size())
      throw damaged("patch table does not fit");
    const std::size_t first = impl_->patches.size();
    impl_->patches.resize(first + footer.patches);
    PatchEntry* table = impl_->patches.data() + first;
    if (bytes != 0) file.read_at(footer.table_offset, table, bytes);
    if (XXH3_64bits(table, bytes) != footer.table_hash) throw damaged("checksum of the patch table differs");
    impl_->files.push_back({std::move(file), first, first + footer.patches});
  }
  const auto by_key = [](const PatchEntry& a, const PatchEntry& b) { return a.key < b.key; };
  if (!std::is_sorted(impl_->patches.begin(), impl_->patches.end(), by_key))
    throw InputError(
        "patch files are not in brick order: files of different jobs were mixed; run again with --force");
}
PatchStore::~PatchStore() = default;
PatchStore::PatchStore(PatchStore&&) noexcept = default;
PatchStore& PatchStore::operator=(PatchStore&&) noexcept = default;

std::span<const PatchEntry> PatchStore::patches() const {
  return impl_->patches;
}
std::size_t PatchStore::file_count() const {
  return impl_->files.size();
}
std::size_t PatchStore::file_of(std::size_t patch) const {
  return impl_->file_of(patch);
}
std::pair<std::size_t, std::size_t> PatchStore::file_range(std::size_t file) const {
  return {impl_->files[file].first, impl_->files[file].last};
}

std::int64_t PatchStore::find(std::uint64_t key) const {
  const auto& p = impl_->patches;
  const auto it = std::lower_bound(p.begin(), p.end(), key,
                                   [](const PatchEntry& e, std::uint64_t k) { return e.key < k; });
  return it == p.end() || it->key != key ? -1 : it - p.begin();
}

PatchSeam PatchStore::load_seam(std::size_t patch) const {
  const PatchEntry& e = impl_->patches[patch];
  const Layout layout(e);
  const std::vector<char> data = impl_->read(patch, e.offset, layout.seam(), e.seam_hash);
  const char* at = data.data();
  PatchSeam seam;
  take(at, seam.foreign, layout.foreign);
  take(at, seam.exported_key, layout.exported_key);
  take(at, seam.exported_index, layout.exported_index);
  seam.components.count = e.components;
  take(at, seam.components.of_vertex, layout.component_of);
  if (e.components == 1) seam.components.of_vertex.assign(e.vertices + std::size_t{e.foreign}, 0);
  take(at, seam.components.vertices, layout.component_counts / 2);
  take(at, seam.components.faces, layout.component_counts / 2);
  return seam;
}

void PatchStore::load_vertices(std::size_t patch, std::vector<Float3>& position,
                               std::vector<std::uint32_t>& rgba,
                               std::vector<VertexClass>* vertex_class) const {
  const PatchEntry& e = impl_->patches[patch];
  const Layout layout(e);
  const std::vector<char> data =
      impl_->read(patch, e.offset + layout.seam(), layout.vertices(), e.vertex_hash);
  const char* at = data.data();
  take(at, position, layout.position);
  take(at, rgba, layout.rgba);
  if (vertex_class) take(at, *vertex_class, e.vertices);
}

void PatchStore::load_faces(std::size_t patch, std::vector<PatchFace>& faces,
                            std::vector<std::uint8_t>* synthetic) const {
  const PatchEntry& e = impl_->patches[patch];
  const Layout layout(e);
  const std::vector<char> data = impl_->read(patch, e.offset + layout.seam() + layout.vertices(),
                                             layout.faces + layout.synthetic, e.face_hash);
  const char* at = data.data();
  take(at, faces, layout.faces);
  if (synthetic) take(at, *synthetic, layout.synthetic);
}

}  // namespace tessera
