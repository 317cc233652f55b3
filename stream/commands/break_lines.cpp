#include "stream/commands/break_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/files/external_sort.h"

namespace tessera {
namespace {

constexpr std::uint64_t kLineStoreBytes = std::uint64_t{64} << 20;
constexpr std::uint64_t kEdgeBytes = 56;

/// One face at an edge.
struct SideRecord {
  std::uint64_t low = 0, high = 0, face = 0;
  Double3 normal{};  ///< unit, turned over where the face runs from high to low
  bool operator<(const SideRecord& o) const {
    if (low != o.low) return low < o.low;
    return high != o.high ? high < o.high : face < o.face;
  }
  bool same_edge(const SideRecord& o) const { return low == o.low && high == o.high; }
};

/// Normals of two faces are opposite here where the edge is flat, whether the faces agree on which side is up or not.
bool breaks(std::span<const SideRecord> sides, double min_cosine) {
  for (std::size_t i = 0; i < sides.size(); ++i)
    for (std::size_t j = i + 1; j < sides.size(); ++j) {
      double cosine = -dot(sides[i].normal, sides[j].normal);
      // Among three or more any two may be the sheet that goes on.
      if (sides.size() > 2) cosine = std::abs(cosine);
      if (cosine < min_cosine) return true;
    }
  return false;
}

}  // namespace

BreakLines::BreakLines(MeshReader& mesh, const BreakLineOptions& options)
    : store_(options.temp, true, std::min(kLineStoreBytes, options.memory_bytes / 4)) {
  find_edges(mesh, options);
  ends_.reserve(2 * edges_.size());
  for (std::uint64_t e = 0; e < edges_.size(); ++e)
    for (const std::uint64_t v : edges_[e]) ends_.push_back({v, e});
  std::sort(ends_.begin(), ends_.end());
  walk([&](std::span<const std::uint64_t>) { ++lines_; });
}

void BreakLines::find_edges(MeshReader& mesh, const BreakLineOptions& options) {
  const auto stop = [&] {
    if (options.check_stop) options.check_stop();
  };
  mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    stop();
    store_.append(batch);
  });
  ExternalSort<SideRecord> sides(options.temp, options.memory_bytes / 4);
  std::uint64_t number = 0;
  mesh.read_faces([&](std::span<const MeshFace> batch) {
    stop();
    for (const MeshFace& f : batch) {
      const std::array<Double3, 3> p = {store_.at(f[0]), store_.at(f[1]), store_.at(f[2])};
      const Double3 across = cross(p[1] - p[0], p[2] - p[0]);
      const double length = norm(across);
      ++number;
      if (!(length > 0.0) || !std::isfinite(length)) continue;  // it bends nowhere
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint64_t a = f[k], b = f[(k + 1) % 3];
        sides.add({std::min(a, b), std::max(a, b), number, across * ((a < b ? 1.0 : -1.0) / length)});
      }
    }
  });
  const double min_cosine = std::cos(options.angle * kPi / 180.0);
  const std::uint64_t most = options.memory_bytes / 4 / kEdgeBytes;
  std::vector<SideRecord> edge;
  const auto close = [&] {
    if (edge.size() > 1 && breaks(edge, min_cosine)) {
      if (edges_.size() >= most)
        throw ResourceError(
            "--breaklines " + std::to_string(options.angle) + ": more than " + std::to_string(most) +
            " edges of this mesh bend by that much, which memory does not hold; raise the angle");
      edges_.push_back({edge[0].low, edge[0].high});
    }
    edge.clear();
  };
  sides.drain([&](std::span<const SideRecord> batch) {
    stop();
    for (const SideRecord& s : batch) {
      if (!edge.empty() && !edge.front().same_edge(s)) close();
      edge.push_back(s);
    }
  });
  close();
}

std::span<const BreakLines::End> BreakLines::ends_at(std::uint64_t vertex) const {
  const auto [first, last] = std::equal_range(ends_.begin(), ends_.end(), End{vertex, 0},
                                              [](const End& a, const End& b) { return a.vertex < b.vertex; });
  return {first, last};
}

template <class Use>
void BreakLines::walk(const Use& use) const {
  std::vector<bool> used(edges_.size(), false);
  std::vector<std::uint64_t> line;
  const auto follow = [&](std::uint64_t vertex, std::uint64_t edge) {
    line = {vertex};
    for (;;) {
      used[edge] = true;
      vertex = edges_[edge][0] == vertex ? edges_[edge][1] : edges_[edge][0];
      line.push_back(vertex);
      const auto ends = ends_at(vertex);
      if (ends.size() != 2) break;
      const std::uint64_t next = ends[0].edge == edge ? ends[1].edge : ends[0].edge;
      if (used[next]) break;
      edge = next;
    }
    use(line);
  };
  // From ends and junctions first; what is left are loops.
  for (const bool loops : {false, true})
    for (const End& end : ends_)
      if (!used[end.edge] && (loops || ends_at(end.vertex).size() != 2)) follow(end.vertex, end.edge);
}

void BreakLines::for_each(const std::function<void(std::span<const Double3>)>& use) {
  std::vector<Double3> points;
  walk([&](std::span<const std::uint64_t> line) {
    points.clear();
    for (const std::uint64_t v : line) points.push_back(store_.at(v));
    use(points);
  });
}

}  // namespace tessera
