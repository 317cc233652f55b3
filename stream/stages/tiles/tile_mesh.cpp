// Sources: Khronos, glTF 2.0 and KHR_mesh_quantization; EXT_meshopt_compression (its codecs are meshoptimizer's).
#include "stream/stages/tiles/tile_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <meshoptimizer.h>

#include "stream/files/json.h"
#include "stream/formats/srgb.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNarrow = 65535;  ///< steps that 16 bits can tell

enum Component {
  kByte = 5120,
  kUnsignedByte = 5121,
  kUnsignedShort = 5123,
  kUnsignedInt = 5125,
  kFloat = 5126
};
enum Target { kArrayBuffer = 34962, kElementBuffer = 34963 };

/// The binary part of the file and the views into it.
class Binary {
 public:
  Binary() {
    static const bool once = [] {  // the versions that the extension asks for
      meshopt_encodeIndexVersion(1);
      meshopt_encodeVertexVersion(0);
      return true;
    }();
    (void)once;
  }
  /// \param stride  bytes an element, a multiple of 4
  std::size_t add_attribute(const void* elements, std::size_t count, std::size_t stride,
                            const char* filter = nullptr) {
    std::vector<unsigned char> packed(meshopt_encodeVertexBufferBound(count, stride));
    packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), elements, count, stride));
    Json extension = {{"mode", "ATTRIBUTES"}};
    if (filter != nullptr) extension["filter"] = filter;
    Json view = {{"byteStride", stride}, {"target", kArrayBuffer}};
    return add(packed, count, stride, std::move(view), std::move(extension));
  }

  std::size_t add_indices(const std::vector<std::uint32_t>& indices, std::size_t vertices,
                          std::size_t stride) {
    std::vector<unsigned char> packed(meshopt_encodeIndexBufferBound(indices.size(), vertices));
    packed.resize(meshopt_encodeIndexBuffer(packed.data(), packed.size(), indices.data(), indices.size()));
    return add(packed, indices.size(), stride, {{"target", kElementBuffer}}, {{"mode", "TRIANGLES"}});
  }

  /// As it is.
  std::size_t add_plain(const std::string& from) {
    views.push_back({{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", from.size()}});
    bytes.insert(bytes.end(), from.begin(), from.end());
    bytes.resize((bytes.size() + 3) / 4 * 4, 0);
    return views.size() - 1;
  }

  Json views = Json::array();
  std::vector<unsigned char> bytes;
  std::size_t unpacked_bytes = 0;

 private:
  std::size_t add(const std::vector<unsigned char>& packed, std::size_t count, std::size_t stride, Json view,
                  Json extension) {
    if (packed.empty()) throw std::logic_error("a stream of a tile does not fit what was reckoned for it");
    extension.update({{"buffer", 0},
                      {"byteOffset", bytes.size()},
                      {"byteLength", packed.size()},
                      {"byteStride", stride},
                      {"count", count}});
    view.update({{"buffer", 1},
                 {"byteOffset", unpacked_bytes},
                 {"byteLength", count * stride},
                 {"extensions", {{"EXT_meshopt_compression", std::move(extension)}}}});
    views.push_back(std::move(view));
    bytes.insert(bytes.end(), packed.begin(), packed.end());
    bytes.resize((bytes.size() + 3) / 4 * 4, 0);
    unpacked_bytes += (count * stride + 3) / 4 * 4;
    return views.size() - 1;
  }
};

void put_word(std::string& to, std::size_t value) {
  const auto word = static_cast<std::uint32_t>(value);
  to.append(reinterpret_cast<const char*>(&word), sizeof word);
}

/// The step along the axes of glTF: x, z, -y, counted from the corner of the tile.
std::array<std::uint32_t, 3> y_up(const TileMesh& tile, std::size_t v) {
  const auto& p = tile.position[v];
  const auto depth = static_cast<std::uint32_t>(tile.high[1] - tile.low[1]);
  return {p[0], p[2], depth - p[1]};
}

/// Gives faces that close holes vertices of their own, so that a mark of vertices tells faces.
void split_synthetic(const MeshBlock& block, TileMesh& tile) {
  if (std::none_of(block.face_flags.begin(), block.face_flags.end(),
                   [](std::uint8_t flags) { return (flags & kFaceSynthetic) != 0; }))
    return;
  constexpr std::uint32_t kNone = ~0u;
  const std::size_t n = tile.position.size();
  std::vector<std::uint8_t> of_data(n, 0);
  for (std::size_t f = 0; f < tile.faces.size(); ++f)
    if ((block.face_flags[f] & kFaceSynthetic) == 0)
      for (const std::uint32_t v : tile.faces[f]) of_data[v] = 1;
  tile.synthetic.assign(n, 0);
  std::vector<std::uint32_t> twin(n, kNone);
  for (std::size_t f = 0; f < tile.faces.size(); ++f) {
    if ((block.face_flags[f] & kFaceSynthetic) == 0) continue;
    for (std::uint32_t& v : tile.faces[f]) {
      if (of_data[v] == 0) {
        tile.synthetic[v] = 1;
        continue;
      }
      if (twin[v] == kNone) {
        twin[v] = static_cast<std::uint32_t>(tile.position.size());
        tile.position.push_back(tile.position[v]);
        if (!tile.rgba.empty()) tile.rgba.push_back(tile.rgba[v]);
        if (!tile.normal.empty()) tile.normal.push_back(tile.normal[v]);
        if (!tile.uv.empty()) tile.uv.push_back(tile.uv[v]);
        tile.synthetic.push_back(1);
      }
      v = twin[v];
    }
  }
}

/// A tile on its way into a file: its vertices in the order in which the faces first use them.
class GlbTile {
 public:
  explicit GlbTile(const TileMesh& tile) : tile_(tile), vertices_(tile.position.size()) {
    order();
    add_positions();
    if (!tile.normal.empty()) add_normals();
    if (!tile.uv.empty())
      add_picture();
    else if (!tile.rgba.empty())
      add_colours();
    if (!tile.synthetic.empty()) add_synthetic();
    if (!tile.faces.empty()) add_triangles();
  }

  std::string file() const {
    std::string text = dump_json(document());
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string file;
    put_word(file, 0x46546c67);
    put_word(file, 2);
    put_word(file, 28 + text.size() + binary_.bytes.size());
    put_word(file, text.size());
    put_word(file, 0x4e4f534a);
    file += text;
    put_word(file, binary_.bytes.size());
    put_word(file, 0x004e4942);
    file.append(reinterpret_cast<const char*>(binary_.bytes.data()), binary_.bytes.size());
    return file;
  }

 private:
  /// Triangles as the codec of indices packs them best.
  void order() {
    remap_.resize(vertices_);
    if (tile_.faces.empty()) return std::iota(remap_.begin(), remap_.end(), 0u);  // points, as they come
    std::vector<std::uint32_t> corners;
    corners.reserve(3 * tile_.faces.size());
    for (const auto& f : tile_.faces) corners.insert(corners.end(), f.begin(), f.end());
    indices_.resize(corners.size());
    meshopt_optimizeVertexCacheStrip(indices_.data(), corners.data(), corners.size(), vertices_);
    meshopt_optimizeVertexFetchRemap(remap_.data(), indices_.data(), indices_.size(), vertices_);
    for (std::uint32_t& v : indices_) v = remap_[v];
  }

  /// \param of  a vertex of the tile -> its element, a multiple of 4 bytes
  template <class Of>
  auto in_order(const Of& of) const {
    std::vector<decltype(of(std::size_t{0}))> packed(vertices_);
    for (std::size_t v = 0; v < vertices_; ++v) packed[remap_[v]] = of(v);
    return packed;
  }

  template <class Element>
  Json& add_attribute(const char* name, const std::vector<Element>& elements, Component type,
                      const char* shape, const char* filter = nullptr) {
    attributes_[name] = accessors_.size();
    return add_accessor(binary_.add_attribute(elements.data(), vertices_, sizeof(Element), filter), type,
                        vertices_, shape);
  }
  Json& add_accessor(std::size_t view, Component type, std::size_t count, const char* shape) {
    accessors_.push_back({{"bufferView", view}, {"componentType", type}, {"count", count}, {"type", shape}});
    return accessors_.back();
  }

  void add_positions() {
    std::array<std::uint32_t, 3> maximum = {0, 0, 0};
    for (std::size_t v = 0; v < vertices_; ++v)
      for (std::size_t k = 0; k < 3; ++k) maximum[k] = std::max(maximum[k], y_up(tile_, v)[k]);
    const bool narrow = *std::max_element(maximum.begin(), maximum.end()) <= kNarrow;
    const auto steps = [&](std::size_t v) {
      const auto p = y_up(tile_, v);
      return std::array<std::uint16_t, 4>{static_cast<std::uint16_t>(p[0]), static_cast<std::uint16_t>(p[1]),
                                          static_cast<std::uint16_t>(p[2]), 0};
    };
    const auto floats = [&](std::size_t v) {
      const auto p = y_up(tile_, v);
      return Float3{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    };
    Json& accessor = narrow ? add_attribute("POSITION", in_order(steps), kUnsignedShort, "VEC3")
                            : add_attribute("POSITION", in_order(floats), kFloat, "VEC3");
    accessor.update({{"min", {0, 0, 0}}, {"max", maximum}});
  }

  void add_normals() {
    const auto wanted = in_order([&](std::size_t v) {
      const Double3& n = tile_.normal[v];
      const bool none = n == Double3{0, 0, 0};  // of a vertex of faces without area: any direction will do
      return std::array<float, 4>{static_cast<float>(n[0]), none ? 1.0f : static_cast<float>(n[2]),
                                  static_cast<float>(-n[1]), 0.0f};
    });
    std::vector<std::array<std::int8_t, 4>> packed(vertices_);
    meshopt_encodeFilterOct(packed.data(), vertices_, sizeof packed[0], 8, wanted[0].data());
    add_attribute("NORMAL", packed, kByte, "VEC3", "OCTAHEDRAL")["normalized"] = true;
  }

  void add_colours() {
    const auto colours =
        in_order([&](std::size_t v) { return linear_from_rgba(tile_.rgba[v] | 0xff000000u); });
    add_attribute("COLOR_0", colours, kUnsignedShort, "VEC4")["normalized"] = true;
  }

  void add_picture() {
    add_attribute("TEXCOORD_0", in_order([&](std::size_t v) { return tile_.uv[v]; }), kUnsignedShort,
                  "VEC2")["normalized"] = true;
    picture_ = binary_.add_plain(tile_.jpeg);
  }

  /// As viewers of Tessera show it; others pass attributes over that begin with a line.
  void add_synthetic() {
    const auto marks = in_order([&](std::size_t v) {
      return std::array<std::uint8_t, 4>{tile_.synthetic[v], 0, 0, 0};
    });
    add_attribute("_SYNTHETIC", marks, kUnsignedByte, "SCALAR");
  }

  void add_triangles() {
    const bool small = vertices_ <= kNarrow;  // 65,535 itself is no index: it restarts strips
    triangles_ = accessors_.size();
    add_accessor(binary_.add_indices(indices_, vertices_, small ? 2 : 4),
                 small ? kUnsignedShort : kUnsignedInt, indices_.size(), "SCALAR");
  }

  Json document() const {
    const auto along = [&](std::int64_t steps) { return static_cast<double>(steps) * tile_.grid.step; };
    const Json node = {{"mesh", 0},
                       {"translation", {along(tile_.low[0]), along(tile_.low[2]), -along(tile_.high[1])}},
                       {"scale", {tile_.grid.step, tile_.grid.step, tile_.grid.step}}};
    Json primitive = {{"attributes", attributes_}, {"material", 0}};
    if (tile_.faces.empty())
      primitive["mode"] = 0;
    else
      primitive["indices"] = triangles_;
    const Json extensions = {"EXT_meshopt_compression", "KHR_mesh_quantization"};
    Json all = {{"asset", {{"version", "2.0"}, {"generator", "Tessera"}}},
                {"extensionsUsed", extensions},
                {"extensionsRequired", extensions},
                {"scene", 0},
                {"scenes", {{{"nodes", {0}}}}},
                {"nodes", {node}},
                {"meshes", {{{"primitives", Json::array({std::move(primitive)})}}}},
                {"materials",
                 {{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                   {"doubleSided", true}}}},
                {"accessors", accessors_},
                {"bufferViews", binary_.views},
                {"buffers",
                 {{{"byteLength", binary_.bytes.size()}},
                  {{"byteLength", binary_.unpacked_bytes},
                   {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}}}};
    if (tile_.uv.empty()) return all;
    all.at("materials")[0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    all["textures"] = Json::array({Json{{"sampler", 0}, {"source", 0}}});
    all["images"] = Json::array({Json{{"bufferView", picture_}, {"mimeType", "image/jpeg"}}});
    all["samplers"] =
        Json::array({Json{{"magFilter", 9729}, {"minFilter", 9987}, {"wrapS", 33071}, {"wrapT", 33071}}});
    return all;
  }

  const TileMesh& tile_;
  std::size_t vertices_;
  std::vector<std::uint32_t> indices_;  ///< of vertices in their new order
  std::vector<std::uint32_t> remap_;    ///< of each vertex in it
  Binary binary_;
  Json attributes_, accessors_ = Json::array();
  std::size_t triangles_ = 0;  ///< accessor
  std::size_t picture_ = 0;    ///< view
};

}  // namespace

TileMesh quantise_tile(const MeshBlock& block, const TileGrid& grid, std::vector<Double3> normal,
                       const TilePicture& picture) {
  TileMesh tile;
  tile.grid = grid;
  tile.rgba = block.rgba;
  tile.normal = std::move(normal);
  tile.faces = block.faces;
  std::vector<std::array<std::int64_t, 3>> at(block.position.size());
  tile.low.fill(std::numeric_limits<std::int64_t>::max());
  tile.high.fill(std::numeric_limits<std::int64_t>::min());
  for (std::size_t v = 0; v < at.size(); ++v)
    for (std::size_t k = 0; k < 3; ++k) {
      at[v][k] =
          static_cast<std::int64_t>(std::floor((block.position[v][k] - grid.origin[k]) / grid.step + 0.5));
      tile.low[k] = std::min(tile.low[k], at[v][k]);
      tile.high[k] = std::max(tile.high[k], at[v][k]);
    }
  tile.position.resize(at.size());
  for (std::size_t v = 0; v < at.size(); ++v)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t above = at[v][k] - tile.low[k];
      if (above >= (std::int64_t{1} << 24)) throw std::logic_error("a tile is wider than its grid can tell");
      tile.position[v][k] = static_cast<std::uint32_t>(above);
    }
  tile.uv = picture.uv;
  tile.jpeg = picture.jpeg;
  split_synthetic(block, tile);
  return tile;
}

std::string tile_glb(const TileMesh& tile) {
  return GlbTile(tile).file();
}

}  // namespace tessera
