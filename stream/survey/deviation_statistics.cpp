#include "stream/survey/deviation_statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "stream/files/json.h"

namespace tessera {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr int kCoarseBits = 46;  ///< sign, exponent and six bits: steps of less than two percent
constexpr double kBinsPerQuartiles = 20.0;
constexpr double kTailShare = 0.001;  ///< beyond it on either side all values are in one bin
constexpr std::int64_t kMostBins = 1000;

/// Ascends with the value.
std::int64_t coarse_key(double value) {
  const std::int64_t bits = std::bit_cast<std::int64_t>(std::abs(value)) >> kCoarseBits;
  return std::signbit(value) ? -bits : bits;
}

double coarse_value(std::int64_t key) {
  const double size = std::bit_cast<double>(std::abs(key) << kCoarseBits);
  return key < 0 ? -size : size;
}

/// 1, 2 or 5 times a power of ten, at least x.
double round_up_125(double x) {
  const double power = std::pow(10.0, std::floor(std::log10(x)));
  for (const double step : {1.0, 2.0, 5.0})
    if (x <= step * power) return step * power;
  return 10.0 * power;
}

std::string shortest(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : std::string();
}

}  // namespace

DeviationStatistics::DeviationStatistics(double max_distance, double tolerance,
                                         const std::filesystem::path& areas,
                                         const std::filesystem::path& temp, std::uint64_t memory_bytes)
    : tolerance_(tolerance), sort_(temp, memory_bytes) {
  groups_.emplace_back();
  groups_.front().row.name = "all";
  if (!areas.empty())
    for (const Json& polygon : parse_json(ClipPolygon::text_of_file(areas))) {
      Group group;
      group.row.name = std::to_string(groups_.size());
      group.area = ClipPolygon::from_text(dump_json(Json::array({polygon})));
      groups_.push_back(std::move(group));
    }
  for (Group& g : groups_) g.sum = FixedSum(max_distance), g.squares = FixedSum(max_distance * max_distance);
}

void DeviationStatistics::add_to(std::size_t group, const Double3& p, const PointDistance& distance) {
  Group& g = groups_[group];
  const double d = distance.value;
  if (std::isnan(d)) {
    ++g.row.far;
    return;
  }
  if (g.row.count == 0 || d < g.row.min) g.row.min = d, g.row.min_at = p;
  if (g.row.count == 0 || d > g.row.max) g.row.max = d, g.row.max_at = p;
  ++g.row.count;
  g.row.border += distance.border ? 1 : 0;
  g.row.within += std::abs(d) <= tolerance_ ? 1 : 0;
  g.sum.add(d), g.squares.add(d * d);
  sort_.add({d, group});
}

void DeviationStatistics::add(const Double3& p, const PointDistance& distance) {
  add_to(0, p, distance);
  if (!std::isnan(distance.value)) ++coarse_[coarse_key(distance.value)];
  for (std::size_t k = 1; k < groups_.size(); ++k) {
    const ClipPolygon& area = *groups_[k].area;
    if (p[0] < area.min()[0] || p[0] > area.max()[0] || p[1] < area.min()[1] || p[1] > area.max()[1])
      continue;
    if (area.holds(p[0], p[1])) add_to(k, p, distance);
  }
}

/// Bins that show the middle half well, whatever a few outliers do.
void DeviationStatistics::plan_bins() {
  const double count = static_cast<double>(groups_.front().row.count);
  const auto at = [&](double share) {
    double below = 0.0;
    for (const auto& [key, n] : coarse_) {
      below += static_cast<double>(n);
      if (below >= share * count) return coarse_value(key);
    }
    return coarse_value(coarse_.rbegin()->first);
  };
  const double low = at(kTailShare), high = at(1.0 - kTailShare);
  double width = (at(0.75) - at(0.25)) / kBinsPerQuartiles;
  width = std::max({width, (high - low) / static_cast<double>(kMostBins),
                    0x1p-40 * std::max(std::abs(low), std::abs(high))});
  bin_ = width > 0.0 ? round_up_125(width) : 1.0;
  first_bin_ = static_cast<std::int64_t>(std::floor(low / bin_)) - 1;
  const auto last = static_cast<std::int64_t>(std::floor(high / bin_)) + 1;
  bins_.assign(static_cast<std::size_t>(last - first_bin_ + 1), 0);
}

void DeviationStatistics::count_bin(double value) {
  const double bin = std::floor(value / bin_) - static_cast<double>(first_bin_);
  const double end = static_cast<double>(bins_.size() - 1);
  ++bins_[static_cast<std::size_t>(std::clamp(bin, 0.0, end))];
}

DeviationTable DeviationStatistics::finish() {
  plan_bins();
  // Of a percentile: the rank, from 0, and how far behind it.
  const auto rank = [&](const DeviationSummary& row, std::size_t k) {
    return static_cast<double>(row.count - 1) * kDeviationPercents[k] / 100.0;
  };
  std::uint64_t group = 0, i = 0;
  sort_.drain([&](std::span<const Value> some) {
    for (const Value& v : some) {
      if (v.group != group) group = v.group, i = 0;
      if (group == 0) count_bin(v.value);
      DeviationSummary& row = groups_[group].row;
      for (std::size_t k = 0; k < kDeviationPercents.size(); ++k) {
        const double at = rank(row, k), below = std::floor(at);
        if (static_cast<double>(i) == below) row.percentiles[k] = v.value;
        if (static_cast<double>(i) == below + 1.0)
          row.percentiles[k] += (at - below) * (v.value - row.percentiles[k]);
      }
      ++i;
    }
  });
  DeviationTable table;
  for (Group& g : groups_) {
    DeviationSummary& row = g.row;
    if (row.count > 0) {
      const double n = static_cast<double>(row.count), square = g.squares.value() / n;
      row.mean = g.sum.value() / n;
      row.rms = std::sqrt(square);
      if (row.count > 1)
        row.deviation = std::sqrt(std::max(0.0, square - row.mean * row.mean) * n / (n - 1.0));
    }
    table.rows.push_back(row);
  }
  for (std::size_t k = 0; k < bins_.size(); ++k) {
    const auto bin = first_bin_ + static_cast<std::int64_t>(k);
    table.histogram.push_back({k == 0 ? -kUnbounded : static_cast<double>(bin) * bin_,
                               k + 1 == bins_.size() ? kUnbounded : static_cast<double>(bin + 1) * bin_,
                               bins_[k]});
  }
  return table;
}

