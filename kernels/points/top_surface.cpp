#include "kernels/points/top_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/points/orientation.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr float kLevel = 0.5f;     ///< cosine with up from which a surfel lies level
constexpr float kCovered = 12.0f;  ///< cells below the top from which it is covered,
constexpr double kScenePart = 6;   ///< or where the scene is small, this part of its width across up,
constexpr double kMinCovered = 3;  ///< and at least so many cells
/// Columns of level area from which one patch is wide, and part of all columns.
constexpr double kWideColumns = 16;
constexpr double kWidePart = 16;
/// Share of the level area below other surfaces up to which a scene was seen from above whatever covers it: 0 to 0.28 of
/// landscapes, towns and quarries, 0.3 to 0.9 of objects and rooms.
constexpr double kMaxCovered = 0.3;
/// And below wide ones: 0 to 0.03 of forests, 0.11 of a town with the undersides of its roofs, 0.19 to 0.8 of objects and
/// rooms of enough columns.
constexpr double kMaxRoofed = 0.15;
constexpr std::size_t kTellingColumns = 256;
/// Objects without wide surfaces, as plants, face every way; from above flanks show less.
constexpr double kMinLevel = 0.52;
/// A step of the top between the two sides of a steep surfel says which is free, cells.
constexpr float kStep = 4.0f;
constexpr int kAcross = 2;  ///< columns looked at on each side
/// Weight of what is covered: a tree's ground shows upwards, the underside of an eave does not.
constexpr double kBelowTop = 0.2;
constexpr double kOneSeen = 0.5;  ///< weight of a side that is free where the other one holds no data
constexpr float kNoTop = -std::numeric_limits<float>::infinity();
constexpr std::int64_t kColumnBias = std::int64_t{1} << 31;

std::uint64_t column_key(std::int64_t u, std::int64_t v) {
  return static_cast<std::uint64_t>(v + kColumnBias) << 32 | static_cast<std::uint64_t>(u + kColumnBias);
}

std::int64_t column_of(float along) {
  return static_cast<std::int64_t>(std::floor(along / static_cast<float>(kCoarseCells)));
}

bool lies_level(const JobSurfel& s, const Float3& up) {
  return std::fabs(dot(s.area, up)) > kLevel * norm(s.area);
}

}  // namespace

TopSurface::TopSurface(std::span<const JobSurfel> surfels, const Float3& up,
                       std::span<const std::uint32_t> group)
    : surfels_(surfels), up_(up) {
  // Columns along the lattice where up is one of its axes.
  std::size_t flat = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(up[a]) < std::fabs(up[flat])) flat = a;
  u_ = {};
  u_[flat] = 1.0f;
  u_ = unit(u_ - up * dot(u_, up));
  v_ = cross(up, u_);
  columns_ = tops([](const JobSurfel&) { return true; });
  measure(group);
}

template <class Counts>
std::vector<TopSurface::Column> TopSurface::tops(Counts&& counts) const {
  std::vector<Column> columns;
  columns.reserve(surfels_.size());
  for (std::uint32_t i = 0; i < surfels_.size(); ++i) {
    if (!counts(surfels_[i])) continue;
    const ColumnHeight at = column_height(surfels_[i].position);
    columns.push_back({column_key(at.u, at.v), at.height, i});
  }
  std::sort(columns.begin(), columns.end(), [](const Column& l, const Column& r) {
    return l.key != r.key ? l.key < r.key : l.top != r.top ? l.top > r.top : l.surfel < r.surfel;
  });
  columns.erase(std::unique(columns.begin(), columns.end(),
                            [](const Column& l, const Column& r) { return l.key == r.key; }),
                columns.end());
  columns.shrink_to_fit();
  return columns;
}

double TopSurface::area_below(const std::vector<Column>& columns, float depth) const {
  double area = 0.0;
  for (const JobSurfel& s : surfels_) {
    if (!lies_level(s, up_)) continue;
    const Column* column = find(columns, column_height(s.position));
    if (column == nullptr) continue;
    // Against the plane: slopes rise by more than that within their own column.
    const float along = dot(s.area, up_);
    if (dot(s.area, surfels_[column->surfel].position - s.position) / along > depth)
      area += static_cast<double>(std::fabs(along));
  }
  return area;
}

