#include "kernels/points/spacing.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <tuple>
#include <utility>

#include "kernels/points/normals.h"
#include "octree/small_matrix.h"

namespace tessera {
namespace {

// Enough for a quantile over many cells, few enough for cells of any density.
constexpr std::size_t kProbesPerCell = 48;
constexpr std::size_t kMinForDistances = 9;
constexpr std::size_t kMinForQuadric = 12;
constexpr int kQuadricTerms = 6;

/// Points in the middle half of a cell, evenly thinned by rank.
struct Probes {
  std::vector<std::size_t> at;
  double each = 1.0;  ///< points that one stands for
};
Probes probes_of(const SampleCell& cell) {
  std::vector<std::size_t> inner;
  for (std::size_t i = 0; i < cell.points.size(); ++i) {
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const double t = (cell.points[i][a] - cell.min[a]) / cell.size;
      inside = inside && t >= 0.25 && t < 0.75;
    }
    if (inside) inner.push_back(i);
  }
  if (inner.size() <= kProbesPerCell) return {inner, 1.0};
  Probes probes{{}, static_cast<double>(inner.size()) / kProbesPerCell};
  for (std::size_t k = 0; k < kProbesPerCell; ++k)
    probes.at.push_back(inner[k * inner.size() / kProbesPerCell]);
  return probes;
}

/// The points of a cell, of which those around one after another are asked for. Where they ascend in x, as cells of samples
/// do, what lies too far off in that alone is passed over.
class CellPoints {
 public:
  explicit CellPoints(std::span<const Double3> points)
      : points_(points),
        ascending_(std::is_sorted(points.begin(), points.end(),
                                  [](const Double3& a, const Double3& b) { return a[0] < b[0]; })) {
    for (std::size_t a = 0; a < 3; ++a) {
      axes_[a].reserve(points.size());
      for (const Double3& p : points) axes_[a].push_back(p[a]);
    }
    square_.resize(points.size());
  }

  /// From here on asked about what lies nearer to this point than `radius`.
  void look_from(std::size_t probe, double radius) {
    probe_ = probe;
    end_square_ = radius * radius;
    first_ = 0, last_ = points_.size();
    if (ascending_) {
      const auto x = axes_[0].begin();
      const auto here = x + static_cast<std::ptrdiff_t>(probe);
      const auto beyond = [&](double other) { return square_along_x(other) >= end_square_; };
      last_ = static_cast<std::size_t>(
          std::partition_point(here, axes_[0].end(), [&](double other) { return !beyond(other); }) - x);
      first_ = static_cast<std::size_t>(std::partition_point(x, here, beyond) - x);
    }
    const Double3 p = points_[probe];
    for (std::size_t i = first_; i < last_; ++i) {
      const double dx = axes_[0][i] - p[0], dy = axes_[1][i] - p[1], dz = axes_[2][i] - p[2];
      square_[i] = dx * dx + dy * dy + dz * dz;
    }
  }
  /// The nearest ones in `nearest`, by squared distance and index, without the probe itself; the rest of it is {square of the
  /// radius, probe}.
  void nearest(std::span<std::pair<double, std::size_t>> nearest) const {
    std::fill(nearest.begin(), nearest.end(), std::pair(end_square_, probe_));
    const auto meet = [&](std::size_t i) {
      const std::pair found(square_[i], i);
      if (!(found.first < end_square_ && found < nearest.back())) return;
      std::size_t at = nearest.size() - 1;
      for (; at > 0 && found < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
      nearest[at] = found;
    };
    const auto too_far = [&](std::size_t i) {
      return ascending_ && square_along_x(axes_[0][i]) > nearest.back().first;
    };
    for (std::size_t i = probe_ + 1; i < last_ && !too_far(i); ++i) meet(i);
    for (std::size_t i = probe_; i-- > first_ && !too_far(i);) meet(i);
  }
  /// Calls visit(i) for every point that is nearer than the radius, the probe among them, in their order.
  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (std::size_t i = first_; i < last_; ++i)
      if (square_[i] < end_square_) visit(i);
  }

 private:
  /// Of the distance to the probe: never more than the whole, rounded as it is.
  double square_along_x(double other) const {
    const double d = other - axes_[0][probe_];
    return d * d;
  }

