#include "kernels/edit/edit_regions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "octree/error.h"
#include "octree/lists.h"

namespace tessera {
namespace {

using Faces = std::span<const std::array<std::uint32_t, 3>>;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

std::uint32_t nearest_vertex(std::span<const Double3> position, const Double3& p) {
  std::uint32_t best = 0;
  double least = kInfinite;
  for (std::uint32_t v = 0; v < position.size(); ++v)
    if (const double d = squared_distance(position[v], p); d < least) least = d, best = v;
  return best;
}

struct Way {
  std::uint32_t to;
  double length;
};

/// Edges, and across each edge of two faces the way from corner to corner when both are unfolded into a plane.
Lists<Way> ways(std::span<const Double3> position, Faces faces) {
  struct Side {
    std::uint32_t low, high, corner;
    bool operator<(const Side& o) const {
      return low != o.low ? low < o.low : high != o.high ? high < o.high : corner < o.corner;
    }
  };
  std::vector<Side> sides;
  sides.reserve(3 * faces.size());
  for (const auto& f : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = f[(k + 1) % 3], b = f[(k + 2) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), f[k]});
    }
  std::sort(sides.begin(), sides.end());
  return make_lists<Way>(position.size(), [&](const auto& put) {
    const auto both = [&](std::uint32_t a, std::uint32_t b, double length) {
      put(a, Way{b, length});
      put(b, Way{a, length});
    };
    for (std::size_t i = 0; i < sides.size(); ++i) {
      const Side& s = sides[i];
      const bool again = i > 0 && sides[i - 1].low == s.low && sides[i - 1].high == s.high;
      const Double3 &a = position[s.low], &b = position[s.high];
      const double base = norm(b - a);
      if (!again) both(s.low, s.high, base);
      if (!again || !(base > 0.0)) continue;
      const std::uint32_t c = sides[i - 1].corner, d = s.corner;
      const auto foot = [&](const Double3& p, double& x, double& y) {
        x = dot(p - a, b - a) / base;
        y = norm(cross(p - a, b - a)) / base;
      };
      double x0 = 0.0, y0 = 0.0, x1 = 0.0, y1 = 0.0;
      foot(position[c], x0, y0);
      foot(position[d], x1, y1);
      if (!(y0 + y1 > 0.0)) continue;
      const double at = x0 + (x1 - x0) * y0 / (y0 + y1);  // where the straight way crosses the edge
      if (at < 0.0 || at > base) continue;
      both(c, d, std::sqrt((x1 - x0) * (x1 - x0) + (y0 + y1) * (y0 + y1)));
    }
  });
}

bool inside(const EditRegion& r, const Double3& p) {
  switch (r.shape) {
    case RegionShape::kAll:
      return true;
    case RegionShape::kBox:
      return p[0] >= r.low[0] && p[1] >= r.low[1] && p[2] >= r.low[2] && p[0] <= r.high[0] &&
             p[1] <= r.high[1] && p[2] <= r.high[2];
    case RegionShape::kSphere:
      return squared_distance(p, r.point) <= r.reach * r.reach;
    case RegionShape::kHalfSpace:
      return dot(p - r.point, r.normal) <= 0.0;
    default:
      return false;
  }
}

std::string described(const EditRegion& r, std::size_t number) {
  std::string text = "region " + std::to_string(number + 1);
  if (!r.name.empty()) text += " ('" + r.name + "')";
  return text;
}

}  // namespace

std::vector<double> surface_distance(std::span<const Double3> position, Faces faces,
                                     std::span<const Double3> sources) {
  const Lists<Way> way = ways(position, faces);
  std::vector<double> distance(position.size(), kInfinite);
  using Item = std::pair<double, std::uint32_t>;
  std::priority_queue<Item, std::vector<Item>, std::greater<>> queue;
  for (const Double3& s : sources) {
    const std::uint32_t v = nearest_vertex(position, s);
    distance[v] = std::min(distance[v], norm(position[v] - s));
    queue.emplace(distance[v], v);
  }
  while (!queue.empty()) {
    const auto [d, v] = queue.top();
    queue.pop();
    if (d > distance[v]) continue;
    for (const Way& w : way[v])
      if (d + w.length < distance[w.to]) {
        distance[w.to] = d + w.length;
        queue.emplace(distance[w.to], w.to);
      }
  }
  return distance;
}

EditRegions resolve_regions(std::span<const EditRegion> regions, std::span<const Double3> position,
                            Faces faces, int order) {
  EditRegions out;
  const double highest = order - 1;
  out.role.assign(position.size(), kFixedVertex);
  out.smoothness.assign(position.size(), highest);
  for (std::size_t i = 0; i < regions.size(); ++i) {
    const EditRegion& r = regions[i];
    std::int32_t role = r.role == RegionRole::kSupport ? kSupportVertex : kFixedVertex;
    if (r.role == RegionRole::kHandle && !r.targets.empty()) {
      role = kTargetVertex;
      out.target.resize(position.size(), Double3{});
    } else if (r.role == RegionRole::kHandle) {
      const auto at = std::find(out.handles.begin(), out.handles.end(), r.name);
      role = static_cast<std::int32_t>(at - out.handles.begin());
      if (at == out.handles.end()) out.handles.push_back(r.name);
    }
    const double smoothness = r.smoothness < 0.0 ? highest : std::min(r.smoothness, highest);
    std::size_t taken = 0;
    const auto take = [&](std::size_t v) {
      out.role[v] = role;
      out.smoothness[v] = smoothness;
      ++taken;
    };
    if (r.shape == RegionShape::kPoints) {
      for (std::size_t k = 0; k < r.points.size(); ++k) {
        const std::uint32_t v = nearest_vertex(position, r.points[k]);
        take(v);
        if (role == kTargetVertex) out.target[v] = position[v] + (r.targets[k] - r.points[k]);
      }
    } else if (r.shape == RegionShape::kGeodesic) {
      const std::vector<double> distance = surface_distance(position, faces, r.points);
      for (std::size_t v = 0; v < position.size(); ++v)
        if (distance[v] <= r.reach) take(v);
    } else {
      for (std::size_t v = 0; v < position.size(); ++v)
        if (inside(r, position[v])) take(v);
    }
    if (taken == 0) throw InputError(described(r, i) + " takes no vertex of the surface: move or enlarge it");
  }
  return out;
}

}  // namespace tessera