void TopSurface::measure(std::span<const std::uint32_t> group) {
  const auto group_of = [&](const JobSurfel& s) { return group.empty() ? s.patch : group[s.patch]; };
  std::size_t groups = 0;
  for (const JobSurfel& s : surfels_) groups = std::max<std::size_t>(groups, group_of(s) + std::size_t{1});
  std::vector<double> width(groups, 0.0);
  double all = 0.0, along_up = 0.0, level_area = 0.0;
  for (const JobSurfel& s : surfels_) {
    const auto along = static_cast<double>(std::fabs(dot(s.area, up_)));
    all += static_cast<double>(norm(s.area)), along_up += along;
    if (lies_level(s, up_)) width[group_of(s)] += along, level_area += along;
  }
  if (!(level_area > 0.0)) return;
  level_share_ = along_up / all;
  constexpr double kColumnArea = kCoarseCells * kCoarseCells;
  const auto columns = static_cast<double>(columns_.size());
  const auto depth = static_cast<float>(
      std::clamp(std::sqrt(columns * kColumnArea) / kScenePart, kMinCovered, static_cast<double>(kCovered)));
  const double wide = kColumnArea * std::clamp(columns / kWidePart, 1.0, kWideColumns);
  covered_share_ = area_below(columns_, depth) / level_area;
  roofed_share_ =
      area_below(tops([&](const JobSurfel& s) { return lies_level(s, up_) && width[group_of(s)] >= wide; }),
                 depth) /
      level_area;
}

bool TopSurface::seen_from_above() const {
  return covered_share_ < kMaxCovered ||
         (columns_.size() >= kTellingColumns && roofed_share_ < kMaxRoofed && level_share_ > kMinLevel);
}

TopSurface::ColumnHeight TopSurface::column_height(const Float3& position) const {
  return {column_of(dot(position, u_)), column_of(dot(position, v_)), dot(position, up_)};
}

const TopSurface::Column* TopSurface::find(const std::vector<Column>& columns, const ColumnHeight& at) {
  const std::uint64_t key = column_key(at.u, at.v);
  const auto found = std::lower_bound(columns.begin(), columns.end(), key,
                                      [](const Column& c, std::uint64_t k) { return c.key < k; });
  return found != columns.end() && found->key == key ? &*found : nullptr;
}

float TopSurface::top(const ColumnHeight& at) const {
  const Column* column = find(columns_, at);
  return column != nullptr ? column->top : kNoTop;
}

/// 1 where the front of a steep surfel is free, -1 where its back is, 0 where the tops tell neither.
double TopSurface::steep_side(const JobSurfel& s, const ColumnHeight& at, float across) const {
  const Float3 direction = (s.area - up_ * dot(s.area, up_)) * (1.0f / across);
  for (int k = 1; k <= kAcross; ++k) {
    const Float3 off = direction * static_cast<float>(k * kCoarseCells);
    const ColumnHeight ahead = column_height(s.position + off), behind = column_height(s.position - off);
    const float front = top(ahead), back = top(behind);
    // Nobody looked to where there is no data: then the other side was seen, if one could see over what is there.
    if (front == kNoTop && back == kNoTop) continue;
    if (front == kNoTop || back == kNoTop) {
      if (std::max(front, back) < at.height - kStep) return back == kNoTop ? kOneSeen : -kOneSeen;
      continue;
    }
    if (std::fabs(front - back) > kStep) return front < back ? 1.0 : -1.0;
  }
  return 0.0;
}

std::vector<PatchVote> TopSurface::votes(std::size_t patches, double scale) const {
  std::vector<double> shown(patches, 0.0), hidden(patches, 0.0);
  for (const JobSurfel& s : surfels_) {
    const float area = norm(s.area);
    if (!(area > 0.0f)) continue;
    const float along = dot(s.area, up_) / area;
    const float across = std::sqrt(std::max(0.0f, 1.0f - along * along)) * area;
    const ColumnHeight at = column_height(s.position);
    const double seen = top(at) > at.height + kCovered ? kBelowTop : 1.0;
    double vote = seen * static_cast<double>(along * std::fabs(along));
    if (std::fabs(along) < kLevel)
      vote += static_cast<double>(1.0f - along * along) * steep_side(s, at, across);
    (vote < 0.0 ? hidden : shown)[s.patch] += std::fabs(vote) * s.surfels;
  }
  std::vector<PatchVote> out;
  for (std::uint32_t p = 0; p < patches; ++p) {
    const PatchVote v = {p, static_cast<std::uint32_t>(patches),
                         static_cast<std::int64_t>(std::floor(scale * shown[p] + 0.5)),
                         static_cast<std::int64_t>(std::floor(scale * hidden[p] + 0.5))};
    if (v.same != v.opposite) out.push_back(v);
  }
  return out;
}

}  // namespace tessera
