#include "stream/formats/meshes/mesh_writer_base.h"

#include <charconv>

#include "octree/error.h"

namespace tessera {

MeshWriterBase::MeshWriterBase(const std::filesystem::path& path, const MeshHeader& header)
    : header_(header), file_(path) {}

void MeshWriterBase::vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
  if (faces_ > 0) throw ValidationError(file_.path().string() + ": a vertex came after the first face");
  if (rgba.size() != (header_.colour ? positions.size() : 0)) {
    throw ValidationError(file_.path().string() + ": " + std::to_string(positions.size()) +
                          " vertices came with " + std::to_string(rgba.size()) + " colours");
  }
  if (positions.size() > header_.vertices - vertices_) {
    throw ValidationError(file_.path().string() + ": more vertices than the " +
                          std::to_string(header_.vertices) + " announced");
  }
  vertices_ += positions.size();
  write_vertices(positions, rgba);
}

void MeshWriterBase::faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
  if (vertices_ != header_.vertices) {
    throw ValidationError(file_.path().string() + ": faces came after " + std::to_string(vertices_) + " of " +
                          std::to_string(header_.vertices) + " vertices");
  }
  if (faces.size() > header_.faces - faces_) {
    throw ValidationError(file_.path().string() + ": more faces than the " + std::to_string(header_.faces) +
                          " announced");
  }
  if (synthetic.size() != (header_.synthetic ? faces.size() : 0)) {
    throw ValidationError(file_.path().string() + ": " + std::to_string(faces.size()) + " faces came with " +
                          std::to_string(synthetic.size()) + " synthetic flags");
  }
  for (const MeshFace& face : faces) {
    if (face[0] < vertices_ && face[1] < vertices_ && face[2] < vertices_) continue;
    throw ValidationError(file_.path().string() + ": face " +
                          std::to_string(faces_ + static_cast<std::uint64_t>(&face - faces.data())) +
                          " names a vertex beyond the last, " + std::to_string(vertices_));
  }
  faces_ += faces.size();
  write_faces(faces, synthetic);
}

void MeshWriterBase::finish() {
  if (vertices_ != header_.vertices || faces_ != header_.faces) {
    throw ValidationError(file_.path().string() + ": " + std::to_string(vertices_) + " vertices and " +
                          std::to_string(faces_) + " faces were written, " +
                          std::to_string(header_.vertices) + " and " + std::to_string(header_.faces) +
                          " announced");
  }
  write_end();
  file_.finish();
}

std::vector<std::string> comment_lines(const MeshHeader& header) {
  std::vector<std::string> lines = header.comments;
  for (std::string& line : lines) {
    for (char& c : line) {
      if (c == '\n' || c == '\r') c = ' ';
    }
  }
  if (header.shift != Double3{0, 0, 0}) {
    std::string line = "tessera_shift";
    for (const double value : header.shift) {
      char text[32];
      const auto end = std::to_chars(text, text + sizeof text, value).ptr;
      line.append(" ").append(text, end);
    }
    lines.push_back(line);
  }
  return lines;
}

}  // namespace tessera
