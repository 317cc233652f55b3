#include "stream/survey/line_clearance.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

#include "kernels/survey/line_smoothing.h"

namespace tessera {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 15;  ///< distances written at a time

}  // namespace

LineClearance::LineClearance(double reach, double spacing, std::filesystem::path temp,
                             std::uint64_t memory_bytes)
    : reach_(reach),
      cell_(4.0 * std::max(reach, spacing)),
      scratch_(std::move(temp)),
      segments_(scratch_, memory_bytes / 2),
      distances_(scratch_, memory_bytes / 2) {}

bool LineClearance::Segment::operator<(const Segment& o) const {
  if (row != o.row) return row < o.row;
  return column != o.column ? column < o.column : number < o.number;
}

void LineClearance::add(std::span<const Double2> points, bool closed) {
  const std::size_t n = points.size(), count = n < 2 ? 0 : closed ? n : n - 1;
  for (std::size_t k = 0; k < count; ++k) {
    Segment s;
    s.number = numbers_++, s.line = lines_, s.from = points[k], s.to = points[(k + 1) % n];
    std::array<std::int64_t, 2> low{}, high{};
    for (std::size_t c = 0; c < 2; ++c) {
      // Half the reach on either side: two segments that are nearer than it share a cell.
      low[c] = static_cast<std::int64_t>(std::floor((std::min(s.from[c], s.to[c]) - 0.51 * reach_) / cell_));
      high[c] = static_cast<std::int64_t>(std::floor((std::max(s.from[c], s.to[c]) + 0.51 * reach_) / cell_));
    }
    for (s.row = low[1]; s.row <= high[1]; ++s.row)
      for (s.column = low[0]; s.column <= high[0]; ++s.column) segments_.add(s);
  }
  ++lines_;
}

void LineClearance::measure_cell(const std::vector<Segment>& cell) {
  std::vector<double> nearest(cell.size(), reach_);
  const auto apart = [&](const Segment& a, const Segment& b) {
    for (std::size_t c = 0; c < 2; ++c)
      if (std::max(a.from[c], a.to[c]) + reach_ < std::min(b.from[c], b.to[c]) ||
          std::max(b.from[c], b.to[c]) + reach_ < std::min(a.from[c], a.to[c]))
        return true;
    return false;
  };
  for (std::size_t i = 0; i < cell.size(); ++i)
    for (std::size_t j = i + 1; j < cell.size(); ++j) {
      if (cell[i].line == cell[j].line || apart(cell[i], cell[j])) continue;
      const double d = segment_distance(cell[i].from, cell[i].to, cell[j].from, cell[j].to);
      nearest[i] = std::min(nearest[i], d), nearest[j] = std::min(nearest[j], d);
    }
  for (std::size_t i = 0; i < cell.size(); ++i)
    if (nearest[i] < reach_) distances_.add({cell[i].number, nearest[i]});
}

void LineClearance::measure(const std::function<void()>& check_stop) {
  std::vector<Segment> cell;
  segments_.drain([&](std::span<const Segment> batch) {
    if (check_stop) check_stop();
    for (const Segment& s : batch) {
      if (!cell.empty() && (cell.front().row != s.row || cell.front().column != s.column))
        measure_cell(cell), cell.clear();
      cell.push_back(s);
    }
  });
  measure_cell(cell);
  file_ = std::make_unique<SpillFile>(scratch_);
  std::vector<double> run;
  std::uint64_t at = 0;
  const auto put = [&](double distance) {
    run.push_back(distance), ++at;
    if (run.size() == kBatch) file_->append(run.data(), run.size() * sizeof run[0]), run.clear();
  };
  distances_.drain([&](std::span<const Distance> batch) {
    if (check_stop) check_stop();
    for (const Distance& d : batch) {
      if (d.number < at) continue;  // another cell told a smaller one
      while (at < d.number) put(reach_);
      put(d.distance);
    }
  });
  while (at < numbers_) put(reach_);
  if (!run.empty()) file_->append(run.data(), run.size() * sizeof run[0]);
  read_ = 0;
}

std::vector<double> LineClearance::next(std::size_t segments) {
  assert(file_ && read_ + segments <= numbers_);
  std::vector<double> out(segments);
  if (segments > 0) file_->read_at(read_ * sizeof(double), out.data(), segments * sizeof(double));
  read_ += segments;
  return out;
}

}  // namespace tessera
