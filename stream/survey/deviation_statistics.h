/// \file deviation_statistics.h
/// What signed distances of many points add up to: moments, exact percentiles, a histogram; of all points and of those in
/// areas seen from above.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/check/fixed_sum.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/points/clip_polygon.h"
#include "stream/survey/point_distances.h"

namespace tessera {

inline constexpr std::array<int, 7> kDeviationPercents = {1, 5, 25, 50, 75, 95, 99};

/// Of the points that have a distance, but for `far`.
struct DeviationSummary {
  std::string name;  ///< of its area; "all"
  std::uint64_t count = 0;
  std::uint64_t far = 0;     ///< have none: nothing of the reference is near enough
  std::uint64_t border = 0;  ///< their nearest place lies where the reference ends
  std::uint64_t within = 0;  ///< the tolerance, either way; 0 without one
  double mean = 0.0, rms = 0.0;
  double deviation = 0.0;  ///< standard deviation, of a sample: by count - 1
  double min = 0.0, max = 0.0;
  Double3 min_at{}, max_at{};  ///< the first of several
  /// kDeviationPercents of the points lie at or below: between two of them by straight line.
  std::array<double, kDeviationPercents.size()> percentiles{};
};

struct DeviationBin {
  double low = 0.0, high = 0.0;  ///< low <= value < high; the outer ones reach to infinity
  std::uint64_t count = 0;
};

/// What figures call points without a distance, and those with the flag of PointDistance::border.
struct DeviationWords {
  const char *none_key, *flag_key;    ///< of JSON and CSV
  const char *none_text, *flag_text;  ///< for people
};
inline constexpr DeviationWords kDeviationWords = {"far", "border", "too far",
                                                   "of the measured beside a border"};

struct DeviationTable {
  DeviationWords words = kDeviationWords;
  std::vector<DeviationSummary> rows;  ///< all points, then the areas in the order of the file
  std::vector<DeviationBin> histogram;
};

class DeviationStatistics {
 public:
  /// \param max_distance  no distance is larger \param tolerance  negative = none
  /// \param areas  GeoJSON polygons, as ClipPolygon reads them; empty = none \throws InputError for what is none
  /// \param memory_bytes  for sorting; the rest goes to `temp`
  DeviationStatistics(double max_distance, double tolerance, const std::filesystem::path& areas,
                      const std::filesystem::path& temp, std::uint64_t memory_bytes);

  /// A point with its distance.
  void add(const Double3& p, const PointDistance& distance);
  std::uint64_t count() const { return groups_.front().row.count; }
  /// The table, once. The order of points makes a difference to min_at and max_at alone. \pre count() > 0
  DeviationTable finish();

 private:
  struct Value {
    double value = 0.0;
    std::uint64_t group = 0;
    bool operator<(const Value& o) const { return group != o.group ? group < o.group : value < o.value; }
  };
  struct Group {
    DeviationSummary row;
    FixedSum sum, squares;
    std::optional<ClipPolygon> area;
  };
  void add_to(std::size_t group, const Double3& p, const PointDistance& distance);
  void plan_bins();
  void count_bin(double value);

  double tolerance_;
  std::vector<Group> groups_;
  ExternalSort<Value> sort_;
  /// Counts by the leading bits of values: a first look, from which the width of bins is chosen.
  std::map<std::int64_t, std::uint64_t> coarse_;
  double bin_ = 0.0;
  std::int64_t first_bin_ = 0;
  std::vector<std::uint64_t> bins_;
};

/// Lines for people. \param tolerance  negative = none
std::string describe(const DeviationTable& table, double tolerance);
/// A row for all points and one for each area.
std::string to_csv(const DeviationTable& table, double tolerance);
std::string histogram_csv(const DeviationTable& table);
Json to_json(const DeviationTable& table, double tolerance);

}  // namespace tessera
