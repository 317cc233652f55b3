/// \file mesh_reader_check.h
/// What must hold for any bytes given to a reader of meshes, for the fuzz targets and the mutation test.
#pragma once
#include <memory>
#include <string_view>

#include "stream/formats/meshes/mesh_reader_base.h"
#include "tests/fuzz/point_reader_check.h"

namespace tessera::fuzz {

using OpenMesh = std::unique_ptr<MeshReader> (*)(ReadFile, const MeshReadOptions&);

struct MeshReading {
  bool failed = false;  ///< ended with an InputError
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
  std::uint64_t highest = 0;  ///< index of any face, plus one
  bool operator==(const MeshReading&) const = default;
};

inline MeshReading read_mesh(OpenMesh open, const std::filesystem::path& path, bool keep_bad,
                             bool faces_first) {
  MeshReading r;
  try {
    MeshReadOptions options;
    options.keep_bad_faces = keep_bad;
    const auto mesh = open(ReadFile(path), options);
    const bool colour = mesh->header().colour;
    const auto read_faces = [&] {
      mesh->read_faces([&](std::span<const MeshFace> faces) {
        require(!faces.empty() && faces.size() <= 16384, "batch of faces");
        r.faces += faces.size();
        for (const MeshFace& face : faces) {
          for (const std::uint64_t v : face) r.highest = std::max(r.highest, v + 1);
        }
      });
    };
    if (faces_first) read_faces();
    mesh->read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
      require(!positions.empty() && positions.size() <= 16384, "batch of vertices");
      require(rgba.size() == (colour ? positions.size() : 0), "colours");
      r.vertices += positions.size();
    });
    if (!faces_first) read_faces();
    if (!keep_bad) require(r.highest <= r.vertices, "indices below the number of vertices");
    if (!mesh->shared_vertices()) require(r.vertices == 3 * r.faces, "three vertices per face");
  } catch (const InputError& e) {
    require(std::string_view(e.what()).find(path.string()) == 0, "the message names the file first");
    r = {};
    r.failed = true;
  }
  return r;
}

/// Opening and reading give a sound mesh or an InputError, nothing else, in either order of reading. Returns
/// true if it was a mesh. \throws std::logic_error naming what does not hold
inline bool check_mesh_reader(OpenMesh open, std::string_view bytes) {
  const MemoryFile file(bytes);
  const MeshReading first = read_mesh(open, file.path(), false, false);
  require(first == read_mesh(open, file.path(), false, true), "the order of reading does not matter");
  const MeshReading all = read_mesh(open, file.path(), true, false);
  require(first.failed || all == first, "keeping bad faces changes nothing for sound meshes");
  return !first.failed;
}

}  // namespace tessera::fuzz
