/// \file scalar_files.h
/// Points with numbers that were measured at them, as files: a table, points or a mesh with scalars. All are written as
/// OutputFile writes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/point_writer.h"

namespace tessera {

class ScalarFile {
 public:
  virtual ~ScalarFile() = default;
  /// Points in order with their scalars, those of the first point first; NaN = none. Points that are not finite are left out of
  /// all but meshes.
  virtual void add(const PointChunk& points, std::span<const double> scalars) = 0;
  /// Gives it its name. Returns its size.
  virtual std::uint64_t finish() = 0;
};

/// Rows of x, y, z and the scalars: numbers as short as they come back exactly, nothing for NaN.
std::unique_ptr<ScalarFile> create_scalar_csv(const std::filesystem::path& path,
                                              const std::vector<std::string>& names);
/// .ply, .las, .laz. \param header  with the names of the scalars
std::unique_ptr<ScalarFile> create_scalar_points(const std::filesystem::path& path,
                                                 const PointFileHeader& header);
/// PLY with the faces of `mesh`, which outlives it and whose vertices are the points; their properties are x, y, z, colour
/// where chunks have one, and the scalars.
/// \param colour  every chunk has one
std::unique_ptr<ScalarFile> create_scalar_mesh(const std::filesystem::path& path, MeshReader& mesh,
                                               bool colour, const std::vector<std::string>& names);

}  // namespace tessera
