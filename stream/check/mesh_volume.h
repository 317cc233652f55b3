/// \file mesh_volume.h
/// Cut and fill between a mesh and another mesh or a level, seen along z: exact integrals over prisms, in bounded memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "kernels/mesh/prism_volume.h"
#include "stream/files/json.h"

namespace tessera {

struct VolumeOptions {
  std::filesystem::path base;   ///< a mesh; empty = `level`
  double level = 0.0;           ///< z
  std::filesystem::path areas;  ///< GeoJSON polygons in the coordinates of the mesh; empty = everywhere
  /// Distance that the meshes are proven to keep from the surfaces that they stand for, scan units; negative = unknown.
  double tolerance = -1.0, base_tolerance = -1.0;
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
};

struct MeshVolumes {
  std::vector<AreaVolume> areas;  ///< in the order of the file
  double downward = 0.0;  ///< plan area of the mesh's faces that show down: its volumes count negative
};

/// Sums hang on the meshes alone, not on memory or threads.
/// \throws InputError; UsageError for a base that is closed, over which no height is one; ResourceError when the cap cannot
///   suffice, StoppedError
MeshVolumes measure_volumes(const std::filesystem::path& mesh, const VolumeOptions& options);

/// The distance that the report beside a mesh proves for it; none without one, or where it is of other bytes.
std::optional<double> proven_tolerance(const std::filesystem::path& mesh);

std::string describe(const MeshVolumes& volumes);
std::string to_csv(const MeshVolumes& volumes);
Json to_json(const MeshVolumes& volumes);

}  // namespace tessera
