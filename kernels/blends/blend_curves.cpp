#include "kernels/blends/blend_curves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "octree/error.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

constexpr double kSameDirection = 0.8;  ///< cosine between lines of least curvature of neighbours: 37 degrees
constexpr double kSameSlice = 0.7;      ///< the same within a slice
constexpr double kFacing = -0.1;  ///< cosine of normals within a slice: a blend turns by a half turn at most
constexpr int kCentrings = 4;
constexpr double kEndShare = 0.5;  ///< of the ball: so near its end a band bends as what follows does
constexpr std::size_t kMinSteps = 4;
constexpr double kMinLength = 2.0;  ///< of its width
/// Of the half width, and steps: what a grid takes to each side.
constexpr double kSideShare = 1.15, kSideSteps = 2.0;
/// Between an end and another grid's side: faces of both holes, and one between.
constexpr double kApartSteps = 3.0;
constexpr int kMaxCurves = 256;  ///< of one band
/// Share of a slice that was seen before: the track runs into itself or another.
constexpr double kAgain = 0.5;

using Cell = std::array<std::int64_t, 3>;

/// One band and the tracks through it.
class Band {
 public:
  Band(std::span<const BandVertex> all, std::vector<std::uint32_t> members, const BandOptions& options,
       double step)
      : all_(all), members_(std::move(members)), options_(options), step_(step) {
    cell_ = std::max(options.radius, step);
    for (const std::uint32_t v : members_) cells_[cell_of(all_[v].position)].push_back(v);
    for (const std::uint32_t v : members_) seen_[v] = 0;
  }

  void trace(std::vector<BlendCurve>& out) {
    std::vector<std::uint32_t> seeds;
    for (const std::uint32_t v : members_)
      if (std::fabs(all_[v].across) * options_.radius >= options_.sure_angle) seeds.push_back(v);
    if (seeds.size() < options_.min_sure) return;
    std::sort(seeds.begin(), seeds.end(), [&](std::uint32_t a, std::uint32_t b) {
      const double x = std::fabs(all_[a].across), y = std::fabs(all_[b].across);
      return x != y ? x > y : a < b;
    });
    int curves = 0;
    for (const std::uint32_t seed : seeds) {
      if (seen_[seed] != 0) continue;
      if (++curves > kMaxCurves) break;
      number_ = static_cast<std::uint32_t>(curves);
      if (auto curve = from(seed)) out.push_back(std::move(*curve));
    }
  }

 private:
  struct Slice {
    Double3 centre{}, normal{}, along{};
    double half_width = 0.0;
    std::size_t count = 0, before = 0;  ///< members, and those that were seen before
    std::vector<std::uint32_t> members;
  };

  Cell cell_of(const Double3& p) const {
    Cell c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<std::int64_t>(std::floor(p[k] / cell_));
    return c;
  }

  /// The slice of the band across `along` at `at`, centred.
  std::optional<Slice> slice(Double3 at, Double3 along, const Double3& normal, double width) const {
    Slice s;
    s.centre = at, s.along = along, s.normal = normal;
    double radius = std::max(width, options_.radius);
    for (int round = 0; round < kCentrings; ++round) {
      gather(s, radius);
      if (s.members.size() < 2) return std::nullopt;
      Double3 line{}, up{};
      double weight = 0.0, low = 0.0, high = 0.0;
      Double3 sum{};
      for (const std::uint32_t v : s.members) {
        const BandVertex& b = all_[v];
        const double w = std::fabs(b.across);
        const double sign = dot(b.along, s.along) < 0.0 ? -1.0 : 1.0;
        line = line + b.along * (sign * w);
        up = up + b.normal * w;
        sum = sum + (b.position - s.centre) * w;
        weight += w;
      }
      line = unit_or_zero(line), up = unit_or_zero(up);
      if (dot(line, line) == 0.0 || dot(up, up) == 0.0) return std::nullopt;
      Double3 off = sum * (1.0 / weight);
      off = off - s.along * dot(off, s.along);
      const Double3 side = unit_or_zero(cross(up, line));
      for (const std::uint32_t v : s.members) {
        const double x = dot(all_[v].position - s.centre - off, side);
        low = std::min(low, x), high = std::max(high, x);
      }
      // The middle between both sides: what is left of a weight's lean to where vertices are dense.
      s.centre = s.centre + off + side * (0.5 * (low + high));
      s.half_width = 0.5 * (high - low);
      s.along = line;
      s.normal = unit_or_zero(up - line * dot(up, line));
      radius = std::max(options_.radius, 1.5 * s.half_width + step_);
    }
    s.count = s.members.size();
    for (const std::uint32_t v : s.members) {
      const std::uint32_t by = seen_.at(v);
      s.before += by != 0 && by != number_;
    }
    return s;
  }

