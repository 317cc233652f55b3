#include "stream/survey/scalar_files.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <string>

#include "octree/error.h"
#include "stream/files/output_file.h"
#include "stream/formats/meshes/mesh_writer_base.h"

namespace tessera {
namespace {

/// In the shortest form that reads back to the same bits, and a separator.
char* put_text(char* to, double value, char after) {
  constexpr std::size_t kLongest = 24;
  if (!std::isnan(value)) to = std::to_chars(to, to + kLongest, value).ptr;
  *to = after;
  return to + 1;
}

class ScalarCsv : public ScalarFile {
 public:
  ScalarCsv(const std::filesystem::path& path, const std::vector<std::string>& names)
      : file_(path), count_(names.size()) {
    std::string head = "x,y,z";
    for (const std::string& name : names) head += "," + name;
    file_.append(head + "\n");
  }
  void add(const PointChunk& points, std::span<const double> scalars) override {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!std::isfinite(points.x[i]) || !std::isfinite(points.y[i]) || !std::isfinite(points.z[i])) continue;
      constexpr std::size_t kNumber = 25;
      char* const row = file_.reserve((3 + count_) * kNumber);
      char* to = row;
      to = put_text(to, points.x[i], ',');
      to = put_text(to, points.y[i], ',');
      to = put_text(to, points.z[i], ',');
      for (std::size_t k = 0; k < count_; ++k)
        to = put_text(to, scalars[i * count_ + k], k + 1 == count_ ? '\n' : ',');
      file_.commit(static_cast<std::size_t>(to - row));
    }
  }
  std::uint64_t finish() override {
    const std::uint64_t size = file_.size();
    file_.finish();
    return size;
  }

 private:
  OutputFile file_;
  std::size_t count_;
};

class ScalarPoints : public ScalarFile {
 public:
  ScalarPoints(const std::filesystem::path& path, const PointFileHeader& header)
      : attributes_(header.attributes),
        encoder_(make_point_encoder(path, header)),
        writer_(create_point_file(path, header)) {}
  void add(const PointChunk& points, std::span<const double> scalars) override {
    chunk_ = points;
    fill_missing(chunk_, attributes_);
    encoder_->encode(chunk_, {}, scalars, encoded_);
    writer_->append(encoded_);
  }
  std::uint64_t finish() override { return writer_->finish(); }

 private:
  PointAttributes attributes_;
  std::unique_ptr<PointEncoder> encoder_;
  std::unique_ptr<PointWriter> writer_;
  PointChunk chunk_;
  EncodedPoints encoded_;
};

class ScalarMesh : public ScalarFile {
 public:
  ScalarMesh(const std::filesystem::path& path, MeshReader& mesh, bool colour, std::vector<std::string> names)
      : file_(path),
        mesh_(mesh),
        names_(std::move(names)),
        colour_(colour),
        doubles_(mesh.header().double_positions) {
    file_.append(header_text());
  }
  void add(const PointChunk& points, std::span<const double> scalars) override {
    const std::size_t record = (doubles_ ? 24u : 12u) + (colour_ ? 4u : 0u) + names_.size() * sizeof(double);
    for (std::size_t i = 0; i < points.size(); ++i) {
      char* to = file_.reserve(record);
      for (const double v : {points.x[i], points.y[i], points.z[i]})
        to = doubles_ ? put(to, v) : put(to, static_cast<float>(v));
      if (colour_) to = put(to, points.rgba[i]);
      for (std::size_t k = 0; k < names_.size(); ++k) to = put(to, scalars[i * names_.size() + k]);
      file_.commit(record);
    }
    vertices_ += points.size();
  }
  std::uint64_t finish() override {
    constexpr std::uint64_t kMostVertices = 0xffffffffu;
    if (vertices_ > kMostVertices)
      throw UsageError(file_.path().string() + ": PLY indices end at 4294967295 and the mesh has " +
                       std::to_string(vertices_) + " vertices; write .csv or .las instead");
    mesh_.read_faces([&](std::span<const MeshFace> faces) {
      for (const MeshFace& f : faces) {
        constexpr std::size_t kFace = 1 + 3 * sizeof(std::uint32_t);
        char* to = put(file_.reserve(kFace), std::uint8_t{3});
        for (const std::uint64_t v : f) to = put(to, static_cast<std::uint32_t>(v));
        file_.commit(kFace);
      }
      faces_ += faces.size();
    });
    const std::string text = header_text();
    file_.patch(0, text.data(), text.size());
    const std::uint64_t size = file_.size();
    file_.finish();
    return size;
  }

 private:
  template <class T>
  static char* put(char* to, T value) {
    std::memcpy(to, &value, sizeof value);
    return to + sizeof value;
  }
  /// The same length for any counts, which are known in the end: spaces of a comment make up for digits.
  std::string header_text() const {
    const std::string vertices = std::to_string(vertices_), faces = std::to_string(faces_);
    std::string text = "ply\nformat binary_little_endian 1.0\n";
    for (const std::string& line : comment_lines(mesh_.header())) text += "comment " + line + "\n";
    constexpr std::size_t kDigits = 40;
    text += "comment Tessera" + std::string(kDigits - vertices.size() - faces.size(), ' ') + "\n";
    text += "element vertex " + vertices + "\n";
    const std::string type = doubles_ ? "double" : "float";
    for (const char* name : {"x", "y", "z"}) text += "property " + type + " " + name + "\n";
    if (colour_)
      for (const char* name : {"red", "green", "blue", "alpha"})
        text += std::string("property uchar ") + name + "\n";
    for (const std::string& name : names_) text += "property double " + name + "\n";
    return text + "element face " + faces + "\nproperty list uchar uint vertex_indices\nend_header\n";
  }

  OutputFile file_;
  MeshReader& mesh_;
  std::vector<std::string> names_;
  bool colour_, doubles_;
  std::uint64_t vertices_ = 0, faces_ = 0;
};

}  // namespace

std::unique_ptr<ScalarFile> create_scalar_csv(const std::filesystem::path& path,
                                              const std::vector<std::string>& names) {
  return std::make_unique<ScalarCsv>(path, names);
}

std::unique_ptr<ScalarFile> create_scalar_points(const std::filesystem::path& path,
                                                 const PointFileHeader& header) {
  return std::make_unique<ScalarPoints>(path, header);
}

std::unique_ptr<ScalarFile> create_scalar_mesh(const std::filesystem::path& path, MeshReader& mesh,
                                               bool colour, const std::vector<std::string>& names) {
  return std::make_unique<ScalarMesh>(path, mesh, colour, names);
}

}  // namespace tessera
