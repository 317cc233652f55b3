/// Binary glTF 2.0 with pages of textures: vertices of all pages, interleaved with their coordinates, then faces, then the
/// pictures. Materials are unlit (KHR_materials_unlit), for the light is in the colours, but for those with normal maps.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <tuple>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/formats/meshes/textured_mesh_writer.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxGlbBytes = 0xffffffffULL;
constexpr std::uint64_t kTexturedVertexBytes = 20, kFrameBytes = 28;  ///< a normal, a tangent
constexpr std::size_t kImageBatch = std::size_t{1} << 20;

std::uint64_t padded(std::uint64_t bytes) {
  return (bytes + 3) / 4 * 4;
}

Double3 gltf_axes(const Double3& p) {
  return {p[0], p[2], 0 - p[1]};
}

}  // namespace

Float3 TexturedGlb::file_position(const Double3& p, const Double3& origin) {
  Float3 local{};
  for (std::size_t k = 0; k < 3; ++k) local[k] = static_cast<float>(p[k] - origin[k]);
  return {local[0], local[2], 0.0f - local[1]};  // no zero below zero
}

std::string TexturedGlb::document(std::uint64_t& bin) const {
  std::uint64_t vertices = 0, faces = 0;
  for (const Page& p : pages_) vertices += p.vertices, faces += p.faces;
  const std::uint64_t stride = vertex_bytes(), vertex_bytes = vertices * stride, face_bytes = faces * 12;
  Json asset = {{"version", "2.0"}, {"generator", "Tessera"}};
  if (shift_ != Double3{0, 0, 0}) asset["extras"]["tessera_shift"] = shift_;
  if (!comments_.empty()) asset["extras"]["comments"] = comments_;
  Json views = Json::array(
      {{{"buffer", 0}, {"byteLength", vertex_bytes}, {"byteStride", stride}, {"target", 34962}},
       {{"buffer", 0}, {"byteOffset", vertex_bytes}, {"byteLength", face_bytes}, {"target", 34963}}});
  Json accessors = Json::array(), primitives = Json::array(), materials = Json::array(),
       textures = Json::array(), images = Json::array();
  bin = vertex_bytes + face_bytes;
  std::uint64_t first_vertex = 0, first_face = 0;
  for (std::size_t i = 0; i < pages_.size(); ++i) {
    const Page& p = pages_[i];
    const std::uint64_t bytes = std::filesystem::file_size(p.image);
    primitives.push_back(
        {{"attributes", {{"POSITION", accessors.size()}, {"TEXCOORD_0", accessors.size() + 1}}},
         {"indices", accessors.size() + 2},
         {"material", i}});
    Json& attributes = primitives.back()["attributes"];
    accessors.push_back({{"bufferView", 0},
                         {"byteOffset", first_vertex * stride},
                         {"componentType", 5126},
                         {"count", p.vertices},
                         {"type", "VEC3"},
                         {"min", p.min},
                         {"max", p.max}});
    accessors.push_back({{"bufferView", 0},
                         {"byteOffset", first_vertex * stride + 12},
                         {"componentType", 5126},
                         {"count", p.vertices},
                         {"type", "VEC2"}});
    accessors.push_back({{"bufferView", 1},
                         {"byteOffset", first_face * 12},
                         {"componentType", 5125},
                         {"count", 3 * p.faces},
                         {"type", "SCALAR"}});
    const auto add_image = [&](const std::filesystem::path& path, std::uint64_t size) {
      textures.push_back({{"sampler", 0}, {"source", images.size()}});
      images.push_back({{"bufferView", views.size()},
                        {"mimeType", path.extension() == ".jpg" ? "image/jpeg" : "image/png"}});
      views.push_back({{"buffer", 0}, {"byteOffset", bin}, {"byteLength", size}});
      bin += padded(size);
    };
    materials.push_back({{"pbrMetallicRoughness",
                          {{"baseColorTexture", {{"index", textures.size()}}},
                           {"metallicFactor", 0},
                           {"roughnessFactor", 1}}}});
    add_image(p.image, bytes);
    if (has_normals()) {  // lit, for the light shows them
      materials.back()["normalTexture"] = {{"index", textures.size()}};
      add_image(p.normals, std::filesystem::file_size(p.normals));
      for (const auto& [name, offset, type] :
           {std::tuple{"NORMAL", 20, "VEC3"}, std::tuple{"TANGENT", 32, "VEC4"}}) {
        attributes[name] = accessors.size();
        accessors.push_back({{"bufferView", 0},
                             {"byteOffset", first_vertex * stride + static_cast<std::uint64_t>(offset)},
                             {"componentType", 5126},
                             {"count", p.vertices},
                             {"type", type}});
      }
    } else {
      materials.back()["extensions"] = {{"KHR_materials_unlit", Json::object()}};
    }
    first_vertex += p.vertices, first_face += p.faces;
  }
  Json node = {{"mesh", 0}};
  if (origin_ != Double3{0, 0, 0}) node["translation"] = gltf_axes(origin_);
  Json all = {
      {"asset", asset},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", Json::array({node})},
      {"meshes", Json::array({Json{{"primitives", primitives}}})},
      {"materials", materials},
      {"textures", textures},
      {"images", images},
      {"samplers",
       Json::array({Json{{"magFilter", 9729}, {"minFilter", 9987}, {"wrapS", 33071}, {"wrapT", 33071}}})},
      {"accessors", accessors},
      {"bufferViews", views},
      {"buffers", Json::array({Json{{"byteLength", bin}}})}};
  if (!has_normals()) all["extensionsUsed"] = {"KHR_materials_unlit"};
  std::string text = dump_json(all);
  text.resize(padded(text.size()), ' ');
  return text;
}

