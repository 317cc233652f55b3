/// \file scan_set.h
/// LAS and LAZ files that are worked on together: in one system, with lengths.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "stream/formats/points/las_records.h"

namespace tessera {

struct ScanSet {
  std::vector<LasRecords> scans;
  std::uint64_t points = 0;
  double metres = 0.0;               ///< of a unit of heights; 0 = they do not say
  double width = 0.0, height = 0.0;  ///< of all, as the headers say; 0 = one does not
};

/// \throws InputError for a file that is neither LAS nor LAZ, in degrees, or in another system or unit than those before it;
///   EmptyError where none has a point
ScanSet open_scan_set(const std::vector<std::filesystem::path>& files);

}  // namespace tessera
