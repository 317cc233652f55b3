#include "kernels/survey/line_clip.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

/// Where the way from a to b meets a side that it crosses: the same bits either way round.
Double2 meet_side(Double2 a, Double2 b, double side) {
  if (b < a) std::swap(a, b);
  const double t = std::clamp((side - a[0]) / (b[0] - a[0]), 0.0, 1.0);
  return {side, std::clamp(a[1] + t * (b[1] - a[1]), std::min(a[1], b[1]), std::max(a[1], b[1]))};
}

/// Cuts the way of one point after the other.
class StripCutter {
 public:
  StripCutter(double min, double max) : min_(min), max_(max) {}
  void begin(const Double2& at) {
    at_ = at;
    if (zone(at) == 0) piece_.push_back(at);
  }
  void go_to(const Double2& to) {
    const int from_zone = zone(at_), to_zone = zone(to);
    if (from_zone != 0 && from_zone != to_zone) add(meet_side(at_, to, side(from_zone)));
    if (to_zone == 0) {
      add(to);
    } else if (from_zone != to_zone) {
      add(meet_side(at_, to, side(to_zone)));
      end();
    }
    at_ = to;
  }
  void end() {
    if (piece_.size() >= 2) pieces_.push_back({std::move(piece_), false});
    piece_.clear();
  }
  std::vector<ClippedLine> take() {
    end();
    return std::move(pieces_);
  }
  int zone(const Double2& p) const { return p[0] < min_ ? -1 : p[0] > max_ ? 1 : 0; }

 private:
  double side(int zone) const { return zone < 0 ? min_ : max_; }
  void add(const Double2& p) {
    if (piece_.empty() || piece_.back() != p) piece_.push_back(p);
  }

  double min_, max_;
  Double2 at_{};
  std::vector<Double2> piece_;
  std::vector<ClippedLine> pieces_;
};

}  // namespace

std::vector<ClippedLine> clip_line(const std::vector<Double2>& points, bool closed, double min, double max) {
  if (points.size() < 2) return {};
  StripCutter cutter(min, max);
  const auto outside =
      std::find_if(points.begin(), points.end(), [&](const Double2& p) { return cutter.zone(p) != 0; });
  if (outside == points.end()) return {{points, closed}};
  // A closed line is gone round from a point outside, so that no piece is torn at its beginning.
  const std::size_t count = points.size(),
                    first = closed ? static_cast<std::size_t>(outside - points.begin()) : 0;
  cutter.begin(points[first]);
  for (std::size_t k = 1; k < count + (closed ? 1 : 0); ++k) cutter.go_to(points[(first + k) % count]);
  return cutter.take();
}

}  // namespace tessera
