#include "kernels/texture/charts.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

#include "kernels/maps/disk_topology.h"
#include "kernels/maps/parameterize.h"
#include "kernels/texture/chart_overlap.h"
#include "octree/edge_faces.h"
#include "octree/error.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoChart = 0xffffffffu;
constexpr int kTurns = 24;                ///< rotations that are tried within a right angle
constexpr int kLoosePasses = 8;           ///< of faces that join neighbours
constexpr double kFlipRounding = 1e-12;   ///< of the squared extent
constexpr double kCollapsedShare = 1e-3;  ///< a face so much smaller in the plane than on the surface is none

Double2 min_of(std::span<const Double2> uv) {
  Double2 low = uv[0];
  for (const Double2& p : uv) low = {std::min(low[0], p[0]), std::min(low[1], p[1])};
  return low;
}
Double2 max_of(std::span<const Double2> uv) {
  Double2 high = uv[0];
  for (const Double2& p : uv) high = {std::max(high[0], p[0]), std::max(high[1], p[1])};
  return high;
}

double twice_area(const Double2& a, const Double2& b, const Double2& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
}

class ChartMaker {
 public:
  ChartMaker(const TriangleSpan& mesh, const ChartOptions& options)
      : mesh_(mesh),
        options_(options),
        normal_(mesh.faces.size()),
        area_(mesh.faces.size()),
        across_(3 * mesh.faces.size(), kNoHalfEdge),
        chart_of_(mesh.faces.size(), kNoChart) {
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const auto& t = mesh.faces[f];
      const Double3 n = triangle_normal(mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]);
      area_[f] = 0.5 * norm(n);
      normal_[f] = unit_or_zero(n);
    }
    EdgeFaces(mesh.positions.size(), mesh.faces)
        .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
          if (half.size() != 2 || from(half[0]) == from(half[1])) return;
          across_[half[0]] = half[1];
          across_[half[1]] = half[0];
        });
  }

  std::vector<MeshChart> run() {
    std::vector<std::uint32_t> order(mesh_.faces.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return area_[a] != area_[b] ? area_[a] > area_[b] : a < b;
    });
    if (options_.unfold_cone_deg > options_.cone_deg) {
      cosine_ = cosine_of_degrees(options_.unfold_cone_deg);
      grow_all(order);
      join_few();
      take_unfolded();
    }
    // What could not be unfolded.
    cosine_ = cosine_of_degrees(options_.cone_deg);
    axis_.clear();
    grow_all(order);
    join_few();
    std::vector<std::uint32_t> rest = take_projected();
    while (!rest.empty()) {  // the first face of a chart overlaps none, so there are fewer every time
      axis_.clear();
      std::sort(rest.begin(), rest.end(), [&](std::uint32_t a, std::uint32_t b) {
        return area_[a] != area_[b] ? area_[a] > area_[b] : a < b;
      });
      grow_all(rest);
      rest = take_projected();
    }
    return std::move(out_);
  }

 private:
  static constexpr std::uint32_t kTaken = kNoChart - 1;  ///< in chart_of_: in a chart that is done

  std::uint32_t from(std::uint32_t half) const { return mesh_.faces[half / 3][half % 3]; }
  std::uint32_t neighbour(std::uint32_t f, std::uint32_t k) const {
    const std::uint32_t h = across_[3 * f + k];
    return h == kNoHalfEdge ? kNoChart : h / 3;
  }

  void grow_all(std::span<const std::uint32_t> order) {
    for (const std::uint32_t seed : order) {
      if (chart_of_[seed] != kNoChart) continue;
      Double3 axis = normal_[seed];
      if (axis == Double3{}) axis = {0, 0, 1};
      std::vector<std::uint32_t> faces = grow(seed, axis);
      // Once more around the mean of what was found, if the seed lies within that cone.
      Double3 mean{};
      for (const std::uint32_t f : faces) mean = mean + normal_[f] * area_[f];
      mean = unit_or_zero(mean);
      if (faces.size() > 1 && dot(mean, normal_[seed]) >= cosine_) {
        for (const std::uint32_t f : faces) chart_of_[f] = kNoChart;
        axis = mean;
        faces = grow(seed, axis);
      }
      axis_.push_back(axis);
    }
  }

  /// Marks faces with the next chart.
  std::vector<std::uint32_t> grow(std::uint32_t seed, const Double3& axis) {
    const auto chart = static_cast<std::uint32_t>(axis_.size());
    const Double3 e1 = any_orthogonal(axis), e2 = cross(axis, e1);
    const double limit =
        options_.max_extent > 0.0 ? options_.max_extent : std::numeric_limits<double>::infinity();
    Double2 low{}, high{};
    const auto include = [&](std::uint32_t f, Double2& lo, Double2& hi) {
      for (const std::uint32_t v : mesh_.faces[f]) {
        const Double2 p = {dot(mesh_.positions[v], e1), dot(mesh_.positions[v], e2)};
        for (std::size_t a = 0; a < 2; ++a) lo[a] = std::min(lo[a], p[a]), hi[a] = std::max(hi[a], p[a]);
      }
    };
    const Double3& p0 = mesh_.positions[mesh_.faces[seed][0]];
    low = high = {dot(p0, e1), dot(p0, e2)};
    include(seed, low, high);
    struct Candidate {
      double cost;
      std::uint32_t face;
      bool operator>(const Candidate& o) const { return cost != o.cost ? cost > o.cost : face > o.face; }
    };
    std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
    std::vector<std::uint32_t> faces = {seed};
    chart_of_[seed] = chart;
    // Squares grow rather than disks: they leave less between them, on the surface and on pages.
    const Double3 centre = centroid(seed);
    const auto from_centre = [&](std::uint32_t f) {
      const Double3 d = centroid(f) - centre;
      return std::max(std::fabs(dot(d, e1)), std::fabs(dot(d, e2)));
    };
    const auto push_around = [&](std::uint32_t f) {
      for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t g = neighbour(f, k);
        if (g == kNoChart || chart_of_[g] != kNoChart) continue;
        if (area_[g] > 0.0 && dot(normal_[g], axis) < cosine_) continue;
        queue.push({from_centre(g), g});
      }
    };
    push_around(seed);
    while (!queue.empty()) {
      const std::uint32_t f = queue.top().face;
      queue.pop();
      if (chart_of_[f] != kNoChart) continue;
      Double2 lo = low, hi = high;
      include(f, lo, hi);
      if (hi[0] - lo[0] > limit || hi[1] - lo[1] > limit) continue;
      low = lo, high = hi;
      chart_of_[f] = chart;
      faces.push_back(f);
      push_around(f);
    }
    return faces;
  }

  Double3 centroid(std::uint32_t f) const {
    const auto& t = mesh_.faces[f];
    return (mesh_.positions[t[0]] + mesh_.positions[t[1]] + mesh_.positions[t[2]]) / 3.0;
  }

  /// Faces of charts of few faces join neighbours that they nearly look like.
  void join_few() {
    const double loose = cosine_of_degrees(std::max(options_.loose_cone_deg, 0.0));
    if (options_.max_extent > 0.0) box_charts();
    std::vector<std::uint32_t> count(axis_.size(), 0);
    for (const std::uint32_t c : chart_of_)
      if (c < axis_.size()) ++count[c];
    for (int pass = 0; pass < kLoosePasses; ++pass) {
      bool moved = false;
      for (std::uint32_t f = 0; f < chart_of_.size(); ++f) {
        const std::uint32_t own = chart_of_[f];
        if (own >= axis_.size() || count[own] >= options_.few_faces) continue;
        std::uint32_t best = kNoChart;
        double best_dot = std::min(loose, cosine_);
        for (std::uint32_t k = 0; k < 3; ++k) {
          const std::uint32_t g = neighbour(f, k);
          if (g == kNoChart) continue;
          const std::uint32_t c = chart_of_[g];
          if (c >= axis_.size() || c == own || count[c] <= count[own] || !fits_box(c, f)) continue;
          const double d = area_[f] > 0.0 ? dot(normal_[f], axis_[c]) : 1.0;
          if (d > best_dot || (d == best_dot && c < best)) best = c, best_dot = d;
        }
        if (best == kNoChart) continue;
        --count[own], ++count[best];
        chart_of_[f] = best;
        if (options_.max_extent > 0.0) grow_box(best, f);
        moved = true;
      }
      if (!moved) break;
    }
  }

  // Boxes of charts in the frames of their axes, for join_few() under a limit.
  struct FrameBox {
    Double3 e1{}, e2{};
    Double2 low{}, high{};
    bool empty = true;
  };
  void box_charts() {
    box_.assign(axis_.size(), {});
    for (std::size_t c = 0; c < box_.size(); ++c) {
      box_[c].e1 = any_orthogonal(axis_[c]);
      box_[c].e2 = cross(axis_[c], box_[c].e1);
    }
    for (std::uint32_t f = 0; f < chart_of_.size(); ++f)
      if (chart_of_[f] < axis_.size()) grow_box(chart_of_[f], f);
  }
  FrameBox box_with(std::uint32_t c, std::uint32_t f) const {
    FrameBox b = box_[c];
    for (const std::uint32_t v : mesh_.faces[f]) {
      const Double2 p = {dot(mesh_.positions[v], b.e1), dot(mesh_.positions[v], b.e2)};
      if (b.empty) b.low = b.high = p, b.empty = false;
      for (std::size_t a = 0; a < 2; ++a)
        b.low[a] = std::min(b.low[a], p[a]), b.high[a] = std::max(b.high[a], p[a]);
    }
    return b;
  }
  void grow_box(std::uint32_t c, std::uint32_t f) { box_[c] = box_with(c, f); }
  bool fits_box(std::uint32_t c, std::uint32_t f) const {
    if (!(options_.max_extent > 0.0)) return true;
    const FrameBox b = box_with(c, f);
    const double limit = options_.max_extent;
    return b.high[0] - b.low[0] <= limit && b.high[1] - b.low[1] <= limit;
  }

  /// Faces by chart, ascending.
  std::vector<std::vector<std::uint32_t>> gather() const {
    std::vector<std::vector<std::uint32_t>> faces(axis_.size());
    for (std::uint32_t f = 0; f < chart_of_.size(); ++f)
      if (chart_of_[f] < axis_.size()) faces[chart_of_[f]].push_back(f);
    return faces;
  }

  MeshChart chart_of(std::vector<std::uint32_t> faces) const {
    MeshChart chart;
    chart.faces = std::move(faces);
    for (const std::uint32_t f : chart.faces)
      chart.vertices.insert(chart.vertices.end(), mesh_.faces[f].begin(), mesh_.faces[f].end());
    std::sort(chart.vertices.begin(), chart.vertices.end());
    chart.vertices.erase(std::unique(chart.vertices.begin(), chart.vertices.end()), chart.vertices.end());
    for (const std::uint32_t f : chart.faces) {
      std::array<std::uint32_t, 3> t{};
      for (std::size_t k = 0; k < 3; ++k)
        t[k] = static_cast<std::uint32_t>(
            std::lower_bound(chart.vertices.begin(), chart.vertices.end(), mesh_.faces[f][k]) -
            chart.vertices.begin());
      chart.corners.push_back(t);
    }
    return chart;
  }

  void project(MeshChart& chart, const Double3& axis) const {
    const Double3 e1 = any_orthogonal(axis), e2 = cross(axis, e1);
    chart.uv.clear();
    const Double3 origin = mesh_.positions[chart.vertices[0]];
    for (const std::uint32_t v : chart.vertices)
      chart.uv.push_back({dot(mesh_.positions[v] - origin, e1), dot(mesh_.positions[v] - origin, e2)});
  }

  /// Turns a chart so that its box is smallest, and lays its low corner on the origin.
  static void settle(MeshChart& chart) {
    double best_area = std::numeric_limits<double>::infinity();
    SinCos best{0.0, 1.0};
    const auto turned = [](const Double2& p, const SinCos& s) {
      return Double2{s.cos * p[0] - s.sin * p[1], s.sin * p[0] + s.cos * p[1]};
    };
    for (int i = 0; i < kTurns; ++i) {
      const SinCos s = sin_cos(0.5 * kPi * i / kTurns);
      Double2 low = turned(chart.uv[0], s), high = low;
      for (const Double2& p : chart.uv) {
        const Double2 q = turned(p, s);
        for (std::size_t a = 0; a < 2; ++a)
          low[a] = std::min(low[a], q[a]), high[a] = std::max(high[a], q[a]);
      }
      const double area = (high[0] - low[0]) * (high[1] - low[1]);
      if (area < best_area * (1.0 - 1e-9)) best_area = area, best = s;
    }
    for (Double2& p : chart.uv) p = turned(p, best);
    const Double2 low = min_of(chart.uv);
    for (Double2& p : chart.uv) p = {p[0] - low[0], p[1] - low[1]};
    chart.extent = max_of(chart.uv);
  }

  void take(MeshChart&& chart) {
    for (const std::uint32_t f : chart.faces) chart_of_[f] = kTaken;
    settle(chart);
    out_.push_back(std::move(chart));
  }

  /// Charts of the wide cone: those that least squares unfold well are done, the others are undone.
  void take_unfolded() {
    const std::vector<std::vector<std::uint32_t>> all = gather();
    const double flat = cosine_of_degrees(options_.cone_deg);
    for (std::size_t c = 0; c < all.size(); ++c) {
      if (all[c].empty()) continue;
      // Within the cone a projection does as well.
      const bool wide = std::any_of(all[c].begin(), all[c].end(), [&](std::uint32_t f) {
        return area_[f] > 0.0 && dot(normal_[f], axis_[c]) < flat;
      });
      MeshChart chart;
      bool good = false;
      if (wide && all[c].size() <= options_.max_unfolded_faces) {
        chart = chart_of(all[c]);
        good = unfold(chart);
      }
      if (good) {
        take(std::move(chart));
      } else {
        for (const std::uint32_t f : all[c]) chart_of_[f] = kNoChart;
      }
    }
  }

  bool unfold(MeshChart& chart) const {
    std::vector<Double3> position;
    for (const std::uint32_t v : chart.vertices) position.push_back(mesh_.positions[v]);
    for (const std::uint32_t f : chart.faces)
      if (!(area_[f] > 0.0)) return false;
    const TriangleSpan span{position, chart.corners};
    if (!surface_topology(span).is_disk()) return false;
    try {
      chart.uv = parameterize(span, {}).uv;
    } catch (const Error&) {
      return false;  // faces too thin to solve for: a projection takes them
    }
    chart.unfolded = true;
    // To the scale of the surface.
    const ChartStretch raw = measure_stretch(mesh_, chart);
    if (!(raw.plane > 0.0)) return false;
    const double scale = std::sqrt(raw.surface / raw.plane);
    for (Double2& p : chart.uv) p = {p[0] * scale, p[1] * scale};
    const Double2 low = min_of(chart.uv), high = max_of(chart.uv);
    if (options_.max_extent > 0.0 && std::max(high[0] - low[0], high[1] - low[1]) > 1.5 * options_.max_extent)
      return false;
    for (std::size_t i = 0; i < chart.faces.size(); ++i) {
      const auto& t = chart.corners[i];
      if (twice_area(chart.uv[t[0]], chart.uv[t[1]], chart.uv[t[2]]) <
          2.0 * kCollapsedShare * area_[chart.faces[i]])
        return false;
    }
    return measure_stretch(mesh_, chart).l2() <= options_.max_stretch &&
           overlapping_faces(chart.uv, chart.corners).empty();
  }

  /// Returns the faces that overlap others, which have no chart any more.
  std::vector<std::uint32_t> take_projected() {
    std::vector<std::uint32_t> rest;
    const std::vector<std::vector<std::uint32_t>> all = gather();
    for (std::size_t c = 0; c < all.size(); ++c) {
      if (all[c].empty()) continue;
      MeshChart chart = chart_of(all[c]);
      project(chart, axis_[c]);
      const std::vector<std::uint32_t> over = overlapping_faces(chart.uv, chart.corners);
      if (!over.empty()) {
        std::vector<std::uint32_t> kept;
        std::size_t next = 0;
        for (std::uint32_t i = 0; i < chart.faces.size(); ++i) {
          if (next < over.size() && over[next] == i) {
            rest.push_back(chart.faces[i]);
            chart_of_[chart.faces[i]] = kNoChart;
            ++next;
          } else {
            kept.push_back(chart.faces[i]);
          }
        }
        chart = chart_of(std::move(kept));
        project(chart, axis_[c]);
      }
      take(std::move(chart));
    }
    return rest;
  }

  const TriangleSpan& mesh_;
  const ChartOptions& options_;
  std::vector<Double3> normal_;  ///< unit, zero without an area
  std::vector<double> area_;
  std::vector<std::uint32_t> across_;    ///< per half-edge the one of the neighbour
  std::vector<std::uint32_t> chart_of_;  ///< per face: index of axis_, kNoChart or kTaken
  std::vector<Double3> axis_;
  std::vector<FrameBox> box_;
  double cosine_ = 0.0;
  std::vector<MeshChart> out_;
};

}  // namespace

