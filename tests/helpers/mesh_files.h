/// \file mesh_files.h
/// Meshes as tests see them: read whole, written from memory.
#pragma once
#include <filesystem>
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

}  // namespace tessera::test