std::string describe(const DeviationTable& table, double tolerance) {
  const DeviationSummary& all = table.rows.front();
  const auto place = [](const Double3& p) {
    return fmt::format("{:.10g} {:.10g} {:.10g}", p[0], p[1], p[2]);
  };
  std::string text = fmt::format("points: {} measured, {} {}, {} {}\n", all.count, all.far,
                                 table.words.none_text, all.border, table.words.flag_text);
  text +=
      fmt::format("mean {:.6g}, rms {:.6g}, standard deviation {:.6g}\n", all.mean, all.rms, all.deviation);
  for (std::size_t k = 0; k < kDeviationPercents.size(); ++k)
    text += fmt::format("{}{}% {:.6g}", k == 0 ? "percentiles: " : ", ", kDeviationPercents[k],
                        all.percentiles[k]);
  text += fmt::format("\nlowest {:.6g} at {}, highest {:.6g} at {}\n", all.min, place(all.min_at), all.max,
                      place(all.max_at));
  if (tolerance >= 0.0)
    text += fmt::format("within {:g}: {:.4f} %\n", tolerance,
                        100.0 * static_cast<double>(all.within) / static_cast<double>(all.count));
  if (table.rows.size() < 2) return text;
  text +=
      fmt::format("{:<10} {:>12} {:>10} {:>12} {:>12} {:>12} {:>12} {:>12} {:>12} {:>9}\n", "area", "points",
                  table.words.none_key, "mean", "rms", "st.dev.", "median", "min", "max", "within %");
  for (const DeviationSummary& r : table.rows) {
    const std::string within =
        tolerance >= 0.0 && r.count > 0
            ? fmt::format("{:.3f}", 100.0 * static_cast<double>(r.within) / static_cast<double>(r.count))
            : "";
    text += fmt::format(
        "{:<10} {:>12} {:>10} {:>12.6g} {:>12.6g} {:>12.6g} {:>12.6g} {:>12.6g} {:>12.6g} {:>9}\n", r.name,
        r.count, r.far, r.mean, r.rms, r.deviation, r.percentiles[3], r.min, r.max, within);
  }
  return text;
}

std::string to_csv(const DeviationTable& table, double tolerance) {
  std::string text = fmt::format("area,points,{},{},mean,rms,standard_deviation", table.words.none_key,
                                 table.words.flag_key);
  for (const int percent : kDeviationPercents) text += fmt::format(",p{}", percent);
  text += ",min,min_x,min_y,min_z,max,max_x,max_y,max_z,within\n";
  for (const DeviationSummary& r : table.rows) {
    text += fmt::format("{},{},{},{},{},{},{}", r.name, r.count, r.far, r.border, r.mean, r.rms, r.deviation);
    for (const double p : r.percentiles) text += fmt::format(",{}", p);
    text +=
        fmt::format(",{},{},{},{},{},{},{},{},{}\n", r.min, r.min_at[0], r.min_at[1], r.min_at[2], r.max,
                    r.max_at[0], r.max_at[1], r.max_at[2], tolerance >= 0.0 ? std::to_string(r.within) : "");
  }
  return text;
}

std::string histogram_csv(const DeviationTable& table) {
  std::string text = "low,high,points\n";
  for (const DeviationBin& b : table.histogram)
    text += fmt::format("{},{},{}\n", shortest(b.low), shortest(b.high), b.count);
  return text;
}

Json to_json(const DeviationTable& table, double tolerance) {
  Json rows = Json::array();
  for (const DeviationSummary& r : table.rows) {
    Json row = {{"area", r.name},
                {"points", r.count},
                {table.words.none_key, r.far},
                {table.words.flag_key, r.border}};
    if (r.count > 0) {
      row.update({{"mean", r.mean},
                  {"rms", r.rms},
                  {"standard_deviation", r.deviation},
                  {"min", {{"value", r.min}, {"at", r.min_at}}},
                  {"max", {{"value", r.max}, {"at", r.max_at}}}});
      for (std::size_t k = 0; k < kDeviationPercents.size(); ++k)
        row["percentiles"][std::to_string(kDeviationPercents[k])] = r.percentiles[k];
      if (tolerance >= 0.0)
        row["share_within"] = static_cast<double>(r.within) / static_cast<double>(r.count);
    }
    rows.push_back(row);
  }
  Json histogram = Json::array();
  for (const DeviationBin& b : table.histogram)
    histogram.push_back({{"low", std::isfinite(b.low) ? Json(b.low) : Json()},
                         {"high", std::isfinite(b.high) ? Json(b.high) : Json()},
                         {"points", b.count}});
  return {{"areas", rows}, {"histogram", histogram}};
}

}  // namespace tessera
