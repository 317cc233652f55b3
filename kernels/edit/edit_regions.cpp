#include "kernels/edit/edit_regions.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <queue>

#include "kernels/mesh/closest_face.h"
#include "octree/edge_faces.h"
#include "octree/error.h"
#include "octree/lists.h"
#include "octree/portable_math.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

using Faces = std::span<const std::array<std::uint32_t, 3>>;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

std::uint32_t nearest_vertex(std::span<const Double3> position, const Double3& p) {
  std::uint32_t best = 0;
  double minimum = kInfinite;
  for (std::uint32_t v = 0; v < position.size(); ++v)
    if (const double d = squared_distance(position[v], p); d < minimum) minimum = d, best = v;
  return best;
}

struct PathEdge {
  std::uint32_t to;
  double length;
};

/// Edges, and across each edge of two faces the way from corner to corner when both are unfolded into a plane.
Lists<PathEdge> path_edges(std::span<const Double3> position, Faces faces) {
  const EdgeFaces edges(position.size(), faces);
  const auto across = [&](std::uint32_t half) { return faces[half / 3][(half % 3 + 2) % 3]; };
  return make_lists<PathEdge>(position.size(), [&](const auto& put) {
    const auto both = [&](std::uint32_t a, std::uint32_t b, double length) {
      put(a, PathEdge{b, length});
      put(b, PathEdge{a, length});
    };
    edges.for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
      const Double3 &a = position[low], &b = position[high];
      const double base = norm(b - a);
      both(low, high, base);
      if (half.size() != 2 || !(base > 0.0)) return;
      const std::uint32_t c = across(half[0]), d = across(half[1]);
      const auto foot = [&](const Double3& p, double& x, double& y) {
        x = dot(p - a, b - a) / base;
        y = norm(cross(p - a, b - a)) / base;
      };
      double x0 = 0.0, y0 = 0.0, x1 = 0.0, y1 = 0.0;
      foot(position[c], x0, y0);
      foot(position[d], x1, y1);
      if (!(y0 + y1 > 0.0)) return;
      const double at = x0 + (x1 - x0) * y0 / (y0 + y1);  // where the straight way crosses the edge
      if (at < 0.0 || at > base) return;
      both(c, d, std::sqrt((x1 - x0) * (x1 - x0) + (y0 + y1) * (y0 + y1)));
    });
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
      return squared_distance(p, r.point) <= r.radius * r.radius;
    case RegionShape::kHalfSpace:
      return dot(p - r.point, r.normal) <= 0.0;
    default:
      return false;
  }
}

bool has_colour(const EditRegion& r, std::uint32_t rgb) {
  for (unsigned c = 0; c < 3; ++c)
    if (std::abs(static_cast<int>(rgb >> 8 * c & 0xffu) - r.colour[c]) > r.within) return false;
  return true;
}

std::string described(const EditRegion& r, std::size_t number) {
  std::string text = "region " + std::to_string(number + 1);
  if (!r.name.empty()) text += " ('" + r.name + "')";
  return text;
}

}  // namespace

// Shortest paths (Dijkstra 1959).
void spread_distance(std::span<const Double3> position, Faces faces, std::vector<double>& distance) {
  const Lists<PathEdge> edges = path_edges(position, faces);
  using Item = std::pair<double, std::uint32_t>;
  std::priority_queue<Item, std::vector<Item>, std::greater<>> queue;
  for (std::uint32_t v = 0; v < distance.size(); ++v)
    if (distance[v] < kInfinite) queue.emplace(distance[v], v);
  while (!queue.empty()) {
    const auto [d, v] = queue.top();
    queue.pop();
    if (d > distance[v]) continue;
    for (const PathEdge& w : edges[v])
      if (d + w.length < distance[w.to]) {
        distance[w.to] = d + w.length;
        queue.emplace(distance[w.to], w.to);
      }
  }
}

std::vector<double> surface_distance(std::span<const Double3> position, Faces faces,
                                     std::span<const Double3> sources) {
  std::vector<double> distance(position.size(), kInfinite);
  for (const Double3& s : sources) {
    const std::uint32_t v = nearest_vertex(position, s);
    distance[v] = std::min(distance[v], norm(position[v] - s));
  }
  spread_distance(position, faces, distance);
  return distance;
}

std::vector<std::uint8_t> crease_patch(std::span<const Double3> position, Faces faces,
                                       std::span<const Double3> sources, double crease_deg) {
  const double minimum = sin_cos(crease_deg * (kPi / 180.0)).cos;
  std::vector<Double3> normal;
  for (const auto& f : faces)
    normal.push_back(unit_or_zero(triangle_normal(position[f[0]], position[f[1]], position[f[2]])));
  // Faces without area have no normal that an edge could turn by.
  const auto is_crease = [&](const Double3& a, const Double3& b) {
    return norm(a) > 0.0 && norm(b) > 0.0 && dot(a, b) < minimum;
  };
  UnionFind patches(faces.size());
  EdgeFaces(position.size(), faces)
      .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
        if (half.size() == 2 && !is_crease(normal[half[0] / 3], normal[half[1] / 3]))
          patches.unite(half[0] / 3, half[1] / 3);
      });
  const ClosestFaces closest(position, faces, position.front());
  std::vector<std::uint8_t> chosen(faces.size(), 0), out(position.size(), 0);
  for (const Double3& p : sources) {
    const auto hit = closest.closest(p - closest.origin(), kInfinite, ClosestFaces::kNone);
    chosen[patches.find(closest.face(hit.slot))] = 1;
  }
  for (std::uint32_t j = 0; j < faces.size(); ++j)
    if (chosen[patches.find(j)]) out[faces[j][0]] = out[faces[j][1]] = out[faces[j][2]] = 1;
  return out;
}

EditRegions resolve_regions(std::span<const EditRegion> regions, const EditSurface& surface, int order) {
  const std::span<const Double3> position = surface.position;
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
      const std::vector<double> distance = surface_distance(position, surface.faces, r.points);
      for (std::size_t v = 0; v < position.size(); ++v)
        if (distance[v] <= r.radius) take(v);
    } else if (r.shape == RegionShape::kPatch) {
      const std::vector<std::uint8_t> in = crease_patch(surface.sharp.empty() ? position : surface.sharp,
                                                        surface.faces, r.points, r.crease_deg);
      for (std::size_t v = 0; v < position.size(); ++v)
        if (in[v]) take(v);
    } else if (r.shape == RegionShape::kPainted) {
      if (surface.colour.empty())
        throw InputError(described(r, i) + " is painted, but the mesh has no vertex colours");
      for (std::size_t v = 0; v < position.size(); ++v)
        if (has_colour(r, surface.colour[v])) take(v);
    } else {
      for (std::size_t v = 0; v < position.size(); ++v)
        if (inside(r, position[v])) take(v);
    }
    if (taken == 0) throw InputError(described(r, i) + " takes no vertex of the surface: move or enlarge it");
  }
  return out;
}

}  // namespace tessera
