/// Binary glTF 2.0 meshes: triangles, strips and fans whose numbers lie in the file's own buffer (glb_accessor.h).
/// Transforms of nodes are applied, in doubles, and faces of mirrored ones turned; +Y is up in glTF (2.0, 3.4) and z is
/// here: x, y, z of the scene become x, -z, y. Linear colours become sRGB. What it cannot read it names; what it leaves
/// out it tells.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "stream/files/json.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/meshes/glb_accessor.h"
#include "stream/formats/meshes/glb_document.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/srgb.h"

namespace tessera {
namespace {

using Matrix = std::array<double, 16>;  // column major, as in glTF

constexpr std::uint64_t kMaxJsonBytes = std::uint64_t{64} << 20;
constexpr std::uint32_t kJsonChunk = 0x4e4f534a, kBinChunk = 0x004e4942;
constexpr std::size_t kMaxNodes = 100000;
constexpr Matrix kZUp = {1, 0,  0, 0, 0, 0, 1, 0,
                         0, -1, 0, 0, 0, 0, 0, 1};  ///< from the axes of a scene to ours

enum Mode { kPoints = 0, kTriangles = 4, kStrip = 5, kFan = 6 };

/// Extensions that say nothing of where triangles are: what a file requires of these, it gets.
bool concerns_looks(const std::string& extension) {
  for (const char* prefix : {"KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_",
                             "EXT_lights_", "KHR_xmp", "EXT_structural_metadata", "EXT_mesh_features"})
    if (extension.starts_with(prefix)) return true;
  return false;
}

/// Extensions that are read.
bool is_read(const std::string& extension) {
  return extension == "KHR_mesh_quantization" || extension == "EXT_meshopt_compression" ||
         extension == "EXT_mesh_gpu_instancing";
}

/// One use of a primitive in the scene.
struct Instance {
  GlbAccessor positions;
  std::optional<GlbAccessor> colours, indices;
  int mode = kTriangles;
  Matrix transform = kZUp;
  bool mirrored = false;
  std::optional<std::size_t> vertices_of;  ///< an instance before it that has the same ones
  std::uint64_t first_vertex = 0;

