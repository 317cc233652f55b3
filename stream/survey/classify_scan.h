/// \file classify_scan.h
/// Classes for the points of scans seen from above: ground by SMRF (kernels/points/ground_filter.h) over all scans
/// together, the rest by height over it. Files are copied; nothing of them changes but the classes of points.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "stream/files/json.h"
#include "stream/survey/class_writer.h"

namespace tessera {

/// Lengths are in units of the scan; 0 stands for a default in metres.
struct ClassifyOptions {
  double cell = 0.0;       ///< 1 m, up to 8 m where points are so far apart that it would hold less than 6
  double slope = 0.15;     ///< steepest ground
  double window = 0.0;     ///< 18 m: half the width of the widest building
  double threshold = 0.0;  ///< 0.5 m: so far from the surface points of level ground are ground ...
  double scalar = 0.0;     ///< ... and 1.25 m times its slope more
  double pit_slope = 5.0;  ///< what lies deeper below the cells around it than this times a cell is noise
  double noise = 0.0;      ///< 200 m: what is higher over the ground is noise
  bool water = false;      ///< look for it (kernels/points/water_cells.h): class 9 in place of ground
  double water_density = 0.25;  ///< of its points to those of the land beside it, at most
  double water_width = 0.0;     ///< 10 m, of a square that water must hold, at least five cells
  double water_relief = 0.0;    ///< 0.3 m, of level water
  bool ground_only = false;
  bool all_points = false;  ///< withheld and synthetic points and those of noise take part too
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::filesystem::path temp;  ///< folder for scratch files
};

struct ScanToClassify {
  std::filesystem::path input, output;
};

struct ClassifyReport {
  std::vector<ClassifiedScan> scans;
  double cell = 0.0, metres = 0.0;  ///< metres: of a unit of the scans, 0 = they do not say
  std::uint64_t cells = 0, empty = 0;
  ClassifiedScan total() const;  ///< without paths
};

/// Writes one file for every scan, .las or .laz. Bytes hang on scans and options alone. \pre outputs differ, and from inputs
/// \throws InputError as open_scan_set(); EmptyError without any point; UsageError; ResourceError when cap or disk cannot
///   suffice; StoppedError
ClassifyReport classify_scans(const std::vector<ScanToClassify>& scans, const ClassifyOptions& options);

Json to_json(const ClassifyReport& report);

}  // namespace tessera