double ChartStretch::l2() const {
  return surface > 0.0 ? std::sqrt(stretch * plane) / surface : 1.0;
}

void ChartStretch::merge(const ChartStretch& other) {
  surface += other.surface, plane += other.plane, stretch += other.stretch;
}

std::vector<MeshChart> make_charts(const TriangleSpan& mesh, const ChartOptions& options) {
  return ChartMaker(mesh, options).run();
}

ChartStretch measure_stretch(const TriangleSpan& mesh, const MeshChart& chart) {
  ChartStretch sum;
  for (std::size_t i = 0; i < chart.faces.size(); ++i) {
    const auto& t = chart.corners[i];
    const auto& f = mesh.faces[chart.faces[i]];
    const Double3 &a = mesh.positions[f[0]], &b = mesh.positions[f[1]], &c = mesh.positions[f[2]];
    const double surface = 0.5 * norm(triangle_normal(a, b, c));
    const Double2 &p = chart.uv[t[0]], &q = chart.uv[t[1]], &r = chart.uv[t[2]];
    const double twice = twice_area(p, q, r);
    if (!(surface > 0.0) || twice == 0.0) continue;
    // Derivatives of the position along both axes of the plane: Sander et al. 2001, 3.
    const Double3 du = (a * (q[1] - r[1]) + b * (r[1] - p[1]) + c * (p[1] - q[1])) / twice;
    const Double3 dv = (a * (r[0] - q[0]) + b * (p[0] - r[0]) + c * (q[0] - p[0])) / twice;
    sum.surface += surface;
    sum.plane += 0.5 * std::fabs(twice);
    sum.stretch += surface * 0.5 * (dot(du, du) + dot(dv, dv));
  }
  return sum;
}

std::size_t count_flipped(const MeshChart& chart) {
  const double least =
      -kFlipRounding * std::max(chart.extent[0] * chart.extent[0], chart.extent[1] * chart.extent[1]);
  std::size_t flipped = 0;
  for (const auto& t : chart.corners)
    flipped += twice_area(chart.uv[t[0]], chart.uv[t[1]], chart.uv[t[2]]) < least;
  return flipped;
}

std::size_t count_overlapping(const MeshChart& chart) {
  return overlapping_faces(chart.uv, chart.corners).size();
}

}  // namespace tessera
