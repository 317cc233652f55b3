/// \file scan_deviation.h
/// How far the points of scans, or the vertices of a mesh, lie from a reference mesh, as files and figures. Neither needs to
/// fit in memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/render/value_cells.h"
#include "stream/survey/deviation_statistics.h"

namespace tessera {

/// Lengths are in units of the scan.
struct ScanDeviationOptions {
  double max_distance =
      0.0;  ///< what lies farther off has no deviation; 0 = a tenth of the reference's diagonal
  double tolerance = -1.0;  ///< negative = none
  double colour_scale =
      0.0;           ///< points get colours by deviation, this one's at the ends; 0 = they keep theirs
  bool map = false;  ///< whether the report gets a map for a picture
  std::filesystem::path areas;       ///< GeoJSON polygons in the coordinates of the scan; empty = none
  std::vector<std::string> columns;  ///< of text scans
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::filesystem::path temp;  ///< folder for scratch files
};

struct ScanDeviationReport {
  DeviationTable table;
  double max_distance = 0.0;
  std::uint64_t points = 0;    ///< measured and far
  std::uint64_t left_out = 0;  ///< beside them: not finite, withheld, placeholders, missing
  std::uint64_t searched = 0;  ///< lay so far off that faces were looked for patch by patch
  std::uint64_t reference_faces = 0;
  std::uint64_t bytes = 0;  ///< of the output
  std::vector<std::string> notices;
  ValueMap map;           ///< with ScanDeviationOptions::map: of the points not far beyond the reference
  std::string crs;        ///< name of the points' coordinate system; empty = unknown
  bool vertices = false;  ///< of a mesh were measured
};

/// Writes points in the order of the inputs. A LAS or LAZ file that is written as .las or .laz keeps all that it has, and its
/// records get extra bytes. Bytes and figures hang on inputs and options alone.
/// \param inputs  one mesh, or scans
/// \param outputs  none; one for all points, .las, .laz, .ply or .csv; or one for each of several LAS and LAZ files
/// \throws InputError; UsageError; EmptyError where no point is near the reference; ResourceError when cap or disk cannot
///   suffice; StoppedError
ScanDeviationReport measure_deviation(const std::vector<std::filesystem::path>& inputs,
                                      const std::filesystem::path& reference,
                                      const ScanDeviationOptions& options,
                                      const std::vector<std::filesystem::path>& outputs);

Json to_json(const ScanDeviationReport& report, double tolerance);

}  // namespace tessera
