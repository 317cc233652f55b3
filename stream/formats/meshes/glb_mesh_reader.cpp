/// Binary glTF 2.0 meshes: triangles with float positions and 8, 16 or 32-bit indices in the file's own
/// buffer, as we write them and as most programs do. Node transforms are applied. What it cannot read it
/// names.
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "stream/formats/byte_window.h"
#include "stream/formats/meshes/glb_document.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"

namespace tessera {
namespace {

using nlohmann::json;
using Matrix = std::array<double, 16>;  // column major, as in glTF

constexpr std::uint64_t kMostJsonBytes = std::uint64_t{64} << 20;
constexpr std::uint32_t kJsonChunk = 0x4e4f534a, kBinChunk = 0x004e4942;
constexpr std::size_t kMostNodes = 100000;
constexpr Matrix kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

/// Elements of one accessor, where they lie in the file.
struct Accessor {
  std::uint64_t offset = 0;
  std::uint64_t count = 0;
  std::uint64_t stride = 0;
  ScalarType type = ScalarType::kFloat32;
  int components = 1;
};

/// One use of a primitive in the scene.
struct Instance {
  Accessor positions;
  std::optional<Accessor> colours, indices;
  Matrix transform = kIdentity;
  std::uint64_t first_vertex = 0;
};

Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix product{};
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t r = 0; r < 4; ++r) {
      for (std::size_t k = 0; k < 4; ++k) product[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    }
  }
  return product;
}

Double3 transformed(const Matrix& m, const Double3& p) {
  Double3 q;
  for (std::size_t r = 0; r < 3; ++r) q[r] = m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
  return q;
}

class GlbMeshReader : public MeshReader {
 public:
  GlbMeshReader(ReadFile file, const MeshReadOptions& options) : file_(std::move(file)), options_(options) {
    read_chunks();
    try {
      read_document();
    } catch (const json::exception& e) {  // a wrong type somewhere in the document
      fail(std::string("the glTF document is not valid (") + e.what() + ")");
    }
    document_ = nullptr;
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, header_.colour);
    for (const Instance& instance : instances_) {
      ByteWindow positions = window(instance.positions);
      std::optional<ByteWindow> colours;
      if (instance.colours) colours.emplace(window(*instance.colours));
      for (std::uint64_t i = 0; i < instance.positions.count; ++i) {
        const char* p = positions.peek(12).data();
        Double3 at = {load_scalar<float>(p), load_scalar<float>(p + 4), load_scalar<float>(p + 8)};
        positions.skip(instance.positions.stride);
        if (instance.transform != kIdentity) at = transformed(instance.transform, at);
        batch.add(at, colours ? read_colour(*instance.colours, *colours) : 0);
      }
    }
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override {
    for (const Instance& instance : instances_) {
      std::uint64_t face = 0;
      FaceBatch batch(sink, options_, header_.vertices,
                      [&] { return file_.path().string() + ": triangle " + std::to_string(face); });
      const std::uint64_t count = instance.indices ? instance.indices->count : instance.positions.count;
      std::optional<ByteWindow> indices;
      if (instance.indices) indices.emplace(window(*instance.indices));
      for (; face < count / 3; ++face) {
        MeshFace corners;
        for (std::size_t k = 0; k < 3; ++k) {
          corners[k] = 3 * face + k;
          if (!indices) continue;
          const std::size_t width = scalar_bytes(instance.indices->type);
          corners[k] = load_integer(instance.indices->type, false, indices->peek(width).data());
          indices->skip(instance.indices->stride);
        }
        // An index beyond its primitive must not reach into the next one.
        for (std::uint64_t& v : corners) {
          v = v < instance.positions.count ? v + instance.first_vertex : header_.vertices + v;
        }
        batch.triangle(corners[0], corners[1], corners[2]);
      }
      batch.flush();
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_.path().string() + ": " + what);
  }

  ByteWindow window(const Accessor& a) const {
    const std::uint64_t width = scalar_bytes(a.type) * static_cast<std::uint64_t>(a.components);
    const std::uint64_t end = a.count == 0 ? a.offset : a.offset + (a.count - 1) * a.stride + width;
    return ByteWindow(file_, a.offset, end, ByteWindow::kDefaultCapacity / 4);
  }