  std::span<const Double3> points_;
  bool ascending_;
  std::array<std::vector<double>, 3> axes_;
  std::vector<double> square_;  ///< of distances from the probe, of [first_, last_)
  std::size_t probe_ = 0, first_ = 0, last_ = 0;
  double end_square_ = 0.0;
};

/// The points within reach of a probe, relative to it.
class Surroundings {
 public:
  void add(const Double3& d) {
    ++count_;
    sum_ = sum_ + d;
    square_[0] += d[0] * d[0], square_[1] += d[0] * d[1], square_[2] += d[0] * d[2];
    square_[3] += d[1] * d[1], square_[4] += d[1] * d[2], square_[5] += d[2] * d[2];
  }
  /// The plane that they lie about. \pre some were added
  struct Plane {
    Double3 mean{}, variance{};  ///< ascending
    Double3 normal{};
  };
  Plane plane() const {
    Plane out;
    out.mean = sum_ / count_;
    std::array<double, 6> cov = square_;
    for (double& c : cov) c /= count_;
    const Double3& m = out.mean;
    cov[0] -= m[0] * m[0], cov[1] -= m[0] * m[1], cov[2] -= m[0] * m[2];
    cov[3] -= m[1] * m[1], cov[4] -= m[1] * m[2], cov[5] -= m[2] * m[2];
    std::array<Double3, 3> axes{};
    symmetric_eigen3(cov, out.variance, axes);
    out.normal = axes[0];
    return out;
  }
  /// Whether they lie about it and the probe on it.
  bool hold(const Plane& plane, double radius) const {
    return hold(plane, radius, count_ < kFewAround ? kFewVariation : kMaxVariation);
  }
  /// The same of few: strewn ones lie about a plane by chance more easily.
  bool few_hold(const Plane& plane, double radius) const { return hold(plane, radius, kFewVariation); }

 private:
  bool hold(const Plane& plane, double radius, double max_variation) const {
    if (count_ < kMinAround) return false;
    const double minimum = std::max(plane.variance[0], 0.0);
    const double off = std::fabs(dot(plane.mean, plane.normal));
    return minimum <= max_variation * (minimum + plane.variance[1] + plane.variance[2]) &&
           off <= kMaxOff * std::sqrt(minimum) + kRounding * radius;
  }

