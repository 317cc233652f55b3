#include "kernels/certify/distance_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "kernels/mesh/box_mask.h"
#include "octree/lists.h"
#include "octree/vector.h"

namespace tessera {
namespace {

using SampledFace = std::array<std::uint32_t, 3>;

/// Few faces need few points: as many as tell the mean on each of them.
constexpr std::size_t kMinSamples = 1024, kSamplesPerFace = 16;
// Powers of the plastic number: the additive sequence whose points keep farthest apart.
constexpr double kR2u = 0.75487766624669276005, kR2v = 0.56984029099805326591;
constexpr double kWider = 1.0 + 0x1p-20;  ///< a bound, so that rounding hides no face

double fraction(double v) {
  return v - std::floor(v);
}

/// In [0, 1), of a number (Steele, Lea, Flood 2014): where in its stratum a point lies, so that no period of the faces
/// is met.
double jitter(std::uint64_t i) {
  std::uint64_t x = (i + 1) * 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return static_cast<double>((x ^ (x >> 31)) >> 11) * 0x1p-53;
}

/// The part of a face in a box: a convex polygon of up to nine corners, or a segment of two.
struct SampledPart {
  std::array<Double3, 9> at;
  std::size_t corners = 0;
  bool segment = false;
  double area = 0.0;  ///< of a segment its length

  void measure() {
    area = 0.0;
    if (segment && corners == 2) area = norm(at[1] - at[0]);
    for (std::size_t i = 1; i + 1 < corners; ++i) area += triangle(i);
  }
  double triangle(std::size_t i) const { return 0.5 * norm(cross(at[i] - at[0], at[i + 1] - at[0])); }
  Double3 point(double u, double v) const {
    if (segment) return at[0] + (at[1] - at[0]) * u;
    // Which triangle of the fan: by the share of the area; what is left of the share is even again.
    double share = u * area;
    std::size_t i = 1;
    for (; i + 2 < corners && share >= triangle(i); ++i) share -= triangle(i);
    const double own = triangle(i);
    double s = own > 0.0 ? std::clamp(share / own, 0.0, 1.0) : 0.0, t = v;
    if (s + t > 1.0) s = 1.0 - s, t = 1.0 - t;
    return at[0] + (at[i] - at[0]) * s + (at[i + 1] - at[0]) * t;
  }
};

SampledPart part_of(const SurfaceFaces& surface, const SampledFace& face, const Box3* core) {
  SampledPart part;
  part.segment = face[1] == face[2];
  part.corners = part.segment ? 2 : 3;
  for (std::size_t c = 0; c < part.corners; ++c) part.at[c] = surface.position[face[c]];
  bool whole = true;
  for (std::size_t c = 0; core != nullptr && c < part.corners; ++c)
    for (std::size_t k = 0; k < 3; ++k)
      whole = whole && part.at[c][k] >= core->low[k] && part.at[c][k] <= core->high[k];
  for (std::size_t k = 0; !whole && k < 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      const double limit = sign > 0.0 ? core->high[k] : -core->low[k];
      SampledPart cut;
      cut.segment = part.segment;
      const std::size_t sides = part.segment ? 1 : part.corners;
      for (std::size_t i = 0; i < part.corners; ++i) {
        const Double3 &a = part.at[i], &b = part.at[i + 1 == part.corners ? 0 : i + 1];
        const double u = limit - sign * a[k], v = limit - sign * b[k];
        if (u >= 0.0) cut.at[cut.corners++] = a;
        if (i < sides && ((u > 0.0 && v < 0.0) || (u < 0.0 && v > 0.0)))
          cut.at[cut.corners++] = a + (b - a) * (u / (u - v));
      }
      part = cut;
    }
  part.measure();
  return part;
}

/// Area of the part of every face in the box, the same bits as part_of() has; most faces are all in it or all beyond a
/// side of it.
std::vector<double> areas_in(const SurfaceFaces& surface, const Box3* core) {
  std::vector<std::uint8_t> sides(surface.position.size(), 0);
  if (core != nullptr) sides = beyond_sides(surface.position, core->low, core->high);
  std::vector<double> area;
  area.reserve(surface.faces.size());
  for (const SampledFace& face : surface.faces) {
    const unsigned s = sides[face[0]], t = sides[face[1]], u = sides[face[2]];
    if ((s & t & u) != 0) {
      area.push_back(0.0);
    } else if ((s | t | u) == 0 && face[1] != face[2]) {
      const Double3& a = surface.position[face[0]];
      area.push_back(0.5 * norm(cross(surface.position[face[1]] - a, surface.position[face[2]] - a)));
    } else {
      area.push_back(part_of(surface, face, core).area);
    }
  }
  return area;
}

/// Points in the cells of a grid, to pick the faces that come within a radius of one.
class PointGrid {
 public:
  /// \param radius  of each point, by which its surroundings count
  PointGrid(std::span<const Double3> at, std::span<const double> radius) {
    Double3 high;
    low_.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < at.size(); ++i) {
      widest_ = std::max(widest_, radius[i]);
      for (std::size_t k = 0; k < 3; ++k)
        low_[k] = std::min(low_[k], at[i][k]), high[k] = std::max(high[k], at[i][k]);
    }
    mask_ = BoxMask(low_, high, kMaskCells);
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Double3 r = {radius[i], radius[i], radius[i]};
      mask_.mark(at[i] - r, at[i] + r);
    }
    const auto along = std::clamp(std::sqrt(static_cast<double>(at.size())), kMinCells, kMaxCells);
    const double extent = std::max({high[0] - low_[0], high[1] - low_[1], high[2] - low_[2]});
    per_cell_ = extent > 0.0 ? along / extent : 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      cells_[k] = 1 + static_cast<std::size_t>((high[k] - low_[k]) * per_cell_);
    points_ = make_lists<Point>(cells_[0] * cells_[1] * cells_[2], [&](const auto& put) {
      for (std::size_t i = 0; i < at.size(); ++i)
        put((cell(at[i][2], 2) * cells_[1] + cell(at[i][1], 1)) * cells_[0] + cell(at[i][0], 0),
            {at[i], radius[i]});
    });
  }

