#include "kernels/points/scan_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr std::size_t kMinSamples = 48;  ///< fewer tell nothing
constexpr std::size_t kMinOfLine = 8;    ///< samples that tell whether a line is planar
constexpr std::size_t kMinLines = 4;     ///< that tell of a family of lines
/// Distance of the middle of the samples, in radii that hold nine of ten. An object of a desktop scanner lies 3 to 10 away;
/// beyond 3 the grid must agree in its orientation too.
constexpr double kNearShare = 3.0, kFarWithoutGrid = 10.0, kFarWithGrid = 100.0;
/// Root mean square distance from the plane, in steps between neighbours in the grid: a turntable that turns on during a
/// line makes half a step, as does rounding of coordinates.
/// Where samples lie farther off than kNearShare, less: seen from there, steps between neighbours are as wide as relief is high.
constexpr double kMaxRayDeviation = 1.0, kMaxRayDeviationFar = 0.6;
/// Neighbours are nearer to each other than that part of their line is long, or the order of the file is no grid.
constexpr double kMaxOfLine = 0.25;
constexpr double kMaxReversed = 0.1;  ///< share of grid triangles that are seen from the other side
/// A raster in space: its samples are off an even one by less than that, in steps. Of what scanners see only planes come so
/// close, straight ahead and in a narrow view; then directions do as well, since noise of rays is noise of samples.
constexpr double kMaxOffRaster = 0.1, kRatioToRays = 4.0;
constexpr double kMinRayDeviation = 0.05;  ///< of its lines, in steps: less may be what is rounded
/// Of its directions, in steps: narrow views of spheres and planes have less.
constexpr double kMinUneven = 0.25;
constexpr std::int64_t kMinRaster = 8;  ///< rows and columns of it
constexpr double kWidestCamera = 2.0;   ///< 1 / cos 60 degrees: no camera sees a plane farther to its sides

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
  std::int64_t group = 0, index = 0;
  Double3 d{};
};

/// How far the rays of one group lie from a plane through the scanner, and how long their arc is: root mean squares.
struct Flatness {
  double deviation = 0.0, length = 0.0;
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
  double deviation = 0.0, length = 0.0;
  for (const Ray& r : rays) {
    const double off = dot(r.d, axes[0]);
    deviation += off * off;
    length += squared_distance(r.d, sum / n);
  }
  return {std::sqrt(deviation / n), std::sqrt(length / n)};
}

/// What the lines of one family say.
struct Family {
  bool known = false;      ///< enough of them are long enough
  bool coherent = false;   ///< neighbours in a line see neighbouring places
  double deviation = 0.0;  ///< median over the lines, radians
};
Family family_of(std::span<const Ray> rays, double step) {
  std::vector<double> deviation, length;
  for (std::size_t i = 0, end = 0; i < rays.size(); i = end) {
    for (end = i; end < rays.size() && rays[end].group == rays[i].group;) ++end;
    if (end - i < kMinOfLine) continue;
    const Flatness f = flatness_of(rays.subspan(i, end - i));
    deviation.push_back(f.deviation);
    length.push_back(f.length);
  }
  if (deviation.size() < kMinLines) return {};
  return {true, step < kMaxOfLine * middle_of(length), middle_of(deviation)};
}

/// Median angle between rays of neighbouring places in a group; 0 without any.
double step_along(std::span<const Ray> rays) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < rays.size(); ++i)
    if (rays[i].group == rays[i - 1].group && rays[i].index == rays[i - 1].index + 1)
      steps.push_back(norm(rays[i].d - rays[i - 1].d));
  return steps.empty() ? 0.0 : middle_of(steps);
}

/// Share of the grid's triangles that turn the other way than most, as the scanner sees them.
double reversed_share(const std::vector<Ray>& rays) {
  std::map<std::pair<std::int64_t, std::int64_t>, std::size_t> at;
  for (std::size_t i = 0; i < rays.size(); ++i) at.emplace(std::pair{rays[i].group, rays[i].index}, i);
  std::size_t left = 0, right = 0;
  for (const Ray& r : rays) {
    const auto along = at.find({r.group, r.index + 1}), across = at.find({r.group + 1, r.index});
    if (along == at.end() || across == at.end()) continue;
    const double orientation = dot(r.d, cross(rays[along->second].d - r.d, rays[across->second].d - r.d));
    if (orientation > 0.0) ++left;
    if (orientation < 0.0) ++right;
  }
  return left + right == 0 ? 0.0
                           : static_cast<double>(std::min(left, right)) / static_cast<double>(left + right);
}