  static constexpr double kMinAround = 5.0;
  static constexpr double kFewAround = 16.0, kFewVariation = 0.06;
  static constexpr double kMaxVariation =
      0.15;                               ///< of a plane; strewn points have about 0.25, noisy ones 0.1
  static constexpr double kMaxOff = 3.0;  ///< standard deviations that a probe is off the plane
  static constexpr double kRounding = 1e-3;
  double count_ = 0.0;
  Double3 sum_{};
  std::array<double, 6> square_{};
};

/// Whether the height of a probe over the plane of its neighbours is an outlier among theirs, by the median absolute
/// deviation (Hampel 1974), which up to half of them may be noise without changing.
/// \param offset  of the neighbours from the probe   \param heights  room to work in
bool is_height_outlier(std::span<const Double3> offset, const Double3& normal, double spacing,
                       std::vector<double>& heights) {
  constexpr std::size_t kMinOffsets = 8;
  constexpr double kDeviations = 5.0;  // 3.4 standard deviations of even noise
  constexpr double kSpacings = 0.5;    // nearer than that a point does not look sparser than it is
  if (offset.size() < kMinOffsets) return false;
  heights.clear();
  for (const Double3& d : offset) heights.push_back(dot(d, normal));
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  const double median = *middle;
  for (double& h : heights) h = std::fabs(h - median);
  std::nth_element(heights.begin(), middle, heights.end());
  return std::fabs(median) > std::max(kDeviations * *middle, kSpacings * spacing);
}

double points_of(const SpacingProbe& p) {
  return p.area / (p.spacing * p.spacing);
}

/// Leaves out the probes beside the surface where they are many. \returns the share of the points that they are
double drop_beside_surface(std::vector<SpacingProbe>& probes) {
  constexpr double kManyPoints = 0.04;  // 0.033 in hand-held scans of objects
  constexpr double kManyArea = 0.08;    // 0.07 in a town with trees, from the air
  double points = 0.0, area = 0.0, points_beside = 0.0, area_beside = 0.0;
  for (const SpacingProbe& p : probes) {
    points += points_of(p), area += p.area;
    if (p.beside_surface) points_beside += points_of(p), area_beside += p.area;
  }
  if (!(points_beside > kManyPoints * points || area_beside > kManyArea * area)) return 0.0;
  std::erase_if(probes, [](const SpacingProbe& p) { return p.beside_surface; });
  return points_beside / points;
}

/// Where probes on no surface would decide, those alone that are about as dense as the surface; else all of them.
/// \param outliers  SpacingSummary::strewn
std::vector<SpacingProbe> without_outliers(std::vector<SpacingProbe> probes, double& outliers) {
  constexpr double kSparser =
      3.0;  // spacings of the median point, from which a probe on no surface is suspect
  constexpr double kNotable =
      0.08;  // share of the area that suspects claim; 0.03 in cluttered rooms and wooded land
  constexpr double kMostly = 0.65;  // of the points as sparse; 0.45 where a scanner saw little of what is far
  // The same by flat_nearby; 0.6 in scrub and in a single turn of a car's scanner, 0.95 with noise close over ground.
  constexpr double kMostlyNearby = 0.75;
  constexpr double kDenseShare = 0.75;  // of the points on a surface are as dense as that,
  constexpr double kSlack = 1.5;        // or have so many times their spacing
  std::sort(probes.begin(), probes.end(), [](const SpacingProbe& a, const SpacingProbe& b) {
    return std::tie(a.spacing, a.area, a.nearest, a.gap, a.on_surface, a.flat_nearby, a.in_range) <
           std::tie(b.spacing, b.area, b.nearest, b.gap, b.on_surface, b.flat_nearby, b.in_range);
  });
  if (probes.empty()) return probes;
  // Spacing that a share of the points has at most, of all or of those on a surface.
  const auto quantile = [&](double share, const auto& counted) {
    double all = 0.0, seen = 0.0;
    for (const SpacingProbe& p : probes) all += counted(p) ? points_of(p) : 0.0;
    for (const SpacingProbe& p : probes)
      if ((seen += counted(p) ? points_of(p) : 0.0) >= share * all) return p.spacing;
    return probes.back().spacing;
  };
  const double sparse = kSparser * quantile(0.5, [](const SpacingProbe&) { return true; });
  const auto decide = [&](const auto& on_surface, double mostly) {
    double suspect = 0.0, area = 0.0, sparse_points = 0.0, suspect_points = 0.0;
    for (const SpacingProbe& p : probes) {
      area += p.area;
      if (p.spacing <= sparse) continue;
      sparse_points += points_of(p);
      if (!on_surface(p)) suspect += p.area, suspect_points += points_of(p);
    }
    return suspect > kNotable * area && suspect_points > mostly * sparse_points;
  };
  const auto on_surface = [](const SpacingProbe& p) { return p.on_surface; };
  const auto flat_nearby = [](const SpacingProbe& p) { return p.on_surface && p.flat_nearby; };
  double maximum = 0.0;
  if (decide(on_surface, kMostly))
    maximum = kSlack * quantile(kDenseShare, on_surface);
  else if (decide(flat_nearby, kMostlyNearby))
    maximum = kSlack * quantile(kDenseShare, flat_nearby);
  else
    return probes;
  double all = 0.0, dropped = 0.0;
  std::vector<SpacingProbe> kept;
  for (const SpacingProbe& p : probes) {
    all += points_of(p);
    if (p.spacing > maximum) dropped += points_of(p);
    if (p.spacing <= maximum && p.in_range) kept.push_back(p);
  }
  if (kept.empty()) return probes;
  outliers = dropped / all;
  return kept;
}

/// Standard deviation of the points (relative to a probe, in units of the radius) from a quadric over their
/// plane; negative where none can be fitted.
double quadric_residual(const std::vector<Double3>& points) {
  Double3 mean{};
  for (const Double3& p : points)
    for (std::size_t a = 0; a < 3; ++a) mean[a] += p[a];
  const auto n = static_cast<double>(points.size());
  for (double& m : mean) m /= n;
  std::array<double, 6> cov{};
  for (const Double3& p : points) {
    const double x = p[0] - mean[0];
    const double y = p[1] - mean[1];
    const double z = p[2] - mean[2];
    cov[0] += x * x, cov[1] += x * y, cov[2] += x * z, cov[3] += y * y, cov[4] += y * z, cov[5] += z * z;
  }
  Double3 values{};
  std::array<Double3, 3> axes{};
  symmetric_eigen3(cov, values, axes);  // ascending: axes[0] is the normal
  const auto along = [&](const Double3& p, const Double3& axis) {
    return (p[0] - mean[0]) * axis[0] + (p[1] - mean[1]) * axis[1] + (p[2] - mean[2]) * axis[2];
  };
  const auto terms = [&](const Double3& p) {
    const double u = along(p, axes[2]);
    const double v = along(p, axes[1]);
    return std::array<double, kQuadricTerms>{1.0, u, v, u * u, u * v, v * v};
  };
  SmallMatrix<kQuadricTerms> m = SmallMatrix<kQuadricTerms>::zero();
  std::array<double, kQuadricTerms> b{};
  for (const Double3& p : points) {
    const auto t = terms(p);
    const double w = along(p, axes[0]);
    for (std::size_t i = 0; i < t.size(); ++i) {
      b[i] += t[i] * w;
      for (std::size_t j = 0; j <= i; ++j) m(i, j) += t[i] * t[j];
    }
  }
  if (!cholesky_factor(m, 1e-9)) return -1.0;
  cholesky_solve(m, b);
  double sum = 0.0;
  for (const Double3& p : points) {
    const auto t = terms(p);
    double e = along(p, axes[0]);
    for (std::size_t i = 0; i < t.size(); ++i) e -= t[i] * b[i];
    sum += e * e;
  }
  return std::sqrt(sum / (n - kQuadricTerms));
}

}  // namespace

