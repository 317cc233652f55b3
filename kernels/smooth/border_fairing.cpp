#include "kernels/smooth/border_fairing.h"

#include <algorithm>
#include <limits>

#include "octree/edge_faces.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;

/// Of a face's least height: three corners that go so far do not turn it over.
constexpr double kHeightShare = 0.3;
constexpr std::uint32_t kNone = 0xffffffffu;

/// A vertex that moves.
struct Bead {
  std::uint32_t vertex;
  std::array<std::uint32_t, 2> along;  ///< its neighbours on the border
};

using Neighbours =
    std::vector<std::array<std::uint32_t, 2>>;  ///< along the border, kNone where there is none

bool is_at_small_hole(const Neighbours& along, std::uint32_t vertex, int edges) {
  std::uint32_t before = vertex, at = along[vertex][0];
  for (int edge = 1; edge < edges && at != kNone; ++edge) {
    const std::uint32_t next = along[at][along[at][0] == before ? 1 : 0];
    if (next == vertex) return true;
    before = at;
    at = next;
  }
  return false;
}

/// Vertices with two border edges, ascending, but for those of small holes.
std::vector<Bead> find_beads(const BorderStrip& strip, int small_hole) {
  Neighbours along(strip.position.size(), {kNone, kNone});
  std::vector<std::uint8_t> degree(strip.position.size(), 0);
  const auto link = [&](std::uint32_t from, std::uint32_t to) {
    if (degree[from] < 2) along[from][degree[from]] = to;
    degree[from] = static_cast<std::uint8_t>(std::min(degree[from] + 1, 3));
  };
  const auto at_border = [&](std::uint32_t half) {
    const Face& f = strip.faces[half / 3];
    return strip.at_border[f[half % 3]] != 0 && strip.at_border[f[(half % 3 + 1) % 3]] != 0;
  };
  EdgeFaces(strip.position.size(), strip.faces, at_border)
      .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
        if (half.size() != 1) return;
        link(low, high);
        link(high, low);
      });
  for (std::uint32_t v = 0; v < degree.size(); ++v)
    if (degree[v] != 2) along[v] = {kNone, kNone};
  std::vector<Bead> beads;
  for (std::uint32_t v = 0; v < degree.size(); ++v)
    if (degree[v] == 2 && !is_at_small_hole(along, v, small_hole)) beads.push_back({v, along[v]});
  return beads;
}

/// Of the faces' areas, per vertex.
std::vector<Double3> vertex_normals(const BorderStrip& strip) {
  std::vector<Double3> normal(strip.position.size(), Double3{});
  for (const Face& f : strip.faces) {
    const Double3 n = triangle_normal(strip.position[f[0]], strip.position[f[1]], strip.position[f[2]]);
    for (const std::uint32_t v : f) normal[v] = normal[v] + n;
  }
  for (Double3& n : normal) n = unit_or_zero(n);
  return normal;
}

/// A face beside the border.
struct Scale {
  Face face;
  Double3 normal;  ///< mean of those at its corners
  double cosine;   ///< between that and its own
};

double cosine_to(const Double3& normal, const Double3& area) {
  const double length = norm(area);
  return length > 0.0 ? dot(normal, area) / length : -1.0;
}

}  // namespace

void fair_border(BorderStrip& strip, double lift, const BorderFairing& by) {
  const std::vector<Bead> beads = find_beads(strip, by.small_hole);
  const std::vector<Double3> start = strip.position, normal = vertex_normals(strip);
  std::vector<std::uint8_t> moves(start.size(), 0);
  for (const Bead& b : beads) moves[b.vertex] = 1;
  std::vector<Scale> scales;
  for (const Face& f : strip.faces)
    if (moves[f[0]] || moves[f[1]] || moves[f[2]])
      scales.push_back({f, unit_or_zero(normal[f[0]] + normal[f[1]] + normal[f[2]]), 0.0});

  std::vector<Double3>& at = strip.position;
  std::vector<Double3> next = at;
  std::vector<double> height(at.size());
  std::vector<std::uint8_t> stays(at.size());
  for (int step = 0; step < by.steps; ++step) {
    std::fill(height.begin(), height.end(), std::numeric_limits<double>::max());
    for (Scale& s : scales) {
      const Double3 &a = at[s.face[0]], &b = at[s.face[1]], &c = at[s.face[2]];
      const Double3 area = triangle_normal(a, b, c);
      const double longest =
          std::sqrt(std::max({squared_distance(a, b), squared_distance(b, c), squared_distance(c, a)}));
      const double minimum = longest > 0.0 ? norm(area) / longest : 0.0;
      for (const std::uint32_t v : s.face) height[v] = std::min(height[v], minimum);
      s.cosine = cosine_to(s.normal, area);
    }
    for (const Bead& b : beads) {
      const Double3& p = at[b.vertex];
      Double3 shift = (at[b.along[0]] + at[b.along[1]]) * 0.25 - p * 0.5;
      const double length = norm(shift), maximum = kHeightShare * height[b.vertex];
      if (length > maximum) shift = shift * (maximum / length);
      Double3 to = p + shift;
      const double off = dot(to - start[b.vertex], normal[b.vertex]);
      to = to - normal[b.vertex] * (off - std::clamp(off, -lift, lift));
      const double farthest = strip.cell.empty() ? by.max_shift : by.max_shift * strip.cell[b.vertex];
      next[b.vertex] = squared_distance(to, start[b.vertex]) > farthest * farthest ? p : to;
    }
    std::fill(stays.begin(), stays.end(), 0);
    for (const Scale& s : scales) {
      const Double3 area = triangle_normal(next[s.face[0]], next[s.face[1]], next[s.face[2]]);
      const double cosine = cosine_to(s.normal, area);
      if (cosine >= by.min_cosine || cosine >= s.cosine) continue;
      for (const std::uint32_t v : s.face) stays[v] = 1;
    }
    for (const Bead& b : beads)
      if (!stays[b.vertex]) at[b.vertex] = next[b.vertex];
  }
}

}  // namespace tessera