  /// Marked where a point is near.
  [[nodiscard]] const BoxMask& mask() const { return mask_; }
  /// Whether the box may come within the radius of a point.
  [[nodiscard]] bool is_near(const Double3& low, const Double3& high) const {
    std::size_t from[3], to[3];
    for (std::size_t k = 0; k < 3; ++k)
      from[k] = cell(low[k] - widest_, k), to[k] = cell(high[k] + widest_, k);
    for (std::size_t z = from[2]; z <= to[2]; ++z)
      for (std::size_t y = from[1]; y <= to[1]; ++y) {
        const std::size_t row = (z * cells_[1] + y) * cells_[0];
        for (std::size_t i = points_.first[row + from[0]]; i < points_.first[row + to[0] + 1]; ++i) {
          const Point& p = points_.item[i];
          bool near = true;
          for (std::size_t k = 0; k < 3; ++k)
            near = near && p.at[k] >= low[k] - p.radius && p.at[k] <= high[k] + p.radius;
          if (near) return true;
        }
      }
    return false;
  }

 private:
  static constexpr std::size_t kMaskCells = 64;
  static constexpr double kMinCells = 4.0, kMaxCells = 64.0;  ///< along the longest side
  struct Point {
    Double3 at;
    double radius;
  };
  std::size_t cell(double x, std::size_t k) const {
    return static_cast<std::size_t>(
        std::clamp((x - low_[k]) * per_cell_, 0.0, static_cast<double>(cells_[k]) - 0.5));
  }

  BoxMask mask_{{}, {}, 1};
  Double3 low_{};
  double widest_ = 0.0, per_cell_ = 0.0;
  std::array<std::size_t, 3> cells_{};
  Lists<Point> points_;  ///< of the cells
};

}  // namespace

