/// \file forecast_list.h
/// The stages of a forecast while it is composed (forecast_composer.cpp).
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "stream/points/reconstruct_options.h"
#include "stream/stages/reconstruct/forecast.h"

namespace tessera {

/// Memory of a stage.
struct ForecastMemory {
  std::uint64_t task = 0;
  std::uint64_t finish = 0;
  std::uint64_t sure = 0;  ///< of the larger
};

class ForecastList {
 public:
  explicit ForecastList(int threads) : threads_(threads) {}

  /// \param processor_us  microseconds of one core \param moved_bytes  read and written
  void add(std::string stage, std::uint64_t tasks, const ForecastMemory& memory, std::uint64_t disk,
           std::uint64_t files, double processor_us, double moved_bytes);
  /// In the order of the job; what has nothing to do, as rounds of decimation that nobody needs, is told with what its end
  /// reserves.
  std::vector<StageForecast> in_order_of_the_run(const ReconstructOptions& options) const;

 private:
  int threads_;
  std::vector<StageForecast> stages_;
};

}  // namespace tessera
