#include "kernels/edit/refined_base.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <tuple>

#include "kernels/edit/edit_basis.h"
#include "kernels/edit/edit_regions.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;
constexpr double kAnyLength = std::numeric_limits<double>::infinity();

/// What is wanted grows by so much of the way from where it is.
constexpr double kGrowth = 0.5;

/// Of a vertex and a face of a base: positions, wanted lengths, lists of faces; paths over it, or edges that wait.
constexpr std::uint64_t kSplitVertexBytes = 320, kSplitFaceBytes = 60;

double longest_edge(std::span<const Double3> position, const Face& f) {
  double square = 0.0;
  for (std::size_t k = 0; k < 3; ++k)
    square = std::max(square, squared_distance(position[f[k]], position[f[(k + 1) % 3]]));
  return std::sqrt(square);
}

/// use(twice the area, longest edge, shortest length wanted) for the faces with a vertex that wants something.
template <class Use>
void for_wanting(std::span<const Double3> position, std::span<const Face> faces,
                 std::span<const double> wanted, const Use& use) {
  for (const Face& f : faces) {
    const double minimum = std::min({wanted[f[0]], wanted[f[1]], wanted[f[2]]});
    if (std::isfinite(minimum))
      use(norm(triangle_normal(position[f[0]], position[f[1]], position[f[2]])), longest_edge(position, f),
          minimum);
  }
}

class Splitter {
 public:
  Splitter(std::vector<Double3>& position, std::vector<Face>& faces, std::vector<double> wanted)
      : position_(position), faces_(faces), wanted_(std::move(wanted)), around_(position.size()) {
    for (std::uint32_t j = 0; j < faces_.size(); ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        around_[faces_[j][k]].push_back(j);
        add(faces_[j][k], faces_[j][(k + 1) % 3]);
      }
  }

  BaseSplits run(std::size_t max_vertices) {
    BaseSplits out;
    while (!waiting_.empty()) {
      const Edge edge = waiting_.top();
      waiting_.pop();
      find_faces(edge);
      if (beside_.empty()) continue;  // it is split
      if (position_.size() >= max_vertices) {
        out.longest = edge.length;
        break;
      }
      split(edge);
      ++out.splits;
    }
    return out;
  }

 private:
  struct Edge {
    double length;  ///< times what is wanted
    std::uint32_t low, high;
    bool operator<(const Edge& o) const {
      return std::tie(length, o.low, o.high) < std::tie(o.length, low, high);
    }
  };

  void add(std::uint32_t a, std::uint32_t b) {
    const double wanted = std::min(wanted_[a], wanted_[b]);
    const double length = norm(position_[b] - position_[a]) / wanted;
    if (length > 1.0) waiting_.push({length, std::min(a, b), std::max(a, b)});
  }

  /// Those with this edge, into beside_.
  void find_faces(const Edge& e) {
    beside_.clear();
    const bool by_low = around_[e.low].size() <= around_[e.high].size();
    const std::uint32_t other = by_low ? e.high : e.low;
    for (const std::uint32_t j : around_[by_low ? e.low : e.high])
      if (const Face& f = faces_[j]; f[0] == other || f[1] == other || f[2] == other) beside_.push_back(j);
    // In the order of the faces, whichever end they were found at.
    std::sort(beside_.begin(), beside_.end());
  }

  void split(const Edge& e) {
    const auto middle = static_cast<std::uint32_t>(position_.size());
    position_.push_back((position_[e.low] + position_[e.high]) * 0.5);
    wanted_.push_back(0.5 * (wanted_[e.low] + wanted_[e.high]));
    around_.emplace_back();
    add(e.low, middle);
    add(middle, e.high);
    for (const std::uint32_t j : beside_) {
      const auto fresh = static_cast<std::uint32_t>(faces_.size());
      Face other = faces_[j];
      std::uint32_t beyond = e.low;
      for (std::size_t k = 0; k < 3; ++k) {
        std::uint32_t& v = faces_[j][k];
        if (v == e.high)
          v = middle;
        else if (v == e.low)
          other[k] = middle;
        else
          beyond = v;
      }
      faces_.push_back(other);
      std::replace(around_[e.high].begin(), around_[e.high].end(), j, fresh);
      around_[beyond].push_back(fresh);
      around_[middle].push_back(j);
      around_[middle].push_back(fresh);
      add(middle, beyond);
    }
  }

