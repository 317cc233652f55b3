#include "kernels/blends/rib_planes.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr int kMaxSteps = 64;  ///< from plane to plane, in search of a point's place
constexpr int kSecants = 12;
constexpr double kOnPlane = 1e-13;   ///< of the way from plane to plane: a place is found
constexpr int kStraightenings = 12;  ///< each filters twice as often as the one before
/// Of its width: how high a rib bends if its ends and origin are to make a plane.
constexpr double kFlatRib = 1e-3;

template <class T>
void smooth_values(std::vector<T>& v, bool closed, int times) {
  const std::size_t n = v.size();
  if (n < 3) return;
  std::vector<T> next(n);
  for (int k = 0; k < times; ++k) {
    for (std::size_t i = 0; i < n; ++i) {
      if (!closed && (i == 0 || i + 1 == n)) {
        next[i] = v[i];
        continue;
      }
      next[i] = v[i] * 0.5 + (v[(i + n - 1) % n] + v[(i + 1) % n]) * 0.25;
    }
    // An end follows its neighbours' line: else its own noise would stay as it is.
    if (!closed && n > 4) {
      next[0] = v[0] * 0.5 + (next[1] * 2.0 - next[2]) * 0.5;
      next[n - 1] = v[n - 1] * 0.5 + (next[n - 2] * 2.0 - next[n - 3]) * 0.5;
    }
    v.swap(next);
  }
}

RibPlane plane(const Double3& origin, const Double3& along, const Double3& up) {
  RibPlane p;
  p.origin = origin;
  p.along = unit_or_zero(along);
  p.across = unit_or_zero(cross(up, p.along));
  p.up = cross(p.along, p.across);
  return p;
}

}  // namespace

void smooth_line(std::vector<Double3>& line, bool closed, int times) {
  smooth_values(line, closed, times);
}
void smooth_line(std::vector<double>& line, bool closed, int times) {
  smooth_values(line, closed, times);
}

void smooth_curve(std::vector<Double3>& line, bool closed, int times) {
  const std::size_t n = line.size();
  if (n < 5) return;
  // Beyond an end the curve goes on as a parabola.
  const auto at = [&](std::ptrdiff_t i) {
    const auto size = static_cast<std::ptrdiff_t>(n);
    if (closed) return line[static_cast<std::size_t>((i + size) % size)];
    if (i == -1) return line[0] * 3.0 - line[1] * 3.0 + line[2];
    if (i == size) return line[n - 1] * 3.0 - line[n - 2] * 3.0 + line[n - 3];
    return line[static_cast<std::size_t>(i)];
  };
  std::vector<Double3> next(n);
  for (int k = 0; k < times; ++k) {
    for (std::size_t j = 0; j < n; ++j) {
      const auto i = static_cast<std::ptrdiff_t>(j);
      next[j] = line[j];
      if (!closed && (j == 0 || j + 1 == n)) continue;
      next[j] = line[j] * 0.625 + (at(i - 1) + at(i + 1)) * 0.25 - (at(i - 2) + at(i + 2)) * 0.0625;
    }
    line.swap(next);
  }
}

RibPlanes::RibPlanes(std::vector<RibPlane> planes, bool closed)
    : planes_(std::move(planes)), closed_(closed) {
  const std::size_t n = planes_.size(), pieces = closed ? n : n - 1;
  for (std::size_t i = 0; i < pieces; ++i)
    spacing_ += norm(planes_[(i + 1) % n].origin - planes_[i].origin) / static_cast<double>(pieces);
}

Double3 RibPlanes::at(std::size_t rib, double x, double y) const {
  const RibPlane& p = planes_[rib];
  return p.origin + p.across * x + p.up * y;
}

RibPosition RibPlanes::between(std::size_t rib, const Double3& p) const {
  const RibPlane &a = planes_[rib], &b = planes_[(rib + 1) % planes_.size()];
  const double chord = norm(b.origin - a.origin);
  // Cubic after Hermite: within (turn of the spine)^4 / 400 of its radius where the spine is an arc.
  const auto origin = [&](double t) {
    const double s = 1.0 - t;
    return a.origin * (s * s * (1.0 + 2.0 * t)) + b.origin * (t * t * (1.0 + 2.0 * s)) +
           (a.along * (s * s * t) - b.along * (t * t * s)) * chord;
  };
  const auto signed_height = [&](double t) {
    return dot(p - origin(t), unit_or_zero(a.along * (1.0 - t) + b.along * t));
  };
  double low = 0.0, high = 1.0, at_low = signed_height(0.0), at_high = signed_height(1.0), t = 0.0;
  for (int k = 0; k < kSecants && at_low != at_high; ++k) {
    t = std::clamp(low + (high - low) * (at_low / (at_low - at_high)), low, high);
    const double here = signed_height(t);
    if (std::fabs(here) <= kOnPlane * chord) break;
    if (here > 0.0) {
      low = t, at_low = here, at_high *= k % 2 ? 0.5 : 1.0;
    } else {
      high = t, at_high = here, at_low *= k % 2 ? 0.5 : 1.0;
    }
  }
  const RibPlane at = plane(origin(t), a.along * (1.0 - t) + b.along * t, a.up * (1.0 - t) + b.up * t);
  const Double3 d = p - at.origin;
  return {static_cast<double>(rib) + t, dot(d, at.across), dot(d, at.up)};
}