SurfaceSamples spread_samples(const SurfaceFaces& surface, const Box3* core, std::size_t count) {
  SurfaceSamples out;
  const std::vector<double> area = areas_in(surface, core);
  double sum = 0.0;
  for (const double a : area) sum += a;
  if (!(sum > 0.0) || !std::isfinite(sum)) return out;
  out.at.reserve(count), out.face.reserve(count);
  const double stratum = sum / static_cast<double>(count);
  double before = 0.0;  // of the faces before this one
  std::size_t f = 0, on = 0;
  SampledPart part;
  for (std::size_t i = 0; i < count; ++i) {
    const double at = stratum * (static_cast<double>(i) + jitter(i));
    while (f + 1 < area.size() && before + area[f] <= at) before += area[f++];
    // The sum's rounding may lead beyond the last face that has an area.
    if (area[f] > 0.0 && (f != on || part.corners == 0))
      part = part_of(surface, surface.faces[f], core), on = f;
    const auto n = static_cast<double>(i);
    out.at.push_back(part.point(fraction(0.5 + n * kR2u), fraction(0.5 + n * kR2v)));
    out.face.push_back(static_cast<std::uint32_t>(on));
  }
  return out;
}

std::size_t samples_of(const CertificateOptions& options, std::size_t faces, std::size_t other_faces) {
  return std::min(options.samples, kMinSamples + kSamplesPerFace * (faces + other_faces));
}

void measure_samples(const SurfaceSamples& samples, bool segments, const ClosestFaces& reference,
                     const CertificateOptions& options, DeviationReport& report) {
  if (samples.at.empty()) return;
  const double each = report.area / static_cast<double>(samples.at.size());
  const double unit = segments ? std::sqrt(options.area_unit) : options.area_unit;
  std::array<std::uint64_t, kDeviationBins + 2> count{};
  double squares = 0.0;
  std::uint32_t hint = ClosestFaces::kNone;
  constexpr std::size_t kPerCheck = 256;
  for (std::size_t i = 0; i < samples.at.size(); ++i) {
    if (i % kPerCheck == 0 && options.check_stop) options.check_stop();
    const ClosestFaces::Hit hit = reference.closest(
        samples.at[i] - reference.origin(), options.max_distance * options.max_distance * kWider, hint);
    const bool found = hit.slot != ClosestFaces::kNone;
    if (found) hint = hit.slot;
    const double distance = found ? std::sqrt(hit.square) : options.max_distance;
    squares += distance * distance;
    std::size_t bin = found ? kDeviationBins : kDeviationBins + 1;
    if (found && distance <= options.tolerance)
      bin = std::min(static_cast<std::size_t>(distance / options.tolerance * kDeviationBins),
                     std::size_t{kDeviationBins - 1});
    ++count[bin];
    if (!(distance > report.lower)) continue;
    report.lower = distance;
    report.witness = samples.at[i];
    report.witness_face = samples.face[i];
  }
  report.samples += samples.at.size();
  report.square_integral += each * squares;
  for (std::size_t b = 0; b < count.size(); ++b)
    report.histogram[b] += static_cast<std::uint64_t>(static_cast<double>(count[b]) * each / unit + 0.5);
}

void measure_samples(const SurfaceFaces& surface, const SurfaceFaces& other, const Box3* core,
                     const Double3& origin, std::span<const float> bound, const CertificateOptions& options,
                     DeviationReport& report) {
  if (options.samples == 0) return;
  const SurfaceSamples samples =
      spread_samples(surface, core, samples_of(options, surface.faces.size(), other.faces.size()));
  if (samples.at.empty()) return;
  // Some face is within the bound of a point's own face, and so is the closest one.
  double largest = 0.0;
  for (const Double3& p : samples.at)
    for (const double c : p) largest = std::max(largest, std::abs(c));
  std::vector<double> radius;
  for (const std::uint32_t f : samples.face)
    radius.push_back(kWider * std::min(options.max_distance, static_cast<double>(bound[f])) +
                     closest_face_error(largest));
  const PointGrid grid(samples.at, radius);
  std::vector<SampledFace> near;
  for (const std::uint32_t i : grid.mask().faces_that_meet(other.position, other.faces)) {
    const SampledFace& f = other.faces[i];
    const Double3 &a = other.position[f[0]], &b = other.position[f[1]], &c = other.position[f[2]];
    Double3 low, high;
    for (std::size_t k = 0; k < 3; ++k)
      low[k] = std::min({a[k], b[k], c[k]}), high[k] = std::max({a[k], b[k], c[k]});
    if (grid.is_near(low, high)) near.push_back(f);
  }
  measure_samples(samples, surface.faces[0][1] == surface.faces[0][2],
                  ClosestFaces(other.position, near, origin), options, report);
}

}  // namespace tessera
