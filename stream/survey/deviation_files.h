/// \file deviation_files.h
/// Points with their deviations, as files: a table, points or a mesh with a scalar `deviation`. All are written as OutputFile
/// writes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/point_writer.h"

namespace tessera {

inline constexpr const char* kDeviationName = "deviation";

class DeviationFile {
 public:
  virtual ~DeviationFile() = default;
  /// Points in order, a deviation each, NaN = none. Points that are not finite are left out of all but meshes.
  virtual void add(const PointChunk& points, std::span<const double> deviation) = 0;
  /// Gives it its name. Returns its size.
  virtual std::uint64_t finish() = 0;
};

/// Rows of x, y, z, deviation: numbers as short as they come back exactly, nothing for a deviation of NaN.
std::unique_ptr<DeviationFile> create_deviation_csv(const std::filesystem::path& path);
/// .ply, .las, .laz. \param header  its scalar is set by this
std::unique_ptr<DeviationFile> create_deviation_points(const std::filesystem::path& path,
                                                       PointFileHeader header);
/// PLY with the faces of `mesh`, which outlives it and whose vertices are the points; their properties are x, y, z, colour
/// where chunks have one, and deviation.
/// \param colour  every chunk has one
std::unique_ptr<DeviationFile> create_deviation_mesh(const std::filesystem::path& path, MeshReader& mesh,
                                                     bool colour);

}  // namespace tessera
