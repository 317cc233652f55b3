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
/// Of fewer columns a clearing and its trees have no wide surface over another, and ground in nearly all; animals and rooms have.
constexpr std::size_t kFewColumns = 32;
constexpr double kMaxRoofedFew = 0.06;
constexpr double kMinGroundFew = 0.8;
/// Objects without wide surfaces, as plants, face every way; from above flanks show less.
constexpr double kMinLevel = 0.52;
/// Share of the columns that hold ground, of a clearing and its trees seen from the ground.
constexpr double kMinGround = 0.5;
/// A step of the top between the two sides of a steep surfel says which is free, cells.
constexpr float kStep = 4.0f;
constexpr int kAcross = 2;  ///< columns looked at on each side
/// Weight of what is covered: a tree's ground shows upwards, the underside of an eave does not.
constexpr double kBelowTop = 0.2;
constexpr double kOneSeen = 0.5;  ///< weight of a side that is free where the other one holds no data
constexpr float kNoTop = -std::numeric_limits<float>::infinity();
constexpr std::int64_t kColumnBias = std::int64_t{1} << 31;
constexpr double kColumnArea = kCoarseCells * kCoarseCells;
constexpr std::size_t kMergeAt = 1 << 16;  ///< columns, while surfels are added

std::uint64_t column_key(std::int64_t u, std::int64_t v) {
  return static_cast<std::uint64_t>(v + kColumnBias) << 32 | static_cast<std::uint64_t>(u + kColumnBias);
}

std::int64_t column_of(float along) {
  return static_cast<std::int64_t>(std::floor(along / static_cast<float>(kCoarseCells)));
}

bool lies_level(const JobSurfel& s, const Float3& up) {
  return std::fabs(dot(s.area, up)) > kLevel * norm(s.area);
}

/// Level area of every group of a batch, along up.
std::vector<double> level_areas(std::span<const JobSurfel> surfels, std::span<const std::uint32_t> group,
                                const Float3& up) {
  std::vector<double> areas;
  for (const JobSurfel& s : surfels) {
    if (!lies_level(s, up)) continue;
    const std::size_t g = group.empty() ? s.patch : group[s.patch];
    if (g >= areas.size()) areas.resize(g + 1, 0.0);
    areas[g] += static_cast<double>(std::fabs(dot(s.area, up)));
  }
  return areas;
}

/// Area along up of the level surfels whose planes pass so far below the top of their column.
double area_below(std::span<const JobSurfel> surfels, const TopColumns& columns, float depth) {
  double area = 0.0;
  for (const JobSurfel& s : surfels) {
    if (!lies_level(s, columns.up())) continue;
    const TopColumns::Column* column = columns.find(s.position);
    if (column == nullptr) continue;
    // Against the plane: slopes rise by more than that within their own column.
    const float along = dot(s.area, columns.up());
    if (dot(s.area, column->position - s.position) / along > depth)
      area += static_cast<double>(std::fabs(along));
  }
  return area;
}

/// 1 where the front of a steep surfel is free, -1 where its back is, 0 where the tops tell neither.
double steep_side(const JobSurfel& s, const TopColumns& columns, float across) {
  const Float3& up = columns.up();
  const float height = dot(s.position, up);
  const Float3 direction = (s.area - up * dot(s.area, up)) * (1.0f / across);
  for (int k = 1; k <= kAcross; ++k) {
    const Float3 off = direction * static_cast<float>(k * kCoarseCells);
    const float front = columns.top(s.position + off), back = columns.top(s.position - off);
    // Nobody looked to where there is no data: then the other side was seen, if one could see over what is there.
    if (front == kNoTop && back == kNoTop) continue;
    if (front == kNoTop || back == kNoTop) {
      if (std::max(front, back) < height - kStep) return back == kNoTop ? kOneSeen : -kOneSeen;
      continue;
    }
    if (std::fabs(front - back) > kStep) return front < back ? 1.0 : -1.0;
  }
  return 0.0;
}

}  // namespace

TopColumns::TopColumns(const Float3& up) : up_(up), merge_at_(kMergeAt) {
  // Columns along the lattice where up is one of its axes.
  std::size_t flat = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(up[a]) < std::fabs(up[flat])) flat = a;
  u_ = {};
  u_[flat] = 1.0f;
  u_ = unit(u_ - up * dot(u_, up));
  v_ = cross(up, u_);
}

TopColumns::TopColumns(const Float3& up, std::vector<Column> columns) : TopColumns(up) {
  columns_ = std::move(columns);
}

template <class Counts>
void TopColumns::add(std::span<const JobSurfel> surfels, Counts&& counts) {
  for (const JobSurfel& s : surfels) {
    if (!counts(s)) continue;
    columns_.push_back(column_at(s.position));
    if (columns_.size() >= merge_at_) {
      merge();
      merge_at_ = columns_.size() + columns_.size() / 4 + kMergeAt;
    }
  }
}