  std::vector<Double3>& position_;
  std::vector<Face>& faces_;
  std::vector<double> wanted_;
  std::vector<std::vector<std::uint32_t>> around_;  ///< per vertex its faces
  std::priority_queue<Edge> waiting_;
  std::vector<std::uint32_t> beside_;
};

}  // namespace

std::vector<double> wanted_edges(std::span<const Double3> position, std::span<const Face> faces,
                                 std::span<const std::int32_t> role, double share, SupportPart part) {
  std::vector<std::uint8_t> held;
  std::vector<double> distance;
  for (const std::int32_t r : role) {
    held.push_back(r != kSupportVertex);
    distance.push_back(held.back() != 0 ? 0.0 : kAnyLength);
  }
  spread_distance(position, faces, distance);
  UnionFind pieces(position.size());
  for (const Face& f : faces)
    for (std::size_t k = 0; k < 3; ++k)
      if (held[f[k]] == 0 && held[f[(k + 1) % 3]] == 0) pieces.unite(f[k], f[(k + 1) % 3]);
  // Twice the way from its middle to what is held.
  std::vector<double> width(position.size(), 0.0);
  for (std::uint32_t v = 0; v < width.size(); ++v)
    if (held[v] == 0) {
      double& w = width[pieces.find(v)];
      w = std::max(w, 2.0 * distance[v]);
    }
  const auto wanted = [&](std::uint32_t v) {
    const double w = held[v] != 0 ? 0.0 : width[pieces.find(v)];
    return w > 0.0 ? share * w : kAnyLength;
  };
  std::vector<double> out(position.size(), kAnyLength);
  // What is held beside it lies beyond the edge of a region, too.
  for (const Face& f : faces) {
    const auto count = std::count_if(f.begin(), f.end(), [&](std::uint32_t v) { return held[v] == 0; });
    if (count == 0 || (count == 3 && part == SupportPart::kEdge)) continue;
    const double minimum = std::min({wanted(f[0]), wanted(f[1]), wanted(f[2])});
    for (const std::uint32_t v : f) out[v] = std::min(out[v], minimum);
  }
  return out;
}

double coarse_share(std::span<const Double3> position, std::span<const Face> faces,
                    std::span<const double> wanted, double times) {
  double all = 0.0, coarse = 0.0;
  for_wanting(position, faces, wanted, [&](double area, double longest, double minimum) {
    all += area;
    if (longest > times * minimum) coarse += area;
  });
  return all > 0.0 ? coarse / all : 0.0;
}

double least_height(std::span<const Double3> position, std::span<const Face> faces,
                    std::span<const double> wanted) {
  double least = std::numeric_limits<double>::infinity();
  for_wanting(position, faces, wanted, [&](double area, double longest, double) {
    least = std::min(least, longest > 0.0 ? area / (longest * longest) : 0.0);
  });
  return least;
}

double mean_longest_edge(std::span<const Double3> position, std::span<const Face> faces,
                         std::span<const double> wanted) {
  double all = 0.0, sum = 0.0;
  for_wanting(position, faces, wanted, [&](double area, double longest, double) {
    all += area;
    sum += area * longest;
  });
  return all > 0.0 ? sum / all : 0.0;
}

BaseSplits split_long_edges(std::vector<Double3>& position, std::vector<Face>& faces,
                            std::vector<double> wanted, std::size_t max_vertices) {
  for (double& w : wanted) w /= kGrowth;
  spread_distance(position, faces, wanted);
  for (double& w : wanted) w *= kGrowth;
  return Splitter(position, faces, std::move(wanted)).run(max_vertices);
}

std::uint64_t refined_base_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return kSplitVertexBytes * vertices + kSplitFaceBytes * faces;
}

}  // namespace tessera