std::uint32_t ScaleHistogram::bin_of(double value) {
  // Exponent and six bits of mantissa; zero and less fall into the first bin.
  if (!(value > 0.0)) return 0;
  return static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(value) >> (52 - 6));
}

double ScaleHistogram::quantile(double share) const {
  if (total_ == 0) return 0.0;
  const double rank = share * static_cast<double>(total_);
  std::uint64_t seen = 0;
  for (const auto& [bin, count] : bins_) {
    seen += count;
    if (static_cast<double>(seen) < rank) continue;
    if (bin == 0) return 0.0;
    return std::bit_cast<double>((std::uint64_t{bin} << (52 - 6)) | std::uint64_t{1} << (52 - 7));
  }
  return 0.0;
}

void measure_spacing(const SampleCell& cell, double share, double minimum, double maximum,
                     std::vector<SpacingProbe>& out) {
  constexpr std::size_t kGapRank = 4;
  constexpr std::size_t kSpacingRank = 8;
  constexpr std::size_t kNearby = 16;
  if (cell.points.size() < kMinForDistances) return;
  const double radius = cell.size / 4;
  const Probes probes = probes_of(cell);
  CellPoints points(cell.points);
  std::vector<Double3> offset;
  std::vector<double> heights;
  for (const std::size_t probe : probes.at) {
    std::array<std::pair<double, std::size_t>, kNearby> nearest;  // squared distance, which
    points.look_from(probe, radius);
    points.nearest(nearest);
    const double spacing = std::sqrt(nearest[kSpacingRank - 1].first) / 2;
    if (spacing <= minimum || spacing > maximum) continue;
    Surroundings around, nearby;
    offset.clear();
    points.for_each([&](std::size_t i) {
      if (i == probe) return;
      offset.push_back(cell.points[i] - cell.points[probe]);
      around.add(offset.back());
    });
    for (const auto& [d, i] : nearest)
      if (i != probe) nearby.add(cell.points[i] - cell.points[probe]);
    SpacingProbe& found = out.emplace_back();
    found.spacing = spacing;
    found.nearest = std::sqrt(nearest.front().first);
    found.gap = std::sqrt(nearest[kGapRank - 1].first);
    found.area = spacing * spacing * probes.each / share;
    found.in_range = nearest[kSpacingRank - 1].second != probe;
    found.on_surface = found.flat_nearby = false;
    if (offset.empty()) continue;
    const Surroundings::Plane plane = around.plane();
    found.on_surface = around.hold(plane, radius);
    found.flat_nearby = nearby.few_hold(nearby.plane(), radius);
    found.beside_surface = is_height_outlier(offset, plane.normal, spacing, heights);
  }
}