/// An affine fit over lines and cells, about their middle: p = middle + line * (l - middle line) + cell * (c - middle cell).
struct EvenGrid {
  Double3 middle{}, line{}, cell{};
  double middle_line = 0.0, middle_cell = 0.0;

  Double3 at(const GridSample& s) const {
    return middle + line * (static_cast<double>(s.line) - middle_line) +
           cell * (static_cast<double>(s.cell) - middle_cell);
  }
};
/// \pre samples on at least two lines and two cells, not all on a diagonal; else all steps are zero
template <class Value>
EvenGrid fit_even(std::span<const GridSample> samples, const Value& value) {
  EvenGrid g;
  const auto n = static_cast<double>(samples.size());
  for (const GridSample& s : samples) {
    g.middle_line += static_cast<double>(s.line) / n, g.middle_cell += static_cast<double>(s.cell) / n;
    g.middle = g.middle + value(s) / n;
  }
  double ll = 0.0, lc = 0.0, cc = 0.0;
  Double3 lp{}, cp{};
  for (const GridSample& s : samples) {
    const double l = static_cast<double>(s.line) - g.middle_line,
                 c = static_cast<double>(s.cell) - g.middle_cell;
    const Double3 p = value(s) - g.middle;
    ll += l * l, lc += l * c, cc += c * c;
    lp = lp + p * l, cp = cp + p * c;
  }
  const double det = ll * cc - lc * lc;
  if (!(det > 1e-6 * ll * cc)) return g;
  g.line = (lp * cc - cp * lc) / det;
  g.cell = (cp * ll - lp * lc) / det;
  return g;
}

Double3 perpendicular(const Double3& v, const Double3& axis) {
  return v - axis * dot(v, axis);
}

/// How even the grid is in space, and how even the directions from the scanner to such an even grid are: root mean squares
/// in steps.
struct Raster {
  bool known = false;
  double off = 0.0;
  double uneven = 0.0;
  bool ahead = false;  ///< a camera may look straight at it: even steps on a plane are even on its image
};
Raster raster_of(std::span<const GridSample> samples) {
  constexpr double kMinSine = 0.1;
  std::int64_t low[2] = {samples[0].line, samples[0].cell}, high[2] = {low[0], low[1]};
  for (const GridSample& s : samples) {
    low[0] = std::min(low[0], s.line), high[0] = std::max(high[0], s.line);
    low[1] = std::min(low[1], s.cell), high[1] = std::max(high[1], s.cell);
  }
  if (high[0] - low[0] < kMinRaster || high[1] - low[1] < kMinRaster) return {};
  const EvenGrid even = fit_even(samples, [](const GridSample& s) { return s.p; });
  const auto n = static_cast<double>(samples.size());
  std::array<double, 6> m{};
  for (const GridSample& s : samples) {
    const Double3 e = s.p - even.at(s);
    m[0] += e[0] * e[0] / n, m[1] += e[0] * e[1] / n, m[2] += e[0] * e[2] / n;
    m[3] += e[1] * e[1] / n, m[4] += e[1] * e[2] / n, m[5] += e[2] * e[2] / n;
  }
  Double3 values{};
  std::array<Double3, 3> axes{};
  symmetric_eigen3(m, values, axes);
  const Double3 area_normal = cross(even.line, even.cell);
  if (!(norm(area_normal) > 0.0)) return {};
  const Double3 normal = unit(area_normal);
  // Heights may be anything. Those of a plane are noise, whose direction is too.
  const bool flat =
      std::sqrt(std::max(values[2], 0.0)) < kMaxOffRaster * std::min(norm(even.line), norm(even.cell));
  const Double3 up = flat ? normal : axes[2];
  const Double3 line = perpendicular(even.line, up), cell = perpendicular(even.cell, up);
  if (!(norm(cross(line, cell)) > kMinSine * norm(line) * norm(cell))) return {};
  Raster r;
  r.known = true;
  r.off = std::sqrt(std::max(values[1], 0.0)) / std::min(norm(line), norm(cell));
  const auto direction = [&](const GridSample& s) {
    const Double3 p = even.at(s);
    const double length = norm(p);
    return length > 0.0 ? p / length : p;
  };
  const EvenGrid angular = fit_even(samples, direction);
  const Double3 view = norm(angular.middle) > 0.0 ? unit(angular.middle) : normal;
  const double step =
      std::max(norm(perpendicular(angular.line, view)), norm(perpendicular(angular.cell, view)));
  double uneven = 0.0, farthest = 0.0;
  for (const GridSample& s : samples) {
    const Double3 e = perpendicular(direction(s) - angular.at(s), view);
    uneven += dot(e, e) / n;
    farthest = std::max(farthest, norm(even.at(s)));
  }
  r.uneven = step > 0.0 ? std::sqrt(uneven) / step : 0.0;
  const double height = dot(even.middle, normal), area = dot(area_normal, area_normal);
  const Double3 foot = normal * height - even.middle;
  const double l = even.middle_line + dot(cross(foot, even.cell), area_normal) / area,
               c = even.middle_cell + dot(cross(even.line, foot), area_normal) / area;
  r.ahead = l >= static_cast<double>(low[0]) && l <= static_cast<double>(high[0]) &&
            c >= static_cast<double>(low[1]) && c <= static_cast<double>(high[1]) &&
            farthest <= kWidestCamera * std::fabs(height);
  return r;
}

