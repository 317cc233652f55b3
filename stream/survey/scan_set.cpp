#include "stream/survey/scan_set.h"

#include <algorithm>
#include <string>

#include "octree/error.h"
#include "stream/formats/points/crs.h"

namespace tessera {

namespace {

/// Metres of a unit, 0 = unknown. \throws InputError
double shared_unit(const LasRecords& scan, const LasRecords& first, double metres) {
  const std::string name = scan.file().path().string();
  const Crs& crs = scan.header().info.crs;
  const Crs& other = first.header().info.crs;
  if (crs.geographic)
    throw InputError(name + ": its coordinates are degrees, " + crs.name +
                     "; ground is found by lengths: project the scan first, to its UTM zone for example");
  if (!may_be_same(other, crs))
    throw InputError(name + ": is in " + crs.name + ", " + first.file().path().string() + " in " +
                     other.name + "; scans are worked on together in one system");
  if (crs.height_unit > 0.0 && metres > 0.0 && crs.height_unit != metres)
    throw InputError(name + ": has another unit of heights than the scans before it");
  return crs.height_unit > 0.0 ? crs.height_unit : metres;
}

}  // namespace

ScanSet open_scan_set(const std::vector<std::filesystem::path>& files) {
  ScanSet set;
  constexpr double kInfinite = PointBox::kInfinite;
  double min[2] = {kInfinite, kInfinite}, max[2] = {-kInfinite, -kInfinite};
  bool bounded = true;
  set.scans.reserve(files.size());
  for (const std::filesystem::path& file : files) {
    set.scans.emplace_back(file);
    LasRecords& scan = set.scans.back();
    set.metres = shared_unit(scan, set.scans.front(), set.metres);
    set.points += scan.points();
    if (scan.points() == 0) continue;
    const PointFileInfo& info = scan.header().info;
    bounded = bounded && info.has_bounds;
    for (std::size_t a = 0; a < 2; ++a) {
      min[a] = std::min(min[a], info.declared_min[a]);
      max[a] = std::max(max[a], info.declared_max[a]);
    }
  }
  if (set.points == 0)
    throw EmptyError(files.front().string() + (files.size() > 1 ? " and the others" : "") +
                     ": there are no points");
  if (bounded) set.width = max[0] - min[0], set.height = max[1] - min[1];
  return set;
}

}  // namespace tessera