  void gather(Slice& s, double radius) const {
    s.members.clear();
    const Double3 r = {radius, radius, radius};
    const Cell a = cell_of(s.centre - r), b = cell_of(s.centre + r);
    for (std::int64_t z = a[2]; z <= b[2]; ++z)
      for (std::int64_t y = a[1]; y <= b[1]; ++y)
        for (std::int64_t x = a[0]; x <= b[0]; ++x) {
          const auto cell = cells_.find({x, y, z});
          if (cell == cells_.end()) continue;
          for (const std::uint32_t v : cell->second) {
            const Double3 d = all_[v].position - s.centre;
            if (std::fabs(dot(d, s.along)) > 0.75 * step_ || dot(d, d) > radius * radius) continue;
            if (std::fabs(dot(all_[v].along, s.along)) < kSameSlice ||
                dot(all_[v].normal, s.normal) < kFacing)
              continue;
            s.members.push_back(v);
          }
        }
    std::sort(s.members.begin(), s.members.end());
  }

  std::optional<BlendCurve> from(std::uint32_t seed) {
    const BandVertex& b = all_[seed];
    seen_[seed] = number_;
    const auto first = slice(b.position, b.along, b.normal, options_.radius);
    if (!first || 2 * first->before > first->count) return std::nullopt;
    mark(*first);
    BlendCurve out;
    out.key = b.key;
    out.convex = b.across > 0.0;
    std::vector<Slice> ahead = walk(*first, 1.0, out.closed);
    std::vector<Slice> behind;
    if (!out.closed) {
      bool closed = false;
      behind = walk(*first, -1.0, closed);
    }
    std::vector<Slice> all(behind.rbegin(), behind.rend());
    all.push_back(*first);
    all.insert(all.end(), ahead.begin(), ahead.end());
    if (!out.closed) trim(all);
    if (all.size() < kMinSteps) return std::nullopt;
    for (const Slice& s : all) {
      out.centre.push_back(s.centre);
      out.normal.push_back(s.normal);
      out.half_width += s.half_width / static_cast<double>(all.size());
    }
    if (static_cast<double>(all.size()) * step_ < kMinLength * 2.0 * out.half_width) return std::nullopt;
    return out;
  }

  /// What bends at the ends as their surroundings do.
  void trim(std::vector<Slice>& all) const {
    const auto cut = static_cast<std::size_t>(std::ceil(kEndShare * options_.radius / step_));
    if (all.size() <= 2 * cut) return all.clear();
    all.erase(all.end() - static_cast<std::ptrdiff_t>(cut), all.end());
    all.erase(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(cut));
  }

