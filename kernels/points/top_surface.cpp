#include "kernels/points/top_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/points/orientation.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr float kLevel = 0.5f;     ///< cosine with up from which a surfel lies level
constexpr float kCovered = 12.0f;  ///< cells below the top from which it is covered
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

}  // namespace

TopSurface::TopSurface(std::span<const JobSurfel> surfels, const Float3& up) : surfels_(surfels), up_(up) {
  // Columns along the lattice where up is one of its axes.
  std::size_t flat = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(up[a]) < std::fabs(up[flat])) flat = a;
  u_ = {};
  u_[flat] = 1.0f;
  u_ = unit(u_ - up * dot(u_, up));
  v_ = cross(up, u_);
  columns_.reserve(surfels.size());
  for (const JobSurfel& s : surfels) {
    const ColumnHeight at = column_height(s.position);
    columns_.push_back({column_key(at.u, at.v), at.height});
  }
  std::sort(columns_.begin(), columns_.end(),
            [](const Column& l, const Column& r) { return l.key != r.key ? l.key < r.key : l.top > r.top; });
  columns_.erase(std::unique(columns_.begin(), columns_.end(),
                             [](const Column& l, const Column& r) { return l.key == r.key; }),
                 columns_.end());
  columns_.shrink_to_fit();
  double level = 0.0, covered = 0.0;
  for (const JobSurfel& s : surfels) {
    const float area = norm(s.area), along = std::fabs(dot(s.area, up));
    if (!(along > kLevel * area)) continue;
    const ColumnHeight at = column_height(s.position);
    level += static_cast<double>(along);
    if (top(at.u, at.v) > at.height + kCovered) covered += static_cast<double>(along);
  }
  covered_share_ = level > 0.0 ? covered / level : 1.0;
}

TopSurface::ColumnHeight TopSurface::column_height(const Float3& position) const {
  return {column_of(dot(position, u_)), column_of(dot(position, v_)), dot(position, up_)};
}

float TopSurface::top(std::int64_t u, std::int64_t v) const {
  const std::uint64_t key = column_key(u, v);
  const auto found = std::lower_bound(columns_.begin(), columns_.end(), key,
                                      [](const Column& c, std::uint64_t k) { return c.key < k; });
  return found != columns_.end() && found->key == key ? found->top : kNoTop;
}

/// 1 where the front of a steep surfel is free, -1 where its back is, 0 where the tops tell neither.
double TopSurface::steep_side(const JobSurfel& s, const ColumnHeight& at, float across) const {
  const Float3 direction = (s.area - up_ * dot(s.area, up_)) * (1.0f / across);
  for (int k = 1; k <= kAcross; ++k) {
    const Float3 off = direction * static_cast<float>(k * kCoarseCells);
    const ColumnHeight ahead = column_height(s.position + off), behind = column_height(s.position - off);
    const float front = top(ahead.u, ahead.v), back = top(behind.u, behind.v);
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

std::vector<PatchVote> TopSurface::votes(std::size_t groups, double scale) const {
  std::vector<double> shown(groups, 0.0), hidden(groups, 0.0);
  for (const JobSurfel& s : surfels_) {
    const float area = norm(s.area);
    if (!(area > 0.0f)) continue;
    const float along = dot(s.area, up_) / area;
    const float across = std::sqrt(std::max(0.0f, 1.0f - along * along)) * area;
    const ColumnHeight at = column_height(s.position);
    const double seen = top(at.u, at.v) > at.height + kCovered ? kBelowTop : 1.0;
    double vote = seen * static_cast<double>(along * std::fabs(along));
    if (std::fabs(along) < kLevel)
      vote += static_cast<double>(1.0f - along * along) * steep_side(s, at, across);
    (vote < 0.0 ? hidden : shown)[s.patch] += std::fabs(vote) * s.surfels;
  }
  std::vector<PatchVote> out;
  for (std::uint32_t g = 0; g < groups; ++g) {
    const PatchVote v = {g, static_cast<std::uint32_t>(groups),
                         static_cast<std::int64_t>(std::floor(scale * shown[g] + 0.5)),
                         static_cast<std::int64_t>(std::floor(scale * hidden[g] + 0.5))};
    if (v.same != v.opposite) out.push_back(v);
  }
  return out;
}

}  // namespace tessera
