#include "kernels/points/scan_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr std::size_t kLeastSamples = 48;  ///< fewer tell nothing
constexpr std::size_t kLeastOfLine = 8;    ///< samples that tell whether a line is planar
constexpr std::size_t kLeastLines = 4;     ///< that tell of a family of lines
/// Distance of the middle of the samples, in radii that hold nine of ten. An object of a desktop scanner lies 3 to 10 away;
/// beyond 3 the grid must agree in its orientation too.
constexpr double kNearShare = 3.0, kFarWithoutGrid = 10.0, kFarWithGrid = 100.0;
/// Root mean square distance from the plane, in steps between neighbours in the grid: a turntable that turns on during a
/// line makes half a step, as does rounding of coordinates.
/// Where samples lie farther off than kNearShare, less: seen from there, steps between neighbours are as wide as relief is high.
constexpr double kMostBent = 1.0, kMostBentFar = 0.6;
/// Neighbours are nearer to each other than that part of their line is long, or the order of the file is no grid.
constexpr double kMostOfLine = 0.25;
constexpr double kMostTurned = 0.1;  ///< share of grid triangles that are seen from the other side

double middle_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// How far off the samples lie: the distance of their middle in radii that hold nine of ten.
double distance_in_radii(std::span<const Double3> samples) {
  Double3 middle{};
  std::vector<double> values(samples.size());
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t i = 0; i < samples.size(); ++i) values[i] = samples[i][a];
    middle[a] = middle_of(values);
  }
  for (std::size_t i = 0; i < samples.size(); ++i) values[i] = norm(samples[i] - middle);
  const auto ninth = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 9 / 10);
  std::nth_element(values.begin(), ninth, values.end());
  return *ninth > 0.0 ? norm(middle) / *ninth : 0.0;
}

/// A sample as a direction from the scanner; `group` is its line, or its cell when columns and rows change roles.
struct Ray {
  std::int64_t group = 0, place = 0;
  Double3 d{};
};

/// How far the rays of one group lie from a plane through the scanner, and how long their arc is: root mean squares.
struct Flatness {
  double bent = 0.0, length = 0.0;
};
Flatness flatness_of(std::span<const Ray> rays) {
  std::array<double, 6> m{};
  Double3 sum{};
  for (const Ray& r : rays) {
    const Double3& d = r.d;
    m[0] += d[0] * d[0], m[1] += d[0] * d[1], m[2] += d[0] * d[2];
    m[3] += d[1] * d[1], m[4] += d[1] * d[2], m[5] += d[2] * d[2];
    sum = sum + d;
  }
  Double3 values{};
  std::array<Double3, 3> axes{};
  symmetric_eigen3(m, values, axes);  // ascending: axes[0] is the plane's normal
  const auto n = static_cast<double>(rays.size());
  double bent = 0.0, length = 0.0;
  for (const Ray& r : rays) {
    const double off = dot(r.d, axes[0]);
    bent += off * off;
    length += squared_distance(r.d, sum / n);
  }
  return {std::sqrt(bent / n), std::sqrt(length / n)};
}

/// What the lines of one family say.
struct Family {
  bool told = false;      ///< enough of them are long enough
  bool coherent = false;  ///< neighbours in a line see neighbouring places
  double bent = 0.0;      ///< median over the lines, radians
};
Family family_of(std::span<const Ray> rays, double step) {
  std::vector<double> bent, length;
  for (std::size_t i = 0, end = 0; i < rays.size(); i = end) {
    for (end = i; end < rays.size() && rays[end].group == rays[i].group;) ++end;
    if (end - i < kLeastOfLine) continue;
    const Flatness f = flatness_of(rays.subspan(i, end - i));
    bent.push_back(f.bent);
    length.push_back(f.length);
  }
  if (bent.size() < kLeastLines) return {};
  return {true, step < kMostOfLine * middle_of(length), middle_of(bent)};
}

/// Median angle between rays of neighbouring places in a group; 0 without any.
double step_along(std::span<const Ray> rays) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < rays.size(); ++i)
    if (rays[i].group == rays[i - 1].group && rays[i].place == rays[i - 1].place + 1)
      steps.push_back(norm(rays[i].d - rays[i - 1].d));
  return steps.empty() ? 0.0 : middle_of(steps);
}

/// Share of the grid's triangles that turn the other way than most, as the scanner sees them.
double turned_share(const std::vector<Ray>& rays) {
  std::map<std::pair<std::int64_t, std::int64_t>, std::size_t> at;
  for (std::size_t i = 0; i < rays.size(); ++i) at.emplace(std::pair{rays[i].group, rays[i].place}, i);
  std::size_t left = 0, right = 0;
  for (const Ray& r : rays) {
    const auto along = at.find({r.group, r.place + 1}), across = at.find({r.group + 1, r.place});
    if (along == at.end() || across == at.end()) continue;
    const double turn = dot(r.d, cross(rays[along->second].d - r.d, rays[across->second].d - r.d));
    if (turn > 0.0) ++left;
    if (turn < 0.0) ++right;
  }
  return left + right == 0 ? 0.0
                           : static_cast<double>(std::min(left, right)) / static_cast<double>(left + right);
}

std::vector<Ray> sorted_rays(std::span<const GridSample> samples, bool by_line) {
  std::vector<Ray> rays;
  for (const GridSample& s : samples)
    if (const double length = norm(s.p); length > 0.0)
      rays.push_back({by_line ? s.line : s.cell, by_line ? s.cell : s.line, s.p / length});
  std::sort(rays.begin(), rays.end(), [](const Ray& a, const Ray& b) {
    return a.group != b.group ? a.group < b.group : a.place != b.place ? a.place < b.place : a.d < b.d;
  });
  const auto same = [](const Ray& a, const Ray& b) { return a.group == b.group && a.place == b.place; };
  rays.erase(std::unique(rays.begin(), rays.end(), same), rays.end());
  return rays;
}

}  // namespace

ScanPose check_scan_pose(std::span<const Double3> spread, std::vector<GridSample> grid, bool filled_in) {
  if (spread.size() < kLeastSamples) return ScanPose::kHolds;
  const double distance = distance_in_radii(spread);
  const std::vector<Ray> lines = sorted_rays(grid, true), cells = sorted_rays(grid, false);
  const double along = step_along(lines), across = step_along(cells);
  const Family by_line = family_of(lines, along), by_cell = family_of(cells, across);
  if (!by_line.told && !by_cell.told)
    return distance > (filled_in ? kFarWithoutGrid : kNearShare) ? ScanPose::kFar : ScanPose::kHolds;
  if (distance > kFarWithGrid) return ScanPose::kFar;
  const double most = (distance > kNearShare ? kMostBentFar : kMostBent) * std::max(along, across);
  const auto holds = [&](const Family& f) { return f.told && f.coherent && f.bent <= most; };
  if (!holds(by_line) && !holds(by_cell)) return ScanPose::kOffRays;
  return distance > kNearShare && turned_share(lines) > kMostTurned ? ScanPose::kOffRays : ScanPose::kHolds;
}

void EvenSpread::add(const Double3& p) {
  kept_.push_back(p);
  if (kept_.size() < kMost) return;
  for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
  kept_.resize((kept_.size() + 1) / 2);
  every_ *= 2;
}

}  // namespace tessera