void measure_residuals(const SampleCell& cell, double radius, ScaleHistogram& out) {
  if (cell.points.size() < kMinForQuadric) return;
  CellPoints points(cell.points);
  std::vector<Double3> near;
  for (const std::size_t probe : probes_of(cell).at) {
    near.clear();
    const Double3& centre = cell.points[probe];
    points.look_from(probe, radius);
    points.for_each([&](std::size_t i) {
      const Double3& p = cell.points[i];
      near.push_back({(p[0] - centre[0]) / radius, (p[1] - centre[1]) / radius, (p[2] - centre[2]) / radius});
    });
    if (near.size() < kMinForQuadric) continue;
    const double residual = quadric_residual(near);
    if (residual >= 0.0) out.add(residual * radius);
  }
}

SpacingSummary summarise_spacing(std::vector<SpacingProbe> probes, const ScaleHistogram& residual) {
  SpacingSummary s;
  s.noise = residual.quantile(0.25);
  s.residual = residual.quantile(0.5);
  s.residuals = residual.count();
  probes = without_outliers(std::move(probes), s.outliers);
  s.outliers += (1.0 - s.outliers) * drop_beside_surface(probes);
  if (probes.empty()) return s;
  const auto quantile = [&](double SpacingProbe::*field, double share) {
    std::sort(probes.begin(), probes.end(), [&](const SpacingProbe& a, const SpacingProbe& b) {
      return std::tie(a.*field, a.area) < std::tie(b.*field, b.area);
    });
    double all = 0.0;
    for (const SpacingProbe& p : probes) all += p.area;
    double seen = 0.0;
    for (const SpacingProbe& p : probes)
      if ((seen += p.area) >= share * all) return p.*field;
    return probes.back().*field;
  };
  s.middle = quantile(&SpacingProbe::spacing, 0.5);
  const double grid = std::max(1.0, quantile(&SpacingProbe::nearest, 0.5) / s.middle);
  s.middle *= grid;
  s.dense = grid * quantile(&SpacingProbe::spacing, 0.25);
  s.wide = grid * quantile(&SpacingProbe::spacing, 0.7);
  s.spacing = grid * quantile(&SpacingProbe::spacing, 0.9);
  s.gap = quantile(&SpacingProbe::gap, 0.9);
  return s;
}

namespace {

/// Few points show a whole object, whose limbs are a few spacings thick: a finer lattice tells one side from the other. Below
/// a quarter, where it is h that limits what is told apart, it gets finer sooner.
double few_factor(std::uint64_t points) {
  constexpr double kHalf = 0.5, kFinest = 0.35;
  const double share = static_cast<double>(points) / static_cast<double>(kSparseScan);
  if (share >= kHalf * kHalf) return std::min(std::sqrt(share), 1.0);
  const double rest = share / (kHalf * kHalf);
  return std::max(kHalf * rest * std::sqrt(rest), kFinest);
}

}  // namespace

ChosenSpacing choose_spacing(const SpacingSummary& measured, std::uint64_t points) {
  constexpr double kEven = 1.5;
  constexpr double kDense = 3.0;
  constexpr double kClosable = 2.0;
  constexpr double kLittle = 1.15;
  const double few = few_factor(points);
  const double even = kEven * measured.spacing;
  const double dense = kDense * measured.dense;
  const double closing = measured.wide / kClosable;
  const double averaging = kEven * measured.noise;
  // Where that makes little difference, density is even.
  const double finer = std::max(dense, closing);
  const double wanted = even < kLittle * finer ? even : finer;
  const double fine = std::max(few * std::min(even, wanted), closing);
  const auto text = [](double value) {
    std::ostringstream out;
    out << std::setprecision(3) << value;
    return out.str();
  };
  if (averaging > fine)
    return {averaging, "1.5 times the noise of " + text(measured.noise) + ", which it averages"};
  const std::string part =
      few < 1.0 ? text(few) + " (for only " + std::to_string(points) + " points) times " : std::string();
  if (even <= wanted)
    return {fine, part + "1.5 times the spacing of " + text(measured.spacing) +
                      ", at which 90 % of the surface is sampled or closer"};
  if (closing > few * dense)
    return {fine, "half the spacing of " + text(measured.wide) +
                      ", so that 70 % of the surface closes; the densest quarter is sampled at " +
                      text(measured.dense)};
  return {fine, part + "3 times the spacing of " + text(measured.dense) +
                    " of the densest quarter of the surface; 70 % of it is sampled at " +
                    text(measured.wide) + " or closer and closes"};
}

}  // namespace tessera