TexturedGlb::TexturedGlb(const std::filesystem::path& path, const MeshHeader& header, std::vector<Page> pages)
    : origin_(header.origin), shift_(header.shift), comments_(header.comments), pages_(std::move(pages)) {
  std::uint64_t bin = 0;
  const std::string text = document(bin);
  if (28 + text.size() + bin > kMaxGlbBytes)
    throw UsageError(path.string() + ": GLB ends at 4 GiB, and the mesh with its textures takes " +
                     std::to_string(28 + text.size() + bin) + " bytes; write .obj or .ply instead");
  file_ = std::make_unique<OutputFile>(path);
  const auto word = [&](std::uint64_t value) {
    const auto w = static_cast<std::uint32_t>(value);
    file_->append(&w, sizeof w);
  };
  word(0x46546c67), word(2), word(28 + text.size() + bin);
  word(text.size()), word(0x4e4f534a);
  file_->append(text);
  word(bin), word(0x004e4942);
}

std::uint64_t TexturedGlb::vertex_bytes() const {
  return kTexturedVertexBytes + (has_normals() ? kFrameBytes : 0);
}

void TexturedGlb::vertices(std::span<const Double3> positions, std::span<const Double2> uv,
                           std::span<const Frame> frames) {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Float3 p = file_position(positions[i], origin_);
    const std::array<float, 2> t = {static_cast<float>(std::clamp(uv[i][0], 0.0, 1.0)),
                                    static_cast<float>(std::clamp(1.0 - uv[i][1], 0.0, 1.0))};
    file_->append(p.data(), sizeof p);
    file_->append(t.data(), sizeof t);
    if (frames.empty()) continue;
    const Float3 n = narrow(gltf_axes(frames[i].normal)), along = narrow(gltf_axes(frames[i].tangent));
    const float right_handed = 1.0f;
    file_->append(n.data(), sizeof n);
    file_->append(along.data(), sizeof along);
    file_->append(&right_handed, sizeof right_handed);
  }
  vertices_ += positions.size();
}

void TexturedGlb::faces(std::span<const std::array<std::uint32_t, 3>> faces) {
  for (const auto& f : faces) file_->append(f.data(), sizeof f);
  faces_ += faces.size();
}

std::uint64_t TexturedGlb::finish() {
  std::uint64_t vertices = 0, faces = 0;
  for (const Page& p : pages_) vertices += p.vertices, faces += p.faces;
  if (vertices != vertices_ || faces != faces_)
    throw ValidationError(file_->path().string() + ": not as many vertices or faces came as were announced");
  std::vector<char> buffer(kImageBatch);
  const auto copy = [&](const std::filesystem::path& path) {
    const ReadFile image(path);
    for (std::uint64_t at = 0; at < image.size();) {
      const std::uint64_t bytes = std::min<std::uint64_t>(buffer.size(), image.size() - at);
      image.read_at(at, buffer.data(), bytes);
      file_->append(buffer.data(), bytes);
      at += bytes;
    }
    const char zeros[4] = {};
    file_->append(zeros, padded(image.size()) - image.size());
  };
  for (const Page& p : pages_) {
    copy(p.image);
    if (has_normals()) copy(p.normals);
  }
  const std::uint64_t bytes = file_->size();
  file_->finish();
  return bytes;
}

}  // namespace tessera