  void read_chunks() {
    char start[20];
    if (file_.size() < sizeof start) fail("the file is shorter than a GLB header; it is truncated");
    file_.read_at(0, start, sizeof start);
    const std::uint32_t version = load_scalar<std::uint32_t>(start + 4);
    if (version != 2)
      fail("glTF version " + std::to_string(version) + " is not read; convert it to version 2");
    const std::uint64_t length = load_scalar<std::uint32_t>(start + 8);
    if (length > file_.size()) {
      fail("byte 8: the header says " + std::to_string(length) + " bytes, the file has " +
           std::to_string(file_.size()) + "; it is truncated");
    }
    const std::uint64_t json_bytes = load_scalar<std::uint32_t>(start + 12);
    if (load_scalar<std::uint32_t>(start + 16) != kJsonChunk || json_bytes > length - sizeof start) {
      fail("byte 12: the first chunk is no JSON chunk within the file");
    }
    if (json_bytes > kMostJsonBytes) fail("byte 12: a JSON chunk beyond 64 MiB is not read");
    document_ = read_glb_document(
        ByteWindow(file_, sizeof start, sizeof start + json_bytes, ByteWindow::kDefaultCapacity / 4),
        file_.path().string());
    const std::uint64_t next = sizeof start + json_bytes;
    if (length - next < 8) return;
    char chunk[8];
    file_.read_at(next, chunk, sizeof chunk);
    const std::uint64_t bytes = load_scalar<std::uint32_t>(chunk);
    if (load_scalar<std::uint32_t>(chunk + 4) != kBinChunk) return;
    if (bytes > length - next - 8)
      fail("byte " + std::to_string(next) + ": the binary chunk passes the end of the file");
    bin_begin_ = next + 8;
    bin_bytes_ = bytes;
  }

  void read_document() {
    if (document_.contains("extensionsRequired") && !document_["extensionsRequired"].empty()) {
      fail("it needs the glTF extension " + document_["extensionsRequired"][0].get<std::string>() +
           "; export it without compression or extensions");
    }
    if (document_.contains("asset")) {
      const json& asset = document_["asset"];
      if (asset.contains("generator")) header_.comments.push_back(asset["generator"].get<std::string>());
      if (asset.contains("extras") && asset["extras"].contains("tessera_shift")) {
        header_.shift = asset["extras"]["tessera_shift"].get<Double3>();
      }
    }
    visit_scene();
    for (Instance& instance : instances_) {
      instance.first_vertex = header_.vertices;
      header_.vertices += instance.positions.count;
      header_.faces += (instance.indices ? instance.indices->count : instance.positions.count) / 3;
      header_.colour = header_.colour || instance.colours.has_value();
      header_.double_positions = header_.double_positions || instance.transform != kIdentity;
    }
  }

  const json& item(const char* list, std::uint64_t index) const {
    if (!document_.contains(list) || !document_[list].is_array() || index >= document_[list].size()) {
      fail(std::string("the glTF document names ") + list + " " + std::to_string(index) +
           ", which does not exist");
    }
    return document_[list][index];
  }

  /// Every node that the scene reaches; each once per parent, as glTF forbids cycles and shared nodes.
  void visit_scene() {
    std::vector<std::pair<std::uint64_t, Matrix>> open;
    if (document_.contains("scenes")) {
      const json& scene = item("scenes", document_.value("scene", std::uint64_t{0}));
      if (scene.contains("nodes")) {
        for (const json& node : scene["nodes"]) open.emplace_back(node.get<std::uint64_t>(), kIdentity);
      }
    } else if (document_.contains("nodes")) {
      for (std::uint64_t i = 0; i < document_["nodes"].size(); ++i) open.emplace_back(i, kIdentity);
    }
    for (std::size_t visited = 0; visited < open.size(); ++visited) {
      if (open.size() > kMostNodes) fail("the glTF scene has a cycle or more than 100000 nodes");
      const json& node = item("nodes", open[visited].first);
      const Matrix matrix = multiply(open[visited].second, local_matrix(node));
      if (node.contains("mesh")) add_mesh(item("meshes", node["mesh"].get<std::uint64_t>()), matrix);
      if (!node.contains("children")) continue;
      for (const json& child : node["children"]) open.emplace_back(child.get<std::uint64_t>(), matrix);
    }
  }

  static Matrix local_matrix(const json& node) {
    if (node.contains("matrix")) return node["matrix"].get<Matrix>();
    const auto t = node.value("translation", Double3{0, 0, 0});
    const auto s = node.value("scale", Double3{1, 1, 1});
    const auto q = node.value("rotation", std::array<double, 4>{0, 0, 0, 1});
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    return {(1 - 2 * (y * y + z * z)) * s[0],
            2 * (x * y + z * w) * s[0],
            2 * (x * z - y * w) * s[0],
            0,
            2 * (x * y - z * w) * s[1],
            (1 - 2 * (x * x + z * z)) * s[1],
            2 * (y * z + x * w) * s[1],
            0,
            2 * (x * z + y * w) * s[2],
            2 * (y * z - x * w) * s[2],
            (1 - 2 * (x * x + y * y)) * s[2],
            0,
            t[0],
            t[1],
            t[2],
            1};
  }