std::optional<RibPosition> RibPlanes::locate(const Double3& p, std::size_t near) const {
  const std::size_t n = planes_.size();
  std::size_t i = near;
  for (int step = 0; step < kMaxSteps; ++step) {
    if (height(i, p) < 0.0) {
      if (i == 0 && !closed_) {
        const Double3 d = p - planes_[0].origin;
        return RibPosition{height(0, p) / spacing_, dot(d, planes_[0].across), dot(d, planes_[0].up)};
      }
      i = (i + n - 1) % n;
      if (height(i, p) >= 0.0) return between(i, p);
      continue;
    }
    if (i + 1 == n && !closed_) {
      const RibPlane& last = planes_[n - 1];
      const Double3 d = p - last.origin;
      return RibPosition{static_cast<double>(n - 1) + height(n - 1, p) / spacing_, dot(d, last.across),
                         dot(d, last.up)};
    }
    if (height((i + 1) % n, p) < 0.0) return between(i, p);
    i = (i + 1) % n;
  }
  return std::nullopt;
}

RibPlanes planes_across(std::vector<Double3> spine, std::vector<Double3> up, bool closed, std::size_t ribs,
                        int smooths) {
  smooth_curve(spine, closed, smooths);
  smooth_curve(up, closed, smooths);
  const std::size_t n = spine.size(), pieces = closed ? n : n - 1;
  if (ribs == 0) ribs = n;
  std::vector<double> gone(pieces + 1, 0.0);
  for (std::size_t i = 0; i < pieces; ++i) gone[i + 1] = gone[i] + norm(spine[(i + 1) % n] - spine[i]);
  std::vector<Double3> point(ribs), out(ribs);
  const double steps = static_cast<double>(closed ? ribs : ribs - 1);
  std::size_t i = 0;
  for (std::size_t k = 0; k < ribs; ++k) {
    const double want = gone.back() * static_cast<double>(k) / steps;
    while (i + 1 < pieces && gone[i + 1] < want) ++i;
    const double piece = gone[i + 1] - gone[i];
    const double t = piece > 0.0 ? std::clamp((want - gone[i]) / piece, 0.0, 1.0) : 0.0;
    const std::size_t j = (i + 1) % n;
    point[k] = spine[i] * (1.0 - t) + spine[j] * t;
    out[k] = up[i] * (1.0 - t) + up[j] * t;
  }
  std::vector<RibPlane> planes(ribs);
  for (std::size_t k = 0; k < ribs; ++k) {
    const bool first = k == 0 && !closed, last = k + 1 == ribs && !closed;
    Double3 along = point[last ? k : (k + 1) % ribs] - point[first ? k : (k + ribs - 1) % ribs];
    // One-sided differences lag by half a step: extrapolate, so that an arc has its tangents at its ends too.
    if (first && ribs > 2) along = (point[1] - point[0]) * 1.5 - (point[2] - point[1]) * 0.5;
    if (last && ribs > 2) along = (point[k] - point[k - 1]) * 1.5 - (point[k - 1] - point[k - 2]) * 0.5;
    planes[k] = plane(point[k], along, out[k]);
  }
  return {std::move(planes), closed};
}

RibRun longest_run(std::span<const std::uint8_t> sound, bool closed) {
  const std::size_t n = sound.size();
  RibRun best;
  std::size_t run = 0;
  for (std::size_t i = 0; i < (closed ? 2 * n : n); ++i) {
    run = sound[i % n] ? run + 1 : 0;
    if (run > best.count && run <= n) best = {i + 1 - run, run};
  }
  return best;
}

bool ribs_cross(const RibPlanes& planes, const RibEnds& ends, double minimum) {
  const std::size_t n = planes.size(), pieces = planes.closed() ? n : n - 1;
  for (std::size_t i = 0; i < pieces; ++i) {
    const std::size_t j = (i + 1) % n;
    for (const std::vector<Double3>* line : {&ends.left, &ends.right})
      if (dot((*line)[j] - planes[i].origin, planes[i].along) < minimum ||
          dot(planes[j].origin - (*line)[i], planes[j].along) < minimum)
        return true;
  }
  return false;
}

bool straighten_ribs(RibPlanes& planes, const RibEnds& ends, double minimum) {
  for (int round = 0; round < kStraightenings; ++round) {
    RibEnds line = ends;
    smooth_line(line.left, planes.closed(), 1 << round);
    smooth_line(line.right, planes.closed(), 1 << round);
    std::vector<RibPlane> tilted(planes.size());
    for (std::size_t i = 0; i < planes.size(); ++i) {
      const Double3 rib = line.right[i] - line.left[i];
      const Double3 sagitta = planes[i].origin - (line.left[i] + line.right[i]) * 0.5;
      const bool flat = norm(sagitta) < kFlatRib * norm(rib);
      Double3 normal = cross(rib, flat ? planes[i].up : sagitta);
      if (dot(normal, planes[i].along) < 0.0) normal = -normal;
      tilted[i] = plane(planes[i].origin, normal, planes[i].up);
    }
    const RibPlanes next(std::move(tilted), planes.closed());
    if (ribs_cross(next, line, minimum)) continue;
    planes = next;
    return true;
  }
  return false;
}

}  // namespace tessera
