/// \file mesh_volume.h
/// Cut and fill between a mesh and a base (another mesh, a level, a raster of heights, what the toe of each polygon spans), seen along
/// z: exact integrals over prisms, in bounded memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "kernels/mesh/prism_volume.h"
#include "stream/files/json.h"
#include "stream/volume/height_noise.h"

namespace tessera {

enum class VolumeBase {
  kLevel,
  kMesh,
  kRaster,   ///< a GeoTIFF of heights
  kToe,      ///< each polygon spans its own by a triangulation
  kToePlane  ///< or by the plane that fits best
};

struct VolumeOptions {
  VolumeBase kind = VolumeBase::kLevel;
  std::filesystem::path base;   ///< of a mesh or raster
  double level = 0.0;           ///< z
  std::filesystem::path areas;  ///< GeoJSON polygons in the coordinates of the mesh; empty = everywhere
  double toe_gap = 0.0;         ///< longest piece of a toe line without mesh that it runs straight over
  /// Distance that the meshes are proven to keep from the surfaces that they stand for, scan units; negative = unknown.
  double tolerance = -1.0, base_tolerance = -1.0;
  HeightNoise noise, base_noise;
  std::filesystem::path map;  ///< GeoTIFF of the mesh less its base to write; empty = none
  double cell = 0.0;          ///< edge of its cells
  std::string crs;            ///< of the mesh, for what GDAL reads and writes; empty = unknown
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::filesystem::path temp;  ///< folder for scratch files
};

/// Of one area.
struct AreaVolume {
  std::string name;
  double plan_area = 0.0;  ///< of the area; of the whole: what the mesh covers
  CutFill volume;          ///< over what both surfaces cover; fill where the mesh lies above its base
  double surface = 0.0;    ///< area of the mesh's faces there, not of their shadows
  double base_surface = 0.0;
  /// By how much net volume may be wrong, if each surface is displaced by its tolerance to one side everywhere: the sums of
  /// tolerance times surface, to first order in the tolerance. None where a tolerance is unknown.
  std::optional<double> bound;
  /// By how much noise in the heights of points moves it in 5 of 100 surveys at most; none where no noise is given.
  std::optional<double> noise_bound;
  std::optional<double> outline, outline_uncovered;  ///< of a toe: lengths
};

struct MeshVolumes {
  std::vector<AreaVolume> areas;  ///< in the order of the file
  double downward = 0.0;  ///< plan area of the mesh's faces that show down: its volumes count negative
  std::string warnings;   ///< lines for the user
};

/// Sums hang on the meshes alone, not on memory or threads.
/// \throws InputError, for a polygon without a toe line too; UsageError for a base that is closed, over which no height is one;
///   ResourceError when the cap cannot suffice or a program is missing, StoppedError
MeshVolumes measure_volumes(const std::filesystem::path& mesh, const VolumeOptions& options);

/// The distance that the report beside a mesh proves for it; none without one, or where it is of other bytes.
std::optional<double> proven_tolerance(const std::filesystem::path& mesh);

std::string describe(const MeshVolumes& volumes);
std::string to_csv(const MeshVolumes& volumes);
Json to_json(const MeshVolumes& volumes);

}  // namespace tessera
