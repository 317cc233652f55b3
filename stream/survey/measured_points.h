/// \file measured_points.h
/// The points that a deviation or a raster is asked of, in their order, as often as they are needed: scans of any format, a
/// LAS or LAZ file record by record, or the vertices of a mesh.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/las_records.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

class MeasuredPoints {
 public:
  virtual ~MeasuredPoints() = default;
  /// All points in order; those that take no part have a coordinate that is no number. Each pass gives the same.
  /// \throws as the readers do; StoppedError
  virtual void read(const std::function<void(const PointChunk&)>& sink) = 0;
  /// Sentences for the user; complete after the first pass.
  virtual std::vector<std::string> notices() const { return {}; }

  PointAttributes attributes;      ///< arrays of chunks that an output may hold
  Crs crs;                         ///< unknown where none is named
  Double3 shift = {0, 0, 0};       ///< to be added to positions
  std::uint64_t points_about = 0;  ///< of a pass, by headers, else by the size of the file; of scans alone
  std::uint64_t left_out = 0;      ///< withheld, placeholders, missing; after the first pass
};

/// \param window  so many slices of a file wait in memory at most, kSliceMemory each; >= 1
/// \throws InputError as open_point_file(), for degrees, and for scans of different systems
std::unique_ptr<MeasuredPoints> open_measured_scans(const std::vector<std::filesystem::path>& files,
                                                    const std::vector<std::string>& columns,
                                                    std::size_t window);
/// Of points read, and of a decoder at work.
inline constexpr std::uint64_t kSliceMemory = std::uint64_t{16} << 20;
/// Every record is a point, those marked withheld too, which take no part. \pre `scans` outlive it
/// \throws InputError for degrees, and for scans of different systems
std::unique_ptr<MeasuredPoints> open_measured_records(std::span<const LasRecords> scans);
/// Its vertices. \pre `mesh` outlives it
std::unique_ptr<MeasuredPoints> open_measured_vertices(MeshReader& mesh);

/// Position of a record; no number where it is marked withheld.
Double3 measured_position(const LasRecords& scan, const char* record);

}  // namespace tessera