  std::vector<Slice> walk(const Slice& first, double sign, bool& closed) {
    std::vector<Slice> out;
    Slice at = first;
    at.along = at.along * sign;
    const Double3 begin = at.along;
    for (std::size_t k = 0; k < members_.size() + 4; ++k) {
      const Double3 next = at.centre + at.along * step_;
      auto s = slice(next, at.along, at.normal, 1.5 * at.half_width + step_);
      if (!s) break;
      // Centring may have pulled it along: keep it a step ahead of the one before.
      const double gone = dot(s->centre - at.centre, at.along);
      if (gone < 0.4 * step_ || gone > 1.6 * step_) break;
      if (static_cast<double>(s->before) > kAgain * static_cast<double>(s->count)) break;
      if (k >= kMinSteps && norm(s->centre - first.centre) < 0.75 * step_ &&
          dot(s->along, begin) > kSameSlice) {
        closed = true;
        break;
      }
      mark(*s);
      out.push_back(*s);
      at = *s;
    }
    if (sign < 0.0)
      for (Slice& s : out) s.along = -s.along;
    return out;
  }

  void mark(const Slice& s) {
    for (const std::uint32_t v : s.members)
      if (seen_[v] == 0) seen_[v] = number_;
  }

  std::span<const BandVertex> all_;
  std::vector<std::uint32_t> members_;
  BandOptions options_;
  double step_, cell_ = 0.0;
  std::uint32_t number_ = 0;
  std::map<Cell, std::vector<std::uint32_t>> cells_;
  std::map<std::uint32_t, std::uint32_t> seen_;  ///< the track that passed a member first, 0: none
};

/// How far to the side a grid reaches, its flank rows and what is cleared around it included.
double side_width(const BlendCurve& t, double step) {
  return kSideShare * t.half_width + kSideSteps * step;
}

/// Tracks that meet in a corner end short of each other, so that their grids do not reach the same faces.
void keep_apart(std::vector<BlendCurve>& curves, double step) {
  double widest = 0.0;
  for (const BlendCurve& t : curves) widest = std::max(widest, side_width(t, step));
  const double cell = widest + kApartSteps * step;
  const auto cell_of = [&](const Double3& p) {
    Cell c;
    for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<std::int64_t>(std::floor(p[k] / cell));
    return c;
  };
  struct Sample {
    std::size_t curve;
    Double3 at;
  };
  std::map<Cell, std::vector<Sample>> cells;
  for (std::size_t t = 0; t < curves.size(); ++t)
    for (const Double3& p : curves[t].centre) cells[cell_of(p)].push_back({t, p});
  const auto is_near_another = [&](std::size_t t, const Double3& p) {
    const Cell c = cell_of(p);
    for (std::int64_t z = c[2] - 1; z <= c[2] + 1; ++z)
      for (std::int64_t y = c[1] - 1; y <= c[1] + 1; ++y)
        for (std::int64_t x = c[0] - 1; x <= c[0] + 1; ++x) {
          const auto found = cells.find({x, y, z});
          if (found == cells.end()) continue;
          for (const Sample& s : found->second) {
            if (s.curve == t) continue;
            const double radius =
                std::max(side_width(curves[t], step), side_width(curves[s.curve], step)) + kApartSteps * step;
            if (squared_distance(s.at, p) < radius * radius) return true;
          }
        }
    return false;
  };
  std::vector<std::pair<std::size_t, std::size_t>> kept(curves.size());
  for (std::size_t t = 0; t < curves.size(); ++t) {
    std::size_t begin = 0, end = curves[t].centre.size();
    while (!curves[t].closed && begin < end && is_near_another(t, curves[t].centre[begin])) ++begin;
    while (!curves[t].closed && begin < end && is_near_another(t, curves[t].centre[end - 1])) --end;
    // Beside another one all along: then who comes first has the faces.
    if (end - begin < kMinSteps) begin = 0, end = curves[t].centre.size();
    kept[t] = {begin, end};
  }
  for (std::size_t t = 0; t < curves.size(); ++t) {
    const auto cut = [&](std::vector<Double3>& line) {
      line = std::vector<Double3>(line.begin() + static_cast<std::ptrdiff_t>(kept[t].first),
                                  line.begin() + static_cast<std::ptrdiff_t>(kept[t].second));
    };
    cut(curves[t].centre);
    cut(curves[t].normal);
  }
}

}  // namespace

