/// \file point_colours.h
/// What colour a point gets: its own, or one that tells its intensity, class or height (--colour).
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"
#include "stream/points/plan.h"
#include "stream/points/point_inputs.h"

namespace tessera {

enum class ColourBy : std::uint8_t { kRgb, kIntensity, kClass, kHeight, kNone };
/// \pre  a word that the option allows
ColourBy colour_by(const std::string& word);
/// Whether points get any. \throws UsageError  where intensity or class is asked for and no input tells it
bool has_point_colours(ColourBy by, const PointInputs& inputs);

/// How many points have which intensity, by its square root: 256 numbers, whatever the scanner's range.
class IntensityHistogram {
 public:
  void add(const PointChunk& chunk);
  const std::array<std::uint64_t, 256>& counts() const { return counts_; }
  void merge(const std::vector<std::uint64_t>& counts);
  /// From the darkest to the brightest but two in a hundred at either end; the second is larger.
  std::array<double, 2> range() const;

 private:
  std::array<std::uint64_t, 256> counts_{};
};

/// \param z  heights of the points in quanta  \param rgba  one a point; 0 = unknown
void colour_points(ColourBy by, const Plan& plan, const PointChunk& chunk, const std::vector<double>& z,
                   std::vector<std::uint32_t>& rgba);

}  // namespace tessera
