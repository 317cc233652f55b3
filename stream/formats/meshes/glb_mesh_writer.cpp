/// Binary glTF 2.0: one mesh of one primitive, float positions, 32-bit indices, optional linear
/// colours of 16 bits interleaved with the positions. +Y is up (glTF 2.0, 3.4): x, y, z of the mesh are x, z, -y of the
/// file, and the origin that positions count from is the node's translation, in decimal doubles. Sizes follow from the
/// counts, so the file is written in order;
/// only the bounds, which glTF wants in its JSON, are patched in at the end into room kept for them.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_writer_base.h"
#include "stream/formats/srgb.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxBytes = 0xffffffffULL;
constexpr std::size_t kBoundsBytes = 3 * 16 + 4;  // "[a,b,c]" of floats, padded with spaces
constexpr std::size_t kGlbBatch = 65536;
const char* const kBoundsMarks[2] = {"\"@min\"", "\"@max\""};

std::uint64_t vertex_bytes(const MeshHeader& header) {
  return header.colour ? 20 : 12;
}

/// x, y, z of the mesh along the axes of glTF.
template <class Vector>
Vector y_up(const Vector& p) {
  return {p[0], p[2], 0 - p[1]};  // no zero below zero
}

std::string document(const MeshHeader& header) {
  const std::uint64_t vertices_end = header.vertices * vertex_bytes(header);
  Json asset = {{"version", "2.0"}, {"generator", "Tessera"}};
  if (header.shift != Double3{0, 0, 0}) asset["extras"]["tessera_shift"] = header.shift;
  if (!header.comments.empty()) asset["extras"]["comments"] = header.comments;
  Json attributes = {{"POSITION", 0}};
  Json accessors = Json::array(
      {{{"bufferView", 0},
        {"componentType", 5126},
        {"count", header.vertices},
        {"type", "VEC3"},
        {"min", "@min"},
        {"max", "@max"}},
       {{"bufferView", 1}, {"componentType", 5125}, {"count", 3 * header.faces}, {"type", "SCALAR"}}});
  if (header.colour) {
    attributes["COLOR_0"] = 2;
    accessors.push_back({{"bufferView", 0},
                         {"byteOffset", 12},
                         {"componentType", 5123},
                         {"normalized", true},
                         {"count", header.vertices},
                         {"type", "VEC4"}});
  }
  Json views = Json::array(
      {{{"buffer", 0}, {"byteLength", vertices_end}, {"target", 34962}},
       {{"buffer", 0}, {"byteOffset", vertices_end}, {"byteLength", 12 * header.faces}, {"target", 34963}}});
  if (header.colour) views[0]["byteStride"] = vertex_bytes(header);
  Json node = {{"mesh", 0}};
  if (header.origin != Double3{0, 0, 0}) node["translation"] = y_up(header.origin);
  const Json all = {{"asset", asset},
                    {"scene", 0},
                    {"scenes", {{{"nodes", {0}}}}},
                    {"nodes", Json::array({node})},
                    {"meshes", {{{"primitives", {{{"attributes", attributes}, {"indices", 1}}}}}}},
                    {"accessors", accessors},
                    {"bufferViews", views},
                    {"buffers", {{{"byteLength", vertices_end + 12 * header.faces}}}}};
  std::string text = dump_json(all);
  for (const char* mark : kBoundsMarks) text.replace(text.find(mark), std::strlen(mark), kBoundsBytes, ' ');
  text.resize((text.size() + 3) / 4 * 4, ' ');
  return text;
}

class GlbMeshWriter : public MeshWriterBase {
 public:
  GlbMeshWriter(const std::filesystem::path& path, const MeshHeader& header, const std::string& text)
      : MeshWriterBase(path, header, true) {
    const std::uint64_t bin = header.vertices * vertex_bytes(header) + 12 * header.faces;
    put_word(0x46546c67);
    put_word(2);
    put_word(28 + text.size() + bin);
    put_word(text.size());
    put_word(0x4e4f534a);
    const std::string max_key = "\"max\":", min_key = "\"min\":";
    bounds_at_[0] = file_.size() + text.find(min_key) + min_key.size();
    bounds_at_[1] = file_.size() + text.find(max_key) + max_key.size();
    file_.append(text);
    put_word(bin);
    put_word(0x004e4942);
    constexpr float kHuge = std::numeric_limits<float>::infinity();
    min_ = {kHuge, kHuge, kHuge};
    max_ = {-kHuge, -kHuge, -kHuge};
  }

 private:
  void put_word(std::uint64_t value) {
    const auto word = static_cast<std::uint32_t>(value);
    file_.append(&word, sizeof word);
  }

  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) override {
    const std::size_t bytes = static_cast<std::size_t>(vertex_bytes(header_));
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const Float3 p = y_up(local(positions[i]));
      for (std::size_t k = 0; k < 3; ++k) {
        if (!std::isfinite(p[k])) {
          throw InputError(file_.path().string() +
                           ": GLB holds finite positions only and the mesh has others; write .ply instead");
        }
        min_[k] = std::min(min_[k], p[k]);
        max_[k] = std::max(max_[k], p[k]);
      }
      char* to = file_.reserve(bytes);
      std::memcpy(to, p.data(), sizeof p);
      if (header_.colour) {
        const std::array<std::uint16_t, 4> colour = linear_from_rgba(rgba[i]);
        std::memcpy(to + sizeof p, colour.data(), sizeof colour);
      }
      file_.commit(bytes);
    }
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    for (std::size_t first = 0; first < faces.size(); first += kGlbBatch) {
      const auto batch = faces.subspan(first, std::min(kGlbBatch, faces.size() - first));
      char* to = file_.reserve(batch.size() * 12);
      for (const MeshFace& face : batch) {
        for (const std::uint64_t v : face) {
          const auto index = static_cast<std::uint32_t>(v);
          std::memcpy(to, &index, sizeof index);
          to += sizeof index;
        }
      }
      file_.commit(batch.size() * 12);
    }
  }

  void write_end() override {
    for (std::size_t i = 0; i < 2; ++i) {
      const Float3& bound = i == 0 ? min_ : max_;
      char text[kBoundsBytes + 1];
      std::fill(std::begin(text), std::end(text), ' ');
      char* to = text;
      for (std::size_t k = 0; k < 3; ++k) {
        *to++ = k == 0 ? '[' : ',';
        to = std::to_chars(to, std::end(text), bound[k]).ptr;
      }
      *to = ']';
      file_.patch(bounds_at_[i], text, kBoundsBytes);
    }
  }

  std::uint64_t bounds_at_[2];
  Float3 min_, max_;
};

}  // namespace

std::unique_ptr<MeshWriter> create_glb_mesh(const std::filesystem::path& path, const MeshHeader& header) {
  if (header.vertices == 0 || header.faces == 0) {
    throw UsageError(path.string() + ": GLB cannot hold a mesh without faces; write .ply instead");
  }
  // Counts above the limit would overflow the products below.
  const bool countable = header.vertices <= kMaxBytes && header.faces <= kMaxBytes;
  const std::uint64_t bin = countable ? header.vertices * vertex_bytes(header) + 12 * header.faces : 0;
  const std::string text = countable ? document(header) : std::string();
  if (!countable || 28 + text.size() + bin > kMaxBytes) {
    throw UsageError(path.string() + ": GLB ends at 4 GiB, too little for " +
                     std::to_string(header.vertices) + " vertices and " + std::to_string(header.faces) +
                     " faces; write .ply instead");
  }
  return std::make_unique<GlbMeshWriter>(path, header, text);
}

}  // namespace tessera