bool is_in_band(double across, double minimum, const BandOptions& o) {
  return std::fabs(across) * o.radius >= o.min_angle && std::fabs(minimum) <= o.min_ratio * std::fabs(across);
}

std::vector<BlendCurve> trace_bands(std::span<const BandVertex> band,
                                    std::span<const std::pair<std::uint32_t, std::uint32_t>> links,
                                    const BandOptions& options, double step) {
  UnionFind sets(band.size());
  for (const auto& [a, b] : links)
    if ((band[a].across > 0.0) == (band[b].across > 0.0) &&
        std::fabs(dot(band[a].along, band[b].along)) >= kSameDirection)
      sets.unite(a, b);
  std::map<std::uint32_t, std::vector<std::uint32_t>> bands;
  for (std::uint32_t v = 0; v < band.size(); ++v) bands[sets.find(v)].push_back(v);
  std::vector<BlendCurve> out;
  for (auto& [root, members] : bands)
    if (members.size() >= options.min_sure) Band(band, std::move(members), options, step).trace(out);
  keep_apart(out, step);
  std::sort(out.begin(), out.end(), [](const BlendCurve& a, const BlendCurve& b) { return a.key < b.key; });
  return out;
}

BlendCurve curve_through(std::span<const Double3> points, bool closed, double step) {
  if (points.size() < 2) throw InputError("a spine has two points at least");
  const std::size_t n = points.size(), pieces = closed ? n : n - 1;
  const auto at = [&](std::ptrdiff_t i) -> const Double3& {
    const auto size = static_cast<std::ptrdiff_t>(n);
    return points[static_cast<std::size_t>(closed ? (i + size) % size
                                                  : std::clamp<std::ptrdiff_t>(i, 0, size - 1))];
  };
  // Catmull and Rom's interpolating spline, densely, then cut into even steps.
  std::vector<Double3> dense;
  constexpr int kDense = 64;
  for (std::size_t i = 0; i < pieces; ++i) {
    const auto k = static_cast<std::ptrdiff_t>(i);
    const Double3 p0 = at(k - 1), p1 = at(k), p2 = at(k + 1), p3 = at(k + 2);
    if (!(norm(p2 - p1) > 0.0)) throw InputError("two points of a spine that follow each other are the same");
    for (int j = 0; j < kDense; ++j) {
      const double t = static_cast<double>(j) / kDense;
      dense.push_back(p1 + (p2 - p0) * (0.5 * t) + (p0 * 2.0 - p1 * 5.0 + p2 * 4.0 - p3) * (0.5 * t * t) +
                      (p1 * 3.0 - p0 - p2 * 3.0 + p3) * (0.5 * t * t * t));
    }
  }
  dense.push_back(at(static_cast<std::ptrdiff_t>(pieces)));
  double length = 0.0;
  for (std::size_t i = 1; i < dense.size(); ++i) length += norm(dense[i] - dense[i - 1]);
  const double steps = std::max(closed ? 4.0 : 2.0, std::round(length / step));
  BlendCurve out;
  out.closed = closed;
  const auto count = static_cast<std::size_t>(steps) + (closed ? 0 : 1);
  double gone = 0.0;
  std::size_t i = 1;
  for (std::size_t k = 0; k < count; ++k) {
    const double want = length * static_cast<double>(k) / steps;
    while (i + 1 < dense.size() && gone + norm(dense[i] - dense[i - 1]) < want) {
      gone += norm(dense[i] - dense[i - 1]);
      ++i;
    }
    const double piece = norm(dense[i] - dense[i - 1]);
    const double t = piece > 0.0 ? std::clamp((want - gone) / piece, 0.0, 1.0) : 0.0;
    out.centre.push_back(dense[i - 1] + (dense[i] - dense[i - 1]) * t);
  }
  out.normal.assign(out.centre.size(), Double3{});
  return out;
}

}  // namespace tessera
