#include "stream/volume/toe_lines.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>

namespace tessera {
namespace {

constexpr double kNoHeight = -std::numeric_limits<double>::infinity();
/// Points of an outline nearer to each other than this share of its box are one: faces tell the point of an edge that they
/// share to the last bits only.
constexpr double kSamePoint = 1e-9;

double twice_area(const Double2& a, const Double2& b, const Double2& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}
Double2 between(const Double2& a, const Double2& b, double t) {
  return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])};
}
double distance(const Double2& a, const Double2& b) {
  return std::hypot(b[0] - a[0], b[1] - a[1]);
}

/// The part of a line that lies over a triangle; false where that is no more than a point. Cyrus and Beck, 1978.
bool clip_line(const Double2& a, const Double2& b, const std::array<Double2, 3>& shadow, double& begin,
               double& end) {
  begin = 0.0, end = 1.0;
  for (std::size_t e = 0; e < 3; ++e) {
    const Double2 &p = shadow[e], &q = shadow[(e + 1) % 3];
    const double from = twice_area(p, q, a), to = twice_area(p, q, b);
    if (from < 0.0 && to < 0.0) return false;
    if (from < 0.0) begin = std::max(begin, from / (from - to));
    if (to < 0.0) end = std::min(end, from / (from - to));
  }
  return begin < end;
}

/// Pieces of one edge become points with heights, and what no piece covers gaps.
class EdgeHeights {
 public:
  EdgeHeights(const Double2& a, const Double2& b, double same) : a_(a), b_(b), length_(distance(a, b)) {
    same_ = std::min(0.25, same / length_);
  }

  void add(std::span<const ToePiece> pieces) {
    at_ = {0.0, 1.0};
    for (const ToePiece& p : pieces) at_.push_back(p.begin), at_.push_back(p.end);
    std::sort(at_.begin(), at_.end());
    std::vector<double> kept = {0.0};
    for (const double t : at_)
      if (t > kept.back() + same_ && t < 1.0 - same_) kept.push_back(t);
    kept.push_back(1.0);
    at_ = std::move(kept);
    height_.assign(at_.size(), kNoHeight), steep_.assign(at_.size(), 0.0);
    for (const ToePiece& p : pieces) {
      const auto first = std::lower_bound(at_.begin(), at_.end(), p.begin - same_);
      for (auto i = first; i != at_.end() && *i <= p.end + same_; ++i) {
        const auto k = static_cast<std::size_t>(i - at_.begin());
        const double t = std::clamp((*i - p.begin) / (p.end - p.begin), 0.0, 1.0);
        height_[k] = std::max(height_[k], p.height[0] + t * (p.height[1] - p.height[0]));
        steep_[k] = std::max(steep_[k], p.steepness);
      }
    }
    double covered = 0.0;
    for (const ToePiece& p : pieces) {
      if (p.begin > covered + same_) gaps_.push_back({covered, p.begin});
      covered = std::max(covered, p.end);
    }
    if (covered < 1.0 - same_) gaps_.push_back({covered, 1.0});
  }

  /// Without the last point, which begins the next edge. \param last  height and steepness there
  void append(std::vector<ToePoint>& points, double along) const {
    for (std::size_t k = 0; k + 1 < at_.size(); ++k)
      points.push_back({between(a_, b_, at_[k]), height_[k], along + at_[k] * length_, steep_[k]});
  }
  double end_height() const { return height_.back(); }
  double end_steepness() const { return steep_.back(); }
  double length() const { return length_; }
  const std::vector<std::array<double, 2>>& gaps() const { return gaps_; }

 private:
  Double2 a_, b_;
  double length_, same_;
  std::vector<double> at_, height_, steep_;
  std::vector<std::array<double, 2>> gaps_;
};

/// Points without a height get one from those before and behind them.
void bridge_gaps(ToeRing& ring) {
  std::vector<ToePoint>& p = ring.points;
  const std::size_t n = p.size();
  std::size_t start = 0;
  while (start < n && p[start].height == kNoHeight) ++start;
  if (start == n) return;
  for (std::size_t k = 1; k <= n; ++k) {
    const std::size_t first = (start + k) % n;
    if (p[first].height != kNoHeight) continue;
    std::size_t end = k;
    while (p[(start + end) % n].height == kNoHeight) ++end;
    const ToePoint &from = p[(start + k - 1) % n], &to = p[(start + end) % n];
    const auto ahead = [&](const ToePoint& q) {
      const double d = q.along - from.along;
      return d < 0.0 ? d + ring.length : d;
    };
    const double width = ahead(to) > 0.0 ? ahead(to) : ring.length;
    for (std::size_t i = k; i < end; ++i) {
      ToePoint& q = p[(start + i) % n];
      q.height = from.height + ahead(q) / width * (to.height - from.height);
      q.steepness = std::max(from.steepness, to.steepness);
    }
    k = end;
  }
}

