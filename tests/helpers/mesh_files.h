/// \file mesh_files.h
/// Meshes as tests see them: read whole, written from memory.
#pragma once
#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"

namespace tessera::test {

struct WholeMesh {
  MeshHeader header;
  std::string format;
  std::vector<Double3> points;
  std::vector<std::uint32_t> rgba;
  std::vector<MeshFace> faces;
};

/// Reads faces before vertices too, since readers promise any order.
inline WholeMesh read_whole(const std::filesystem::path& path, const MeshReadOptions& options = {}) {
  const auto reader = open_mesh_file(path, options);
  WholeMesh mesh;
  const auto collect = [&](std::span<const MeshFace> faces) {
    mesh.faces.insert(mesh.faces.end(), faces.begin(), faces.end());
  };
  reader->read_faces(collect);
  reader->read_vertices([&](std::span<const Double3> points, std::span<const std::uint32_t> rgba) {
    mesh.points.insert(mesh.points.end(), points.begin(), points.end());
    mesh.rgba.insert(mesh.rgba.end(), rgba.begin(), rgba.end());
  });
  const std::vector<MeshFace> first = std::move(mesh.faces);
  mesh.faces.clear();
  reader->read_faces(collect);
  if (mesh.faces != first) throw std::logic_error(path.string() + ": a second reading gave other faces");
  mesh.header = reader->header();
  mesh.format = reader->format();
  return mesh;
}

/// In batches that do not divide anything evenly.
inline void write_whole(const std::filesystem::path& path, const WholeMesh& mesh) {
  const auto writer = create_mesh_file(path, mesh.header);
  constexpr std::size_t kBatch = 70001;
  for (std::size_t i = 0; i < mesh.points.size(); i += kBatch) {
    const std::size_t n = std::min(kBatch, mesh.points.size() - i);
    writer->vertices({mesh.points.data() + i, n},
                     {mesh.rgba.data() + (mesh.header.colour ? i : 0), mesh.header.colour ? n : 0});
  }
  for (std::size_t i = 0; i < mesh.faces.size(); i += kBatch) {
    writer->faces({mesh.faces.data() + i, std::min(kBatch, mesh.faces.size() - i)});
  }
  writer->finish();
}

/// A sheet of side x side squares, two faces each, its vertices row by row at point(column, row).
/// \param backwards  vertices and faces from the last to the first
template <class Point>
void write_sheet(const std::filesystem::path& path, int side, const Point& point, bool backwards = false) {
  WholeMesh mesh;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) mesh.points.push_back(point(i, j));
  const auto at = [&](int i, int j) {
    const auto v = static_cast<std::uint64_t>(j * (side + 1) + i);
    return backwards ? mesh.points.size() - 1 - v : v;
  };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  if (backwards) {
    std::reverse(mesh.points.begin(), mesh.points.end());
    std::reverse(mesh.faces.begin(), mesh.faces.end());
  }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(path, mesh);
}

}  // namespace tessera::test
