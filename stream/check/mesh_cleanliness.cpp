#include "stream/check/mesh_cleanliness.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "kernels/mesh/flat_faces.h"
#include "octree/vector.h"
#include "stream/files/external_sort.h"

namespace tessera {
namespace {

/// One side of a face, with the face's normal.
struct CleanEdge {
  std::uint64_t low, high;  ///< vertices
  std::uint64_t face;
  Float3 normal;  ///< unit
};

struct ByVertices {
  bool operator()(const CleanEdge& l, const CleanEdge& r) const {
    if (l.low != r.low) return l.low < r.low;
    if (l.high != r.high) return l.high < r.high;
    return l.face < r.face;
  }
};

using BorderEdge = std::array<std::uint64_t, 2>;
constexpr std::uint64_t kNoNeighbour = ~std::uint64_t{0};

struct BorderVertex {
  std::array<std::uint64_t, 2> next = {kNoNeighbour, kNoNeighbour};  ///< its neighbours along the border
  std::uint32_t edges = 0;
};

/// What an edge of the border takes while its vertices are smoothed; no border has more vertices than ends of edges.
constexpr std::uint64_t kBytesOfEdge =
    2 * sizeof(BorderEdge) + 2 * (sizeof(std::uint64_t) + sizeof(BorderVertex) + 2 * sizeof(Double3));

double length_of(std::span<const BorderEdge> edges, std::span<const Double3> at) {
  double sum = 0.0;
  for (const auto& [a, b] : edges) sum += norm(at[a] - at[b]);
  return sum;
}

/// Numbers the vertices of the border from 0. \returns their numbers in the mesh, ascending
std::vector<std::uint64_t> number_border(std::vector<BorderEdge>& edges) {
  std::vector<std::uint64_t> vertices;
  vertices.reserve(2 * edges.size());
  for (const BorderEdge& e : edges) vertices.insert(vertices.end(), e.begin(), e.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  for (BorderEdge& e : edges)
    for (std::uint64_t& v : e)
      v = static_cast<std::uint64_t>(std::lower_bound(vertices.begin(), vertices.end(), v) -
                                     vertices.begin());
  return vertices;
}

/// The length of the border after its vertices were smoothed along it.
double smoothed_length(std::span<const BorderEdge> edges, std::vector<Double3> at,
                       const std::function<void()>& check_stop) {
  std::vector<BorderVertex> around(at.size());
  for (const auto& [a, b] : edges) {
    if (around[a].edges < 2) around[a].next[around[a].edges] = b;
    if (around[b].edges < 2) around[b].next[around[b].edges] = a;
    ++around[a].edges, ++around[b].edges;
  }
  std::vector<Double3> moved(at.size());
  for (int step = 0; step < kBorderSmoothing; ++step) {
    if (check_stop) check_stop();
    for (std::size_t v = 0; v < at.size(); ++v) {
      const BorderVertex& b = around[v];
      moved[v] = b.edges == 2 ? at[v] * 0.5 + (at[b.next[0]] + at[b.next[1]]) * 0.25 : at[v];
    }
    at.swap(moved);
  }
  return length_of(edges, at);
}

class CleanlinessMeter {
 public:
  CleanlinessMeter(VertexStore& positions, const MeshCleanlinessOptions& options)
      : positions_(positions), options_(options), edges_(options.temp, options.memory_bytes / 2) {}

  void add(std::span<const MeshFace> faces) {
    if (options_.check_stop) options_.check_stop();
    for (const MeshFace& face : faces) add(face, number_++);
  }

  MeshCleanliness finish() {
    MeshCleanliness result;
    std::vector<CleanEdge> same;
    edges_.drain([&](std::span<const CleanEdge> sorted) {
      if (options_.check_stop) options_.check_stop();
      for (const CleanEdge& e : sorted) {
        if (!same.empty() && (same[0].low != e.low || same[0].high != e.high)) {
          count(same, result);
          same.clear();
        }
        if (same.size() < 3) same.push_back(e);  // from three on it is no matter how many
      }
    });
    if (!same.empty()) count(same, result);
    measure_border(result);
    return result;
  }

 private:
  void add(const MeshFace& face, std::uint64_t number) {
    std::array<std::uint64_t, 3> v = {face[0], face[1], face[2]};
    const bool odd = ((v[0] > v[1]) != (v[1] > v[2])) != (v[0] > v[2]);
    std::sort(v.begin(), v.end());
    if (v[2] >= positions_.size() || v[0] == v[1] || v[1] == v[2]) return;
    std::array<Double3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = positions_.at(v[k]);
      for (const double x : p[k])
        if (!std::isfinite(x)) return;
    }
    // By ascending vertex, so that the order of the corners decides no bit.
    const Double3 ab = p[1] - p[0], ac = p[2] - p[0], bc = p[2] - p[1];
    const Double3 across = cross(ab, ac);
    const double twice_area = norm(across);
    if (FaceExtent{twice_area, std::max({dot(ab, ab), dot(ac, ac), dot(bc, bc)})}.is_flat()) return;
    Float3 normal;
    for (std::size_t k = 0; k < 3; ++k)
      normal[k] = static_cast<float>((odd ? -across[k] : across[k]) / twice_area);
    for (const auto& [low, high] : {std::pair{0, 1}, std::pair{0, 2}, std::pair{1, 2}})
      edges_.add({v[static_cast<std::size_t>(low)], v[static_cast<std::size_t>(high)], number, normal});
  }

  void count(const std::vector<CleanEdge>& same, MeshCleanliness& result) {
    if (same.size() == 1) {
      ++result.border_edges;
      // What does not fit is only counted.
      if (result.border_edges * kBytesOfEdge <= options_.memory_bytes / 2)
        border_.push_back({same[0].low, same[0].high});
    } else if (same.size() == 2) {
      static const float kCosine = static_cast<float>(std::cos(kSharpEdgeAngle * std::numbers::pi / 180.0));
      ++result.inner_edges;
      if (dot(same[0].normal, same[1].normal) < kCosine) ++result.sharp_edges;
    }
  }

  void measure_border(MeshCleanliness& result) {
    result.border_bytes = result.border_edges * kBytesOfEdge;
    if (result.border_edges == 0) result.border_jaggedness = 1.0;
    if (border_.empty() || border_.size() < result.border_edges) return;
    const std::vector<std::uint64_t> vertices = number_border(border_);
    std::vector<Double3> at;
    at.reserve(vertices.size());
    for (const std::uint64_t v : vertices) at.push_back(positions_.at(v));
    result.border_length = length_of(border_, at);
    const double smooth = smoothed_length(border_, std::move(at), options_.check_stop);
    result.border_jaggedness = smooth > 0.0 ? result.border_length / smooth : 1.0;
  }

  VertexStore& positions_;
  const MeshCleanlinessOptions& options_;
  ExternalSort<CleanEdge, ByVertices> edges_;
  std::vector<BorderEdge> border_;
  std::uint64_t number_ = 0;
};

}  // namespace

MeshCleanliness measure_cleanliness(MeshReader& mesh, VertexStore& positions,
                                    const MeshCleanlinessOptions& options) {
  CleanlinessMeter meter(positions, options);
  mesh.read_faces([&](std::span<const MeshFace> faces) { meter.add(faces); });
  return meter.finish();
}

Json to_json(const MeshCleanliness& c) {
  Json json = {{"inner_edges", c.inner_edges},
               {"sharp_edges", c.sharp_edges},
               {"sharp_edges_per_1000", c.sharp_edges_per_1000()},
               {"border_edges", c.border_edges},
               {"border_jaggedness", nullptr}};
  if (c.border_jaggedness) {
    json["border_length"] = c.border_length;
    json["border_jaggedness"] = *c.border_jaggedness;
  }
  return json;
}

std::string describe(const MeshCleanliness& c) {
  std::string text = fmt::format("sharp edges   {} of {} fold by {:g} degrees or more: {:.3f} in 1,000\n",
                                 c.sharp_edges, c.inner_edges, kSharpEdgeAngle, c.sharp_edges_per_1000());
  if (c.border_jaggedness)
    return text + fmt::format("jaggedness    {:.3f}: length of the border over that of its smooth course\n",
                              *c.border_jaggedness);
  return text + fmt::format("jaggedness    not measured, the border takes {} MiB: raise --memory to {}M\n",
                            (c.border_bytes >> 20) + 1, (c.border_bytes >> 19) * 4 + 64);
}

}  // namespace tessera
