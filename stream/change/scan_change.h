/// \file scan_change.h
/// How far one scan lies from another at its core points (M3C2), as files and figures. Neither needs to fit in memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/change/core_change.h"
#include "stream/change/change_cells.h"
#include "stream/files/json.h"
#include "stream/runtime/progress.h"
#include "stream/survey/deviation_statistics.h"

namespace tessera {

/// Lengths are in units of the scans.
struct ScanChangeOptions {
  double normal_scale = 0.0;      ///< diameter; 0 = 20 spacings, those of the sparser scan
  double projection_scale = 0.0;  ///< diameter; 0 = 10 spacings
  double max_depth = 0.0;         ///< of the cylinder to either side; 0 = five times the projection scale
  double core_spacing = 0.0;      ///< one core point in a cell of this size; 0 = all points
  double registration_error = 0.0;
  bool median = false;
  NormalRule normals;
  bool all_fields = false;  ///< counts, spreads and normals too
  double colour_scale =
      0.0;  ///< points get colours by distance, this one's at the ends; 0 = they keep theirs
  std::filesystem::path raster;      ///< GeoTIFF of mean distances; empty = none
  double cell = 0.0;                 ///< of figures by area and of the raster; 0 = the projection scale
  std::filesystem::path areas;       ///< GeoJSON polygons in the coordinates of the scans; empty = none
  std::vector<std::string> columns;  ///< of text scans
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::filesystem::path temp;  ///< folder for scratch files
  std::string progress = "auto";
  ProgressSink progress_sink;
};

struct ScanChangeReport {
  ChangeRule rule;                  ///< with the scales that were taken
  std::array<double, 2> spacing{};  ///< of old and new; 0 where they are too few to tell
  DeviationTable table;             ///< of distances; flagged are the significant ones
  ChangeArea area;
  std::array<std::uint64_t, 2> points{}, left_out{};  ///< not finite, withheld, placeholders, missing
  std::uint64_t core_points = 0, without_normal = 0;
  std::uint64_t with_noise = 0;  ///< their level of detection is known
  std::uint64_t bytes = 0;       ///< of the output
  std::vector<std::string> notices;
};

/// Writes the core points in the order of the inputs. A LAS or LAZ file that is written as .las or .laz keeps all that it has,
/// and its records get extra bytes. Bytes and figures hang on inputs and options alone.
/// \param before  scans whose points are core points  \param after  scans that are compared with them
/// \param outputs  none; one for all points, .las, .laz, .ply or .csv; or one for each of several LAS and LAZ files
/// \throws InputError; UsageError for scales below the spacing; EmptyError where the scans do not overlap; ResourceError when cap
///   or disk cannot suffice; StoppedError
ScanChangeReport measure_change(const std::vector<std::filesystem::path>& before,
                                const std::vector<std::filesystem::path>& after,
                                const ScanChangeOptions& options,
                                const std::vector<std::filesystem::path>& outputs);

std::string describe(const ScanChangeReport& report);
Json to_json(const ScanChangeReport& report);

}  // namespace tessera