void TopColumns::finish() {
  merge();
  columns_.shrink_to_fit();
}

void TopColumns::merge() {
  std::stable_sort(columns_.begin(), columns_.end(), [](const Column& l, const Column& r) {
    return l.key != r.key ? l.key < r.key : l.top > r.top;
  });
  columns_.erase(std::unique(columns_.begin(), columns_.end(),
                             [](const Column& l, const Column& r) { return l.key == r.key; }),
                 columns_.end());
}

TopColumns::Column TopColumns::column_at(const Float3& position) const {
  return {column_key(column_of(dot(position, u_)), column_of(dot(position, v_))), dot(position, up_),
          position};
}

const TopColumns::Column* TopColumns::find(const Float3& position) const {
  const std::uint64_t key = column_key(column_of(dot(position, u_)), column_of(dot(position, v_)));
  const auto found = std::lower_bound(columns_.begin(), columns_.end(), key,
                                      [](const Column& c, std::uint64_t k) { return c.key < k; });
  return found != columns_.end() && found->key == key ? &*found : nullptr;
}

float TopColumns::top(const Float3& position) const {
  const Column* column = find(position);
  return column != nullptr ? column->top : kNoTop;
}

TopSurface::TopSurface(const Float3& up, const SurfelBatches& batches) : columns_(up) {
  double all = 0.0, along_up = 0.0, level_area = 0.0;
  batches([&](std::span<const JobSurfel> surfels, std::span<const std::uint32_t>) {
    columns_.add(surfels, [](const JobSurfel&) { return true; });
    for (const JobSurfel& s : surfels) {
      const auto along = static_cast<double>(std::fabs(dot(s.area, up)));
      all += static_cast<double>(norm(s.area)), along_up += along;
      if (lies_level(s, up)) level_area += along;
    }
  });
  columns_.finish();
  if (!(level_area > 0.0)) return;
  level_share_ = along_up / all;
  const auto columns = static_cast<double>(columns_.columns().size());
  const auto depth = static_cast<float>(
      std::clamp(std::sqrt(columns * kColumnArea) / kScenePart, kMinCovered, static_cast<double>(kCovered)));
  const double wide = kColumnArea * std::clamp(columns / kWidePart, 1.0, kWideColumns);
  TopColumns roofs(up);
  batches([&](std::span<const JobSurfel> surfels, std::span<const std::uint32_t> group) {
    const std::vector<double> areas = level_areas(surfels, group, up);
    roofs.add(surfels, [&](const JobSurfel& s) {
      return lies_level(s, up) && areas[group.empty() ? s.patch : group[s.patch]] >= wide;
    });
  });
  roofs.finish();
  ground_share_ = static_cast<double>(roofs.columns().size()) / columns;
  double covered = 0.0, roofed = 0.0;
  batches([&](std::span<const JobSurfel> surfels, std::span<const std::uint32_t>) {
    covered += area_below(surfels, columns_, depth);
    roofed += area_below(surfels, roofs, depth);
  });
  covered_share_ = covered / level_area, roofed_share_ = roofed / level_area;
}

TopSurface::TopSurface(std::span<const JobSurfel> surfels, const Float3& up,
                       std::span<const std::uint32_t> group)
    : TopSurface(up, [&](const SurfelBatch& visit) { visit(surfels, group); }) {}

bool TopSurface::seen_from_above() const {
  if (covered_share_ < kMaxCovered) return true;
  const std::size_t columns = columns_.columns().size();
  if (columns < kTellingColumns)
    return columns >= kFewColumns && roofed_share_ < kMaxRoofedFew && ground_share_ > kMinGroundFew;
  return roofed_share_ < kMaxRoofed && (level_share_ > kMinLevel || ground_share_ > kMinGround);
}

std::vector<PatchVote> vote_by_top(std::span<const JobSurfel> surfels, const TopColumns& columns,
                                   std::size_t patches, double scale) {
  std::vector<double> shown(patches, 0.0), hidden(patches, 0.0);
  for (const JobSurfel& s : surfels) {
    const float area = norm(s.area);
    if (!(area > 0.0f)) continue;
    const float along = dot(s.area, columns.up()) / area;
    const float across = std::sqrt(std::max(0.0f, 1.0f - along * along)) * area;
    const double seen = columns.top(s.position) > dot(s.position, columns.up()) + kCovered ? kBelowTop : 1.0;
    double vote = seen * static_cast<double>(along * std::fabs(along));
    if (std::fabs(along) < kLevel)
      vote += static_cast<double>(1.0f - along * along) * steep_side(s, columns, across);
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
