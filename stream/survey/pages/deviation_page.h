/// \file deviation_page.h
/// The page of `deviate`: figures, verdict, histogram, pictures in the colours of deviations.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "stream/page/survey_page.h"
#include "stream/survey/scan_deviation.h"

namespace tessera {

/// What the command was told, beside the report.
struct DeviationPageFacts {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path reference, areas;
  double tolerance = -1.0;         ///< negative = none
  double share = 1.0;              ///< of the points that must lie within
  double colour_scale = 0.0;       ///< end of the scale; 0 = the tolerance, else the 1st and 99th percentile
  std::uint64_t memory_bytes = 0;  ///< cap on the peak resident memory of the process
  std::filesystem::path temp;
};

/// Whether so large a share of the measured points lies within the tolerance. \pre a tolerance
bool passes(const DeviationSummary& all, double share);

/// Draws the map of the report; what cannot be drawn is told in the page.
/// \throws StoppedError
SurveyPage deviation_page(const ScanDeviationReport& report, const DeviationPageFacts& facts);

}  // namespace tessera