  void add_mesh(const json& mesh, const Matrix& matrix) {
    for (const json& primitive : mesh.at("primitives")) {
      const int mode = primitive.value("mode", 4);
      if (mode < 4) continue;  // points and lines
      if (mode > 4) fail("triangle strips and fans of glTF are not read; export plain triangles");
      if (instances_.size() == kMostNodes) fail("the glTF scene has more than 100000 primitives");
      Instance instance;
      instance.transform = matrix;
      const json& attributes = primitive.at("attributes");
      instance.positions = accessor(attributes.at("POSITION").get<std::uint64_t>());
      if (instance.positions.type != ScalarType::kFloat32 || instance.positions.components != 3) {
        fail("glTF positions that are not three floats are not read; export without quantisation");
      }
      if (attributes.contains("COLOR_0")) {
        instance.colours = accessor(attributes["COLOR_0"].get<std::uint64_t>());
        if (instance.colours->count != instance.positions.count || instance.colours->components < 3) {
          fail("a glTF primitive has " + std::to_string(instance.colours->count) + " colours for " +
               std::to_string(instance.positions.count) + " positions");
        }
      }
      if (primitive.contains("indices")) {
        instance.indices = accessor(primitive["indices"].get<std::uint64_t>());
        if (scalar_is_float(instance.indices->type) || instance.indices->components != 1) {
          fail("glTF indices must be whole numbers");
        }
      }
      instances_.push_back(instance);
    }
  }

  Accessor accessor(std::uint64_t index) const {
    const json& a = item("accessors", index);
    if (a.contains("sparse") || !a.contains("bufferView")) fail("sparse glTF accessors are not read");
    const json& view = item("bufferViews", a["bufferView"].get<std::uint64_t>());
    if (view.value("buffer", std::uint64_t{0}) != 0 || item("buffers", 0).contains("uri")) {
      fail("the glTF data lies in another file; export it as one GLB");
    }
    Accessor found;
    switch (a.at("componentType").get<int>()) {
      case 5121:
        found.type = ScalarType::kUint8;
        break;
      case 5123:
        found.type = ScalarType::kUint16;
        break;
      case 5125:
        found.type = ScalarType::kUint32;
        break;
      case 5126:
        found.type = ScalarType::kFloat32;
        break;
      default:
        fail("accessor " + std::to_string(index) + " has a component type that meshes do not use");
    }
    const std::string shape = a.at("type").get<std::string>();
    found.components = shape == "SCALAR" ? 1 : shape == "VEC3" ? 3 : shape == "VEC4" ? 4 : 0;
    found.count = a.at("count").get<std::uint64_t>();
    const std::uint64_t width = scalar_bytes(found.type) * static_cast<std::uint64_t>(found.components);
    found.stride = view.value("byteStride", width);
    const std::uint64_t in_bin = view.value("byteOffset", std::uint64_t{0});
    const std::uint64_t view_bytes = view.at("byteLength").get<std::uint64_t>();
    const std::uint64_t in_view = a.value("byteOffset", std::uint64_t{0});
    const bool fits =
        width > 0 && found.stride >= width && found.stride <= 252 + width && in_bin <= bin_bytes_ &&
        view_bytes <= bin_bytes_ - in_bin && in_view <= view_bytes &&
        (found.count == 0 ||
         (view_bytes - in_view >= width && found.count - 1 <= (view_bytes - in_view - width) / found.stride));
    if (!fits)
      fail("accessor " + std::to_string(index) + " passes the end of its buffer; the file is damaged");
    found.offset = bin_begin_ + in_bin + in_view;
    return found;
  }

  static std::uint32_t read_colour(const Accessor& a, ByteWindow& window) {
    const std::size_t width = scalar_bytes(a.type);
    const char* p = window.peek(width * static_cast<std::size_t>(a.components)).data();
    std::uint32_t c[4] = {0, 0, 0, 255};
    for (std::size_t i = 0; i < static_cast<std::size_t>(a.components); ++i) {
      const double value = load_double(a.type, false, p + i * width);
      const double scale = a.type == ScalarType::kUint8    ? 255.0
                           : a.type == ScalarType::kUint16 ? 65535.0
                                                           : 1.0;
      c[i] = colour_byte(value / scale);
    }
    window.skip(a.stride);
    return pack_rgba(c[0], c[1], c[2], c[3]);
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  json document_;
  std::uint64_t bin_begin_ = 0, bin_bytes_ = 0;
  std::vector<Instance> instances_;
  MeshHeader header_;
  const std::string format_ = "GLB";
};

}  // namespace

std::unique_ptr<MeshReader> open_glb_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<GlbMeshReader>(std::move(file), options);
}

}  // namespace tessera
