/// \file stored_points.h
/// Every record of some point files, in order, outliers included.
#pragma once
#include <filesystem>
#include <vector>

#include "stream/points/point_store.h"

namespace tessera::test {

inline std::vector<PointRecord> stored_points(const std::vector<std::filesystem::path>& files) {
  std::vector<PointRecord> points;
  for (const auto& path : files) {
    const PackedFile file(path, kPointFile, sizeof(BrickEntry));
    for (const BrickEntry& brick : file.table<BrickEntry>()) {
      const auto records = file.load<PointRecord>(brick.records());
      points.insert(points.end(), records.begin(), records.end());
    }
  }
  return points;
}

}  // namespace tessera::test