/// Gaps that meet are one, over the first corner too.
void measure_gaps(std::vector<std::array<double, 2>> gaps, ToeRing& ring, double same) {
  std::vector<std::array<double, 2>> joined;
  for (const auto& g : gaps) {
    ring.uncovered += g[1] - g[0];
    if (!joined.empty() && g[0] <= joined.back()[1] + same)
      joined.back()[1] = g[1];
    else
      joined.push_back(g);
  }
  if (joined.size() > 1 && joined.front()[0] <= same && joined.back()[1] >= ring.length - same) {
    joined.back()[1] += joined.front()[1];
    joined.erase(joined.begin());
  }
  for (const auto& g : joined) {
    if (g[1] - g[0] <= ring.widest_gap) continue;
    ring.widest_gap = g[1] - g[0];
    const auto next = std::upper_bound(ring.points.begin(), ring.points.end(), g[0],
                                       [](double at, const ToePoint& p) { return at < p.along; });
    const ToePoint& before = next == ring.points.begin() ? *next : *(next - 1);
    ring.gap_at = before.at;
  }
}

}  // namespace

bool ToePiece::operator<(const ToePiece& o) const {
  return std::tie(area, edge, begin, end, height[0], height[1], steepness) <
         std::tie(o.area, o.edge, o.begin, o.end, o.height[0], o.height[1], o.steepness);
}

void add_toe_pieces(const std::vector<PlanFace>& faces, const std::vector<AreaWindow>& windows,
                    std::vector<ToePiece>& pieces) {
  for (std::uint32_t k = 0; k < windows.size(); ++k) {
    if (windows[k].edges().empty()) continue;
    for (const PlanFace& face : faces) {
      if (face.triangle.facing() == 0) continue;
      for (const std::uint32_t e : windows[k].edges()) {
        const auto& [a, b] = windows[k].area().edges[e];
        ToePiece piece{k, e, 0.0, 1.0, {}, 0.0};
        if (!box_of(windows[k].area().edges[e]).meets(face.box) ||
            !clip_line(a, b, face.triangle.shadow(), piece.begin, piece.end))
          continue;
        piece.height[0] = face.triangle.height(between(a, b, piece.begin));
        piece.height[1] = face.triangle.height(between(a, b, piece.end));
        const Double2 g = face.triangle.gradient();
        piece.steepness = std::hypot(g[0], g[1]);
        pieces.push_back(piece);
      }
    }
  }
}

std::vector<ToeRing> toe_rings(const VolumeArea& area, std::uint32_t k, const std::vector<ToePiece>& pieces) {
  const double same =
      kSamePoint * std::max(area.box.high[0] - area.box.low[0], area.box.high[1] - area.box.low[1]);
  std::vector<ToeRing> rings;
  std::uint32_t edge = 0;
  for (const auto& corners : area.rings) {
    ToeRing ring;
    std::vector<std::array<double, 2>> gaps;
    double last_height = kNoHeight, last_steepness = 0.0;
    for (std::size_t c = 0; c < corners.size(); ++c, ++edge) {
      const auto [first, end] =
          std::equal_range(pieces.begin(), pieces.end(), ToePiece{k, edge, 0.0, 0.0, {}, 0.0},
                           [](const ToePiece& a, const ToePiece& b) {
                             return std::tie(a.area, a.edge) < std::tie(b.area, b.edge);
                           });
      EdgeHeights heights(corners[c], corners[(c + 1) % corners.size()], same);
      heights.add({first, end});
      const std::size_t at = ring.points.size();
      heights.append(ring.points, ring.length);
      // Of a corner both edges tell; the face of one may end a last bit before it.
      ring.points[at].height = std::max(ring.points[at].height, last_height);
      ring.points[at].steepness = std::max(ring.points[at].steepness, last_steepness);
      last_height = heights.end_height(), last_steepness = heights.end_steepness();
      for (const auto& g : heights.gaps())
        gaps.push_back({ring.length + g[0] * heights.length(), ring.length + g[1] * heights.length()});
      ring.length += heights.length();
    }
    ring.points.front().height = std::max(ring.points.front().height, last_height);
    ring.points.front().steepness = std::max(ring.points.front().steepness, last_steepness);
    measure_gaps(std::move(gaps), ring, same);
    bridge_gaps(ring);
    rings.push_back(std::move(ring));
  }
  return rings;
}

}  // namespace tessera