  std::uint64_t corners() const { return indices ? indices->count : positions.count; }
  std::uint64_t faces() const {
    return mode == kTriangles ? corners() / 3 : std::max<std::uint64_t>(corners(), 2) - 2;
  }
};

/// What the scene has beside triangles; counted, to be told.
struct LeftOut {
  std::uint64_t lines = 0, texture_coordinates = 0, skins = 0, targets = 0, nodes = 0, corners = 0;
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

/// Whether a map turns right hands into left ones: faces that it moves look to the other side.
bool mirrors(const Matrix& m) {
  return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[4] * (m[1] * m[10] - m[2] * m[9]) +
             m[8] * (m[1] * m[6] - m[2] * m[5]) <
         0.0;
}

/// Translation, rotation (a unit quaternion, x y z w) and scale, done in the opposite order.
Matrix composed(const Double3& t, const std::array<double, 4>& q, const Double3& s) {
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

class GlbMeshReader : public MeshReader {
 public:
  GlbMeshReader(ReadFile file, const MeshReadOptions& options) : file_(std::move(file)), options_(options) {
    read_chunks();
    try {
      read_document();
    } catch (const JsonError& e) {  // a wrong type somewhere in the document
      fail(std::string("the glTF document is not valid (") + e.what() + ")");
    }
    document_ = nullptr;
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, header_.colour);
    for (const Instance& instance : instances_) {
      if (instance.vertices_of) continue;
      const GlbAccessor& positions = instance.positions;
      GlbElements elements(*buffers_, positions);
      std::optional<GlbElements> colours;
      if (instance.colours) colours.emplace(*buffers_, *instance.colours);
      for (std::uint64_t i = 0; i < positions.count; ++i) {
        const char* p = elements.next();
        Double3 at = {positions.number(p, 0), positions.number(p, 1), positions.number(p, 2)};
        at = transformed(instance.transform, at);
        // A primitive without colours beside others that have some is white, as glTF has it.
        batch.add(at, colours ? colour(*instance.colours, colours->next()) : 0xffffffffu);
      }
    }
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override {
    for (const Instance& instance : instances_) {
      std::uint64_t face = 0;
      FaceBatch batch(sink, options_, header_.vertices,
                      [&] { return file_.path().string() + ": triangle " + std::to_string(face); });
      const auto add = [&](std::uint64_t a, std::uint64_t b, std::uint64_t c) {
        if (instance.mirrored) std::swap(b, c);
        batch.triangle(vertex(instance, a), vertex(instance, b), vertex(instance, c));
        ++face;
      };
      std::optional<GlbElements> indices;
      if (instance.indices) indices.emplace(*buffers_, *instance.indices);
      std::uint64_t corner = 0;
      const auto next = [&] {
        const std::uint64_t in_order = corner++;
        return indices ? load_integer(instance.indices->type, false, indices->next()) : in_order;
      };
      if (instance.mode == kTriangles) {
        for (std::uint64_t f = instance.faces(); f > 0; --f) {
          const std::uint64_t a = next(), b = next();
          add(a, b, next());
        }
      } else {
        read_strip(instance, next, add);
      }
      batch.flush();
    }
  }

  /// Without indices faces share no vertices, as in STL: positions tell which are the same. Colours may differ there.
  bool shared_vertices() const override { return shared_vertices_; }
  bool split_vertices() const override { return split_vertices_; }

  /// Complete from the beginning: they follow from the document alone.
  std::vector<std::string> warnings() const override {
    std::vector<std::string> all;
    const auto tell = [&](std::uint64_t count, const std::string& one, const std::string& what) {
      if (count > 0) all.push_back(std::to_string(count) + " " + one + (count > 1 ? "s" : "") + " " + what);
    };
    tell(left_out_.lines, "primitive", "of points or lines left out: a mesh has faces alone");
    tell(left_out_.texture_coordinates, "primitive", "with texture coordinates read without them");
    tell(left_out_.skins, "node", "with a skin read without it: the mesh is as it is stored");
    tell(left_out_.targets, "primitive", "with morph targets read without them: the mesh is as it is stored");
    tell(left_out_.nodes, "node", "with a mesh left out: the scene does not show it");
    tell(left_out_.corners, "corner", "at the end of primitives left out: they make no whole triangle");
    return all;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_.path().string() + ": " + what);
  }

  /// An index beyond its primitive must not reach into the next one.
  std::uint64_t vertex(const Instance& instance, std::uint64_t index) const {
    return index < instance.positions.count ? index + instance.first_vertex : header_.vertices + index;
  }

  /// Triangles of a strip or fan, as glTF 2.0 orders their corners (section 3.7.2.1). Those of a strip that are none, which
  /// join its parts, are left out. The largest index begins anew, as in graphics interfaces, where it is no vertex.
  template <class Next, class Add>
  static void read_strip(const Instance& instance, const Next& next, const Add& add) {
    const std::uint64_t restart = !instance.indices
                                      ? ~std::uint64_t{0}
                                      : (std::uint64_t{1} << (8 * scalar_bytes(instance.indices->type))) - 1;
    std::uint64_t a = 0, b = 0, corners = 0;
    for (std::uint64_t i = instance.corners(); i > 0; --i) {
      const std::uint64_t c = next();
      if (c == restart && c >= instance.positions.count) {
        corners = 0;
        continue;
      }
      if (instance.mode == kFan) {
        if (corners >= 2) add(b, c, a);
        if (corners == 0) a = c;
      } else {
        const bool odd = corners % 2 == 1;
        if (corners >= 2 && a != b && b != c && a != c) add(a, odd ? c : b, odd ? b : c);
        a = b;
      }
      b = c;
      ++corners;
    }
  }

  void read_chunks() {
    char start[20];
    if (file_.size() < sizeof start) fail("the file is shorter than a GLB header; it is truncated");
    file_.read_at(0, start, sizeof start);
    require_glb_version(load_scalar<std::uint32_t>(start + 4), file_.path().string());
    const std::uint64_t length = load_scalar<std::uint32_t>(start + 8);
    if (length > file_.size()) {
      fail("byte 8: the header says " + std::to_string(length) + " bytes, the file has " +
           std::to_string(file_.size()) + "; it is truncated");
    }
    const std::uint64_t json_bytes = load_scalar<std::uint32_t>(start + 12);
    if (load_scalar<std::uint32_t>(start + 16) != kJsonChunk || json_bytes > length - sizeof start) {
      fail("byte 12: the first chunk is no JSON chunk within the file");
    }
    if (json_bytes > kMaxJsonBytes) fail("byte 12: a JSON chunk beyond 64 MiB is not read");
    document_ = read_glb_document(
        ByteWindow(file_, sizeof start, sizeof start + json_bytes, ByteWindow::kDefaultCapacity / 4),
        file_.path().string());
    // Chunks of other types may stand anywhere behind the first one.
    std::uint64_t begin = 0, bytes = 0;
    for (std::uint64_t next = sizeof start + json_bytes; begin == 0 && length - next >= 8;) {
      char chunk[8];
      file_.read_at(next, chunk, sizeof chunk);
      const std::uint64_t size = load_scalar<std::uint32_t>(chunk);
      const bool binary = load_scalar<std::uint32_t>(chunk + 4) == kBinChunk;
      if (size > length - next - 8) {
        if (!binary) break;
        fail("byte " + std::to_string(next) + ": the binary chunk passes the end of the file");
      }
      if (binary) begin = next + 8, bytes = size;
      next += 8 + size;
    }
    buffers_.emplace(file_, begin, bytes);
  }

  void read_document() {
    if (document_.contains("extensionsRequired")) {
      for (const Json& required : document_["extensionsRequired"]) {
        const auto name = required.get<std::string>();
        if (!is_read(name) && !concerns_looks(name))
          fail("it needs the glTF extension " + name + ", which is not read; export it without");
      }
    }
    if (document_.contains("asset")) {
      const Json& asset = document_["asset"];
      if (asset.contains("generator")) header_.comments.push_back(asset["generator"].get<std::string>());
      if (asset.contains("extras") && asset["extras"].contains("tessera_shift")) {
        header_.shift = asset["extras"]["tessera_shift"].get<Double3>();
      }
    }
    visit_scene();
    bool soup = true;
    for (Instance& instance : instances_) {
      if (instance.vertices_of) {
        instance.first_vertex = instances_[*instance.vertices_of].first_vertex;
      } else {
        instance.first_vertex = header_.vertices;
        header_.vertices += instance.positions.count;
      }
      header_.faces += instance.faces();
      header_.colour = header_.colour || instance.colours.has_value();
      header_.double_positions =
          header_.double_positions || instance.transform != kZUp || instance.positions.normalized;
      soup = soup && !instance.indices && instance.mode == kTriangles && instance.corners() % 3 == 0 &&
             !instance.vertices_of;
    }
    shared_vertices_ = !soup || header_.colour;
    if (instances_.empty())
      fail(std::string("the glTF scene has no triangles") +
           (left_out_.lines > 0 ? ", only points or lines" : "") + "; export a mesh");
  }

  const Json& item(const char* list, std::uint64_t index) const {
    return glb_item(document_, list, index, file_.path().string());
  }

  /// Every node that the scene reaches; each once per parent, as glTF forbids cycles and shared nodes.
  void visit_scene() {
    std::vector<std::pair<std::uint64_t, Matrix>> open;
    std::set<std::uint64_t> shown;
    if (document_.contains("scenes") && !document_["scenes"].empty()) {
      const Json& scene = item("scenes", document_.value("scene", std::uint64_t{0}));
      if (scene.contains("nodes")) {
        for (const Json& node : scene["nodes"]) open.emplace_back(node.get<std::uint64_t>(), kZUp);
      }
    } else if (document_.contains("nodes")) {
      std::set<std::uint64_t> children;
      for (const Json& node : document_["nodes"]) {
        if (!node.contains("children")) continue;
        for (const Json& child : node["children"]) children.insert(child.get<std::uint64_t>());
      }
      for (std::uint64_t i = 0; i < document_["nodes"].size(); ++i)
        if (children.count(i) == 0) open.emplace_back(i, kZUp);
    }
    for (std::size_t visited = 0; visited < open.size(); ++visited) {
      if (open.size() > kMaxNodes) fail("the glTF scene has a cycle or more than 100000 nodes");
      const Json& node = item("nodes", open[visited].first);
      const Matrix matrix = multiply(open[visited].second, local_matrix(node));
      if (node.contains("mesh")) add_node(node, matrix), shown.insert(open[visited].first);
      if (!node.contains("children")) continue;
      for (const Json& child : node["children"]) open.emplace_back(child.get<std::uint64_t>(), matrix);
    }
    if (!document_.contains("nodes")) return;
    for (std::uint64_t i = 0; i < document_["nodes"].size(); ++i)
      left_out_.nodes += document_["nodes"][i].contains("mesh") && shown.count(i) == 0;
  }

  static Matrix local_matrix(const Json& node) {
    if (node.contains("matrix")) return node["matrix"].get<Matrix>();
    return composed(node.value("translation", Double3{0, 0, 0}),
                    node.value("rotation", std::array<double, 4>{0, 0, 0, 1}),
                    node.value("scale", Double3{1, 1, 1}));
  }

  /// The mesh of a node: once, or in all places that EXT_mesh_gpu_instancing has for it.
  void add_node(const Json& node, const Matrix& matrix) {
    const Json& mesh = item("meshes", node["mesh"].get<std::uint64_t>());
    if (node.contains("skin")) ++left_out_.skins;
    constexpr const char* kInstancing = "EXT_mesh_gpu_instancing";
    if (!node.contains("extensions") || !node["extensions"].contains(kInstancing)) {
      add_mesh(mesh, matrix);
      return;
    }
    const Json& attributes = node["extensions"][kInstancing].at("attributes");
    struct Column {
      GlbAccessor accessor;
      GlbElements elements;
      std::size_t first;  ///< number of a placement that it gives
    };
    std::vector<Column> columns;
    for (const auto& [name, first, width] :
         {std::tuple("TRANSLATION", 0, 3), std::tuple("ROTATION", 3, 4), std::tuple("SCALE", 7, 3)}) {
      if (!attributes.contains(name)) continue;
      const GlbAccessor a = buffers_->accessor(document_, attributes[name].get<std::uint64_t>());
      if (a.components != width || (!columns.empty() && columns[0].accessor.count != a.count))
        fail(std::string("the columns of ") + kInstancing + " do not fit each other; the file is damaged");
      columns.push_back({a, GlbElements(*buffers_, a), static_cast<std::size_t>(first)});
    }
    const std::uint64_t count = columns.empty() ? 0 : columns[0].accessor.count;
    for (std::uint64_t i = 0; i < count; ++i) {
      std::array<double, 10> n = {0, 0, 0, 0, 0, 0, 1, 1, 1, 1};
      for (Column& c : columns) {
        const char* element = c.elements.next();
        for (int k = 0; k < c.accessor.components; ++k)
          n[c.first + static_cast<std::size_t>(k)] = c.accessor.number(element, k);
      }
      add_mesh(mesh,
               multiply(matrix, composed({n[0], n[1], n[2]}, {n[3], n[4], n[5], n[6]}, {n[7], n[8], n[9]})));
    }
  }

  void add_mesh(const Json& mesh, const Matrix& matrix) {
    same_vertices_.clear();
    for (const Json& primitive : mesh.at("primitives")) {
      const int mode = primitive.value("mode", static_cast<int>(kTriangles));
      if (mode < kPoints || mode > kFan)
        fail("a glTF primitive has the unknown mode " + std::to_string(mode));
      if (mode < kTriangles) {
        ++left_out_.lines;
        continue;
      }
      if (instances_.size() == kMaxNodes) fail("the glTF scene has more than 100000 primitives");
      add_primitive(primitive, mode, matrix);
    }
  }

  void add_primitive(const Json& primitive, int mode, const Matrix& matrix) {
    Instance instance;
    instance.mode = mode;
    instance.transform = matrix;
    instance.mirrored = mirrors(matrix);
    const Json& attributes = primitive.at("attributes");
    if (!attributes.contains("POSITION")) fail("a glTF primitive has no positions; export it with them");
    const auto positions = attributes["POSITION"].get<std::uint64_t>();
    constexpr const char* kDraco = "KHR_draco_mesh_compression";
    const Json& stored = item("accessors", positions);
    if (!stored.contains("bufferView") && !stored.contains("sparse") && primitive.contains("extensions") &&
        primitive["extensions"].contains(kDraco))
      fail(std::string("it needs the glTF extension ") + kDraco + ", which is not read; export it without");
    instance.positions = buffers_->accessor(document_, positions);
    if (instance.positions.components != 3) fail("glTF positions must be of three numbers each");
    if (attributes.contains("COLOR_0")) {
      instance.colours = buffers_->accessor(document_, attributes["COLOR_0"].get<std::uint64_t>());
      instance.colours->normalized = true;  // those of whole numbers are, whether the file says so or not
      if (instance.colours->count != instance.positions.count || instance.colours->components < 3) {
        fail("a glTF primitive has " + std::to_string(instance.colours->count) + " colours for " +
             std::to_string(instance.positions.count) + " positions");
      }
    }
    if (primitive.contains("indices")) {
      instance.indices = buffers_->accessor(document_, primitive["indices"].get<std::uint64_t>());
      const ScalarType type = instance.indices->type;
      if ((type != ScalarType::kUint8 && type != ScalarType::kUint16 && type != ScalarType::kUint32) ||
          instance.indices->components != 1)
        fail("glTF indices must be whole numbers without sign");
    }
    // Primitives of other materials often use the same vertices: they are one surface.
    const std::int64_t colours = attributes.value("COLOR_0", std::int64_t{-1});
    const auto [same, first] = same_vertices_.try_emplace({positions, colours}, instances_.size());
    if (!first) instance.vertices_of = same->second;
    left_out_.texture_coordinates += attributes.contains("TEXCOORD_0");
    split_vertices_ = split_vertices_ || attributes.contains("TEXCOORD_0") || attributes.contains("NORMAL");
    left_out_.targets += primitive.contains("targets");
    if (mode == kTriangles) left_out_.corners += instance.corners() % 3;
    instances_.push_back(std::move(instance));
  }

  /// COLOR_0 is linear (glTF 2.0, section 3.7.2.1), its alpha as it is.
  static std::uint32_t colour(const GlbAccessor& a, const char* element) {
    std::uint32_t c[4] = {0, 0, 0, 255};
    for (int k = 0; k < 3; ++k) c[k] = srgb_from_linear(a.number(element, k));
    if (a.components == 4) c[3] = colour_byte(a.number(element, 3));
    return pack_rgba(c[0], c[1], c[2], c[3]);
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  Json document_;
  std::optional<GlbBuffers> buffers_;
  std::vector<Instance> instances_;
  std::map<std::pair<std::uint64_t, std::int64_t>, std::size_t>
      same_vertices_;  ///< of the mesh at hand, by accessors
  bool shared_vertices_ = true, split_vertices_ = false;
  LeftOut left_out_;
  MeshHeader header_;
  const std::string format_ = "GLB";
};

}  // namespace

std::unique_ptr<MeshReader> open_glb_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<GlbMeshReader>(std::move(file), options);
}

}  // namespace tessera
