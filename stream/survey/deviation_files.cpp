#include "stream/survey/deviation_files.h"

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

class DeviationCsv : public DeviationFile {
 public:
  explicit DeviationCsv(const std::filesystem::path& path) : file_(path) {
    file_.append(std::string("x,y,z,") + kDeviationName + "\n");
  }
  void add(const PointChunk& points, std::span<const double> deviation) override {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!std::isfinite(points.x[i]) || !std::isfinite(points.y[i]) || !std::isfinite(points.z[i])) continue;
      constexpr std::size_t kRow = 100;
      char* const row = file_.reserve(kRow);
      char* to = row;
      to = put_text(to, points.x[i], ',');
      to = put_text(to, points.y[i], ',');
      to = put_text(to, points.z[i], ',');
      to = put_text(to, deviation[i], '\n');
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
};

class DeviationPoints : public DeviationFile {
 public:
  DeviationPoints(const std::filesystem::path& path, const PointFileHeader& header)
      : attributes_(header.attributes),
        encoder_(make_point_encoder(path, header)),
        writer_(create_point_file(path, header)) {}
  void add(const PointChunk& points, std::span<const double> deviation) override {
    chunk_ = points;
    fill_missing(chunk_, attributes_);
    encoder_->encode(chunk_, {}, deviation, encoded_);
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

class DeviationMesh : public DeviationFile {
 public:
  DeviationMesh(const std::filesystem::path& path, MeshReader& mesh, bool colour)
      : file_(path), mesh_(mesh), colour_(colour), doubles_(mesh.header().double_positions) {
    file_.append(header_text());
  }
  void add(const PointChunk& points, std::span<const double> deviation) override {
    const std::size_t record = (doubles_ ? 24u : 12u) + (colour_ ? 4u : 0u) + 8u;
    for (std::size_t i = 0; i < points.size(); ++i) {
      char* to = file_.reserve(record);
      for (const double v : {points.x[i], points.y[i], points.z[i]})
        to = doubles_ ? put(to, v) : put(to, static_cast<float>(v));
      if (colour_) to = put(to, points.rgba[i]);
      put(to, deviation[i]);
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
    return text + "property double " + kDeviationName + "\nelement face " + faces +
           "\nproperty list uchar uint vertex_indices\nend_header\n";
  }

  OutputFile file_;
  MeshReader& mesh_;
  bool colour_, doubles_;
  std::uint64_t vertices_ = 0, faces_ = 0;
};

}  // namespace

std::unique_ptr<DeviationFile> create_deviation_csv(const std::filesystem::path& path) {
  return std::make_unique<DeviationCsv>(path);
}

std::unique_ptr<DeviationFile> create_deviation_points(const std::filesystem::path& path,
                                                       PointFileHeader header) {
  header.scalar = kDeviationName;
  return std::make_unique<DeviationPoints>(path, header);
}

std::unique_ptr<DeviationFile> create_deviation_mesh(const std::filesystem::path& path, MeshReader& mesh,
                                                     bool colour) {
  return std::make_unique<DeviationMesh>(path, mesh, colour);
}

}  // namespace tessera
