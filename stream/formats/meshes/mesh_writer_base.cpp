#include "stream/formats/meshes/mesh_writer_base.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "octree/error.h"
#include "stream/runtime/numbers.h"

namespace tessera {

namespace {

/// One in so many faces without area is more than a mesh with a few slivers: floats cannot hold it.
constexpr std::uint64_t kManyFaces = 1000;

/// The position that a reader gets.
Double3 read_back(const Float3& local, const Double3& origin) {
  return {origin[0] + double{local[0]}, origin[1] + double{local[1]}, origin[2] + double{local[2]}};
}

}  // namespace

MeshWriterBase::MeshWriterBase(const std::filesystem::path& path, const MeshHeader& header, bool floats,
                               bool joins)
    : header_(header), file_(path), floats_(floats), joins_(joins) {
  if (!joins_ && !may_lose()) return;
  check_ = std::make_unique<RoundingCheck>(
      path.has_parent_path() ? path.parent_path() : ".",
      [this](const Double3& p) { return read_back(local(p), header_.origin); });
}

Double3 MeshWriterBase::moved_by_rounding(std::span<const Double3> positions) const {
  Double3 moved = {0, 0, 0};
  if (!floats_) return moved;
  for (const Double3& p : positions) {
    const Double3 q = read_back(local(p), header_.origin);
    for (std::size_t k = 0; k < 3; ++k) {
      const double by = std::fabs(q[k] - p[k]);  // NaN where the position is none
      if (by > moved[k]) moved[k] = by;
    }
  }
  return moved;
}

std::size_t MeshWriterBase::find_beyond(std::span<const MeshFace> faces) const {
  const auto beyond = std::find_if(faces.begin(), faces.end(), [&](const MeshFace& face) {
    return std::max({face[0], face[1], face[2]}) >= header_.vertices;
  });
  return static_cast<std::size_t>(beyond - faces.begin());
}

void MeshWriterBase::finish_rounding() {
  if (check_) rounding_ = check_->finish();
  if (!joins_) rounding_.joined_vertices = 0;
  if (!may_lose()) rounding_.merged_vertices = 0;
  rounding_.largest = std::sqrt(moved_[0] * moved_[0] + moved_[1] * moved_[1] + moved_[2] * moved_[2]);
  check_.reset();
  const auto advice = [&] {
    return file_.path().string() +
           ": floats of 32 bits cannot hold this mesh: they move its vertices by up to " +
           number_text(rounding_.largest);
  };
  if (!std::isfinite(rounding_.largest)) throw ValidationError(advice() + "; write doubles (.ply, .obj)");
  if (kManyFaces * rounding_.flattened_faces > faces_)
    throw ValidationError(advice() + ", which leaves " + std::to_string(rounding_.flattened_faces) + " of " +
                          std::to_string(faces_) + " faces without area; write doubles (.ply, .obj)");
}

void MeshWriterBase::accept_vertices(std::span<const Double3> positions, std::size_t colours,
                                     const Double3& moved) {
  if (faces_ > 0) throw ValidationError(file_.path().string() + ": a vertex came after the first face");
  if (colours != (header_.colour ? positions.size() : 0)) {
    throw ValidationError(file_.path().string() + ": " + std::to_string(positions.size()) +
                          " vertices came with " + std::to_string(colours) + " colours");
  }
  if (positions.size() > header_.vertices - vertices_) {
    throw ValidationError(file_.path().string() + ": more vertices than the " +
                          std::to_string(header_.vertices) + " announced");
  }
  vertices_ += positions.size();
  for (std::size_t k = 0; k < 3; ++k) moved_[k] = std::max(moved_[k], moved[k]);
  if (floats_ && check_) check_->vertices(positions);
}

void MeshWriterBase::vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
  accept_vertices(positions, rgba.size(), moved_by_rounding(positions));
  write_vertices(positions, rgba);
}

void MeshWriterBase::accept_faces(std::span<const MeshFace> faces, std::size_t flags, std::size_t beyond) {
  if (vertices_ != header_.vertices) {
    throw ValidationError(file_.path().string() + ": faces came after " + std::to_string(vertices_) + " of " +
                          std::to_string(header_.vertices) + " vertices");
  }
  if (faces.size() > header_.faces - faces_) {
    throw ValidationError(file_.path().string() + ": more faces than the " + std::to_string(header_.faces) +
                          " announced");
  }
  if (flags != (header_.synthetic ? faces.size() : 0)) {
    throw ValidationError(file_.path().string() + ": " + std::to_string(faces.size()) + " faces came with " +
                          std::to_string(flags) + " synthetic flags");
  }
  if (beyond < faces.size()) {
    throw ValidationError(file_.path().string() + ": face " + std::to_string(faces_ + beyond) +
                          " names a vertex beyond the last, " + std::to_string(vertices_));
  }
  faces_ += faces.size();
  if (check_ && may_lose()) check_->faces(faces);
}

void MeshWriterBase::faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
  accept_faces(faces, synthetic.size(), find_beyond(faces));
  write_faces(faces, synthetic);
}

void MeshWriterBase::finish() {
  if (vertices_ != header_.vertices || faces_ != header_.faces) {
    throw ValidationError(file_.path().string() + ": " + std::to_string(vertices_) + " vertices and " +
                          std::to_string(faces_) + " faces were written, " +
                          std::to_string(header_.vertices) + " and " + std::to_string(header_.faces) +
                          " announced");
  }
  finish_rounding();
  write_end();
  file_.finish();
}

std::string triple_line(const char* name, const Double3& values) {
  std::string line = name;
  for (const double value : values) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value).ptr;
    line.append(" ").append(text, end);
  }
  return line;
}

std::vector<std::string> comment_lines(const MeshHeader& header) {
  std::vector<std::string> lines = header.comments;
  for (std::string& line : lines) {
    for (char& c : line) {
      if (c == '\n' || c == '\r') c = ' ';
    }
  }
  if (header.shift != Double3{0, 0, 0}) lines.push_back(triple_line("tessera_shift", header.shift));
  return lines;
}

}  // namespace tessera
