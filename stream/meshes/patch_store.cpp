#include "stream/meshes/patch_store.h"

#include <array>

namespace tessera {
namespace {

constexpr PackedKind kKind = {"TSPATCH5", "a patch file"};

/// Arrays of a patch in file order, as byte sizes.
struct Layout {
  std::uint64_t foreign, exported_key, exported_index, component_of, component_counts, position, rgba,
      vertex_class, faces, synthetic;
  explicit Layout(const PatchEntry& e)
      : foreign(8ull * e.foreign),
        exported_key(8ull * e.exported),
        exported_index(4ull * e.exported),
        component_of(e.components > 1 ? 4ull * (e.vertices + std::uint64_t{e.foreign}) : 0),
        component_counts(16ull * e.components),
        position(12ull * e.vertices),
        rgba(e.has_colour ? 4ull * e.vertices : 0),
        vertex_class((e.vertices + 3ull) / 4 * 4),
        faces(12ull * e.faces),
        synthetic(e.has_synthetic ? e.faces : 0) {}
  Section seam(const PatchEntry& e) const {
    return {e.offset, foreign + exported_key + exported_index + component_of + component_counts, e.seam_hash};
  }
  Section vertices(const PatchEntry& e) const {
    const Section before = seam(e);
    return {before.offset + before.bytes, position + rgba + vertex_class, e.vertex_hash};
  }
  Section face_section(const PatchEntry& e) const {
    const Section before = vertices(e);
    return {before.offset + before.bytes, faces + synthetic, e.face_hash};
  }
  Section safe_section(const PatchEntry& e) const {
    const Section before = face_section(e);
    return {before.offset + before.bytes, sizeof(SafeVertex) * e.safe, e.safe_hash};
  }
};

template <class T>
std::span<std::byte> buffer(std::vector<T>& values, std::uint64_t bytes) {
  values.resize(bytes / sizeof(T));
  return buffer_of(values);
}

}  // namespace

PatchFileWriter::PatchFileWriter(const std::filesystem::path& path) : file_(path, kKind) {}

void PatchFileWriter::add(const Patch& patch, const PatchComponents& components) {
  PatchEntry e;
  e.key = brick_key(patch.brick);
  e.vertices = static_cast<std::uint32_t>(patch.position.size());
  e.faces = static_cast<std::uint32_t>(patch.faces.size());
  e.foreign = static_cast<std::uint32_t>(patch.foreign.size());
  e.exported = static_cast<std::uint32_t>(patch.exported.size());
  e.components = components.count;
  e.safe = static_cast<std::uint32_t>(patch.safe.size());
  e.has_colour = patch.rgba.empty() ? 0 : 1;
  e.has_synthetic = patch.synthetic.empty() ? 0 : 1;

  std::vector<VertexKey> keys;
  std::vector<std::uint32_t> indices;
  keys.reserve(patch.exported.size());
  indices.reserve(patch.exported.size());
  for (const auto& [key, index] : patch.exported) {
    keys.push_back(key);
    indices.push_back(index);
  }
  const auto of_vertex = components.count > 1 ? bytes_of(components.of_vertex) : std::span<const std::byte>();
  const Section seam = file_.append({bytes_of(patch.foreign), bytes_of(keys), bytes_of(indices), of_vertex,
                                     bytes_of(components.vertices), bytes_of(components.faces),
                                     bytes_of(components.border), bytes_of(components.folded)});
  constexpr std::array<std::byte, 3> kPadding{};
  const auto padding = std::span(kPadding).first((4 - patch.vertex_class.size() % 4) % 4);
  e.offset = seam.offset;
  e.seam_hash = seam.hash;
  e.vertex_hash = file_
                      .append({bytes_of(patch.position), bytes_of(patch.rgba), bytes_of(patch.vertex_class),
                               std::as_bytes(padding)})
                      .hash;
  e.face_hash = file_.append({bytes_of(patch.faces), bytes_of(patch.synthetic)}).hash;
  e.safe_hash = file_.append(bytes_of(patch.safe)).hash;
  table_.push_back(e);
}

PatchStore::PatchStore(const std::vector<std::filesystem::path>& paths) : patches_(paths, kKind) {}

PatchSeam PatchStore::load_seam(std::size_t patch) const {
  const PatchEntry& e = patches_[patch];
  const Layout layout(e);
  PatchSeam seam;
  PatchComponents& parts = seam.components;
  parts.count = e.components;
  patches_.file_of(patch).read(
      layout.seam(e),
      {buffer(seam.foreign, layout.foreign), buffer(seam.exported_key, layout.exported_key),
       buffer(seam.exported_index, layout.exported_index), buffer(parts.of_vertex, layout.component_of),
       buffer(parts.vertices, layout.component_counts / 4), buffer(parts.faces, layout.component_counts / 4),
       buffer(parts.border, layout.component_counts / 4), buffer(parts.folded, layout.component_counts / 4)});
  if (e.components == 1) parts.of_vertex.assign(e.vertices + std::size_t{e.foreign}, 0);
  return seam;
}

void PatchStore::load_vertices(std::size_t patch, std::vector<Float3>& position,
                               std::vector<std::uint32_t>& rgba,
                               std::vector<VertexClass>* vertex_class) const {
  const PatchEntry& e = patches_[patch];
  const Layout layout(e);
  std::vector<VertexClass> classes;
  patches_.file_of(patch).read(
      layout.vertices(e),
      {buffer(position, layout.position), buffer(rgba, layout.rgba), buffer(classes, layout.vertex_class)});
  if (!vertex_class) return;
  classes.resize(e.vertices);
  *vertex_class = std::move(classes);
}

void PatchStore::load_faces(std::size_t patch, std::vector<PatchFace>& faces,
                            std::vector<std::uint8_t>* synthetic) const {
  const PatchEntry& e = patches_[patch];
  const Layout layout(e);
  std::vector<std::uint8_t> flags;
  patches_.file_of(patch).read(layout.face_section(e),
                               {buffer(faces, layout.faces), buffer(flags, layout.synthetic)});
  if (synthetic) *synthetic = std::move(flags);
}

std::vector<SafeVertex> PatchStore::load_safe(std::size_t patch) const {
  const PatchEntry& e = patches_[patch];
  if (e.safe == 0) return {};
  return patches_.file_of(patch).load<SafeVertex>(Layout(e).safe_section(e));
}

}  // namespace tessera