std::vector<Ray> sorted_rays(std::span<const GridSample> samples, bool by_line) {
  std::vector<Ray> rays;
  for (const GridSample& s : samples)
    if (const double length = norm(s.p); length > 0.0)
      rays.push_back({by_line ? s.line : s.cell, by_line ? s.cell : s.line, s.p / length});
  std::sort(rays.begin(), rays.end(), [](const Ray& a, const Ray& b) {
    return a.group != b.group ? a.group < b.group : a.index != b.index ? a.index < b.index : a.d < b.d;
  });
  const auto same = [](const Ray& a, const Ray& b) { return a.group == b.group && a.index == b.index; };
  rays.erase(std::unique(rays.begin(), rays.end(), same), rays.end());
  return rays;
}

}  // namespace

ScanPose check_scan_pose(std::span<const Double3> spread, std::vector<GridSample> grid, bool filled_in) {
  if (spread.size() < kMinSamples) return ScanPose::kHolds;
  const double distance = distance_in_radii(spread);
  const std::vector<Ray> lines = sorted_rays(grid, true), cells = sorted_rays(grid, false);
  const double along = step_along(lines), across = step_along(cells);
  const Family by_line = family_of(lines, along), by_cell = family_of(cells, across);
  if (!by_line.known && !by_cell.known)
    return distance > (filled_in ? kFarWithoutGrid : kNearShare) ? ScanPose::kFar : ScanPose::kHolds;
  if (distance > kFarWithGrid) return ScanPose::kFar;
  const double maximum =
      (distance > kNearShare ? kMaxRayDeviationFar : kMaxRayDeviation) * std::max(along, across);
  const auto holds = [&](const Family& f) { return f.known && f.coherent && f.deviation <= maximum; };
  if (!holds(by_line) && !holds(by_cell)) return ScanPose::kOffRays;
  if (distance > kNearShare && reversed_share(lines) > kMaxReversed) return ScanPose::kOffRays;
  if (!by_line.known || !by_cell.known) return ScanPose::kHolds;
  const Raster raster = raster_of(grid);
  if (!raster.known || raster.off > kMaxOffRaster) return ScanPose::kHolds;
  const double deviation = std::min(by_line.deviation, by_cell.deviation) / std::max(along, across);
  const bool raster_fits = deviation > std::max(kMinRayDeviation, kRatioToRays * raster.off) ||
                           (!raster.ahead && raster.uneven > std::max(kMinUneven, kRatioToRays * raster.off));
  return raster_fits ? ScanPose::kRaster : ScanPose::kHolds;
}

void EvenSpread::add(const Double3& p) {
  kept_.push_back(p);
  if (kept_.size() < kMax) return;
  for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
  kept_.resize((kept_.size() + 1) / 2);
  every_ *= 2;
}

}  // namespace tessera
