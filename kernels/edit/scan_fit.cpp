#include "kernels/edit/scan_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "kernels/edit/lattice_fit.h"
#include "octree/error.h"

namespace tessera {
namespace {

constexpr double kNodesPerWave = 4.0;
constexpr double kMinCosine = 0.70710678118654752;  ///< of normals that agree: 45 degrees
constexpr double kDeviationOfMedian = 1.4826;       ///< of a normal distribution
constexpr double kTukey = 4.685;    ///< 95 % as good as least squares where there are no outliers
constexpr double kWaveShare = 0.1;  ///< of a wave's length: displacements that may still come at its scale
constexpr double kMaxWeight = 4.0;  ///< of a cell, in means of all
constexpr double kGain = 0.98;      ///< of the held-out cells' mean square, to keep a scale
constexpr int kMaxUseless = 2;      ///< scales in a row
constexpr int kFirstRounds = 12, kFitRounds = 3;
constexpr double kSettled = 0.02;  ///< change of the rms between rounds
constexpr std::size_t kHeldOneIn = 5;
constexpr double kTwoPi = 6.28318530717958648;
constexpr std::size_t kMinMatched = 60;
constexpr double kMinMatchedShare = 0.1;

struct CellMatch {
  bool found = false;
  Double3 at{}, normal{};  ///< foot before it moves; unit normal of the surface there after it did
  double residual = 0.0;   ///< of the cell over the moved surface
};

/// Normal of a surface after space was displaced.
Double3 moved_normal(const DisplacementLattice& lattice, const Double3& at, const Double3& n) {
  const std::array<Double3, 3> d = lattice.derivatives(at);
  const auto moved = [&](const Double3& t) { return t + d[0] * t[0] + d[1] * t[1] + d[2] * t[2]; };
  const Double3 t = any_orthogonal(n);
  return unit_or_zero(cross(moved(t), moved(cross(n, t))));
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class ScanFit {
 public:
  ScanFit(std::span<const PlaneCell> cells, const FootFinder& feet, const ScanFitOptions& options,
          ScanFitReport& report)
      : cells_(cells), feet_(feet), options_(options), report_(report) {
    double all = 0.0;
    for (const PlaneCell& c : cells_) all += c.points;
    mean_points_ = cells_.empty() ? 1.0 : all / static_cast<double>(cells_.size());
  }

  DisplacementLattice run() {
    const double diagonal = norm(options_.high - options_.low);
    bound_ = options_.max_distance;
    DisplacementLattice best =
        DisplacementLattice::over(options_.low, options_.high, diagonal / kNodesPerWave);
    std::size_t best_level = 0;
    double best_wave = diagonal;
    find_matches(best);
    require_overlap();
    DisplacementLattice lattice = best;
    std::vector<CellMatch> best_matches = matches_;
    int useless = 0;
    double wave = diagonal;
    for (std::size_t level = 0; useless < kMaxUseless; ++level, wave /= 2.0) {
      if (level > 0) {
        if (!may_refine(lattice, wave)) break;
        lattice = lattice.refined();
      }
      wave_ = std::max(wave, options_.wavelength);
      improve(lattice, level, level == 0 ? kFirstRounds : kFitRounds, true);
      const ScanFitScale scale = judge(best_matches, level == 0);
      report_.scales.push_back(scale);
      useless = scale.kept ? 0 : useless + 1;
      if (!scale.kept) continue;
      best = lattice, best_level = level, best_wave = wave_, best_matches = matches_;
      if (options_.wavelength >= wave) break;
    }
    wave_ = best_wave;
    find_matches(best);
    improve(best, best_level, kFitRounds, false);
    finish_report(best_wave);
    require_overlap();
    return best;
  }

 private:
  static bool held(std::size_t cell) { return cell % kHeldOneIn == kHeldOneIn - 1; }

  bool may_refine(const DisplacementLattice& lattice, double wave) const {
    std::size_t nodes = 1;
    for (const std::size_t n : lattice.nodes) nodes *= 2 * n;
    return nodes <= kMaxFitNodes && wave >= kNodesPerWave * options_.cell_edge;
  }

  void find_matches(const DisplacementLattice& lattice) {
    std::vector<Double3> at(cells_.size());
    for (std::size_t i = 0; i < cells_.size(); ++i) at[i] = lattice.origin_of(cells_[i].at);
    options_.check_stop();
    const std::vector<SurfaceFoot> feet = feet_(at, bound_);
    matches_.assign(cells_.size(), {});
    report_.far = report_.disagreeing = report_.border = report_.matched = 0;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const SurfaceFoot& foot = feet[i];
      if (!foot.found) {
        ++report_.far;
        continue;
      }
      if (foot.border) {
        ++report_.border;
        continue;
      }
      const Double3 n = moved_normal(lattice, foot.at, foot.normal);
      const double cosine = dot(n, cells_[i].normal);
      if ((cells_[i].oriented != 0 ? cosine : std::fabs(cosine)) < kMinCosine) {
        ++report_.disagreeing;
        continue;
      }
      ++report_.matched;
      matches_[i] = {true, foot.at, n, dot(n, cells_[i].at - foot.at - lattice.at(foot.at))};
    }
  }

  void require_overlap() const {
    if (report_.matched == 0)
      throw EmptyError(
          cells_.empty()
              ? "the scan has no planar places near the mesh: are both in one system, and is the "
                "scan dense enough?"
              : "no planar place of the scan lies over the mesh with a normal like its own: are both "
                "in one system? else raise --max-distance");
    const auto share = static_cast<double>(report_.matched) / static_cast<double>(cells_.size());
    if (report_.matched < kMinMatched || share < kMinMatchedShare)
      throw ValidationError(
          "only " + std::to_string(report_.matched) + " of " + std::to_string(cells_.size()) +
          " planar places of the scan lie over the mesh with a normal like its own: too few to "
          "fit it; align both first, or raise --max-distance");
  }

  /// Beyond it no cell counts: what is neither noise nor a displacement that may still come.
  void set_bound(bool fitted_only) {
    std::vector<double> residuals;
    for (std::size_t i = 0; i < matches_.size(); ++i)
      if (matches_[i].found && !(fitted_only && held(i)))
        residuals.push_back(std::fabs(matches_[i].residual));
    const double deviation = kDeviationOfMedian * median(std::move(residuals));
    bound_ = std::min(options_.max_distance,
                      std::max({kTukey * deviation, kWaveShare * wave_, options_.cell_edge}));
  }

  std::vector<PlaneSample> samples(bool fitted_only) const {
    std::vector<PlaneSample> out;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const CellMatch& m = matches_[i];
      if (!m.found || (fitted_only && held(i))) continue;
      const double r = m.residual / bound_;
      if (!(r * r < 1.0)) continue;
      const double tukey = (1.0 - r * r) * (1.0 - r * r);
      const double points = std::min<double>(cells_[i].points, kMaxWeight * mean_points_);
      out.push_back({m.at, m.normal, dot(m.normal, cells_[i].at - m.at), points * tukey});
    }
    return out;
  }

  void improve(DisplacementLattice& lattice, std::size_t level, int rounds, bool fitted_only) {
    double last = -1.0;
    for (int round = 0; round < rounds; ++round) {
      options_.check_stop();
      set_bound(fitted_only);
      const std::vector<PlaneSample> fitted = samples(fitted_only);
      if (fitted.empty()) return;
      LatticeFitOptions o;
      o.order = options_.order;
      const double area = static_cast<double>(fitted.size()) * options_.cell_edge * options_.cell_edge;
      // At this wavelength a displacement costs as much as it explains, where its field fades off the surface within a radian.
      const double radian = wave_ / kTwoPi;
      o.stiffness = radian / area;
      for (int k = 1; k < options_.order; ++k) o.stiffness *= radian * radian;
      fit_lattice(lattice, level, fitted, o);
      find_matches(lattice);
      const double rms = root_mean_square(fitted_only);
      if (last >= 0.0 && rms > (1.0 - kSettled) * last) break;
      last = rms;
    }
  }

  double root_mean_square(bool fitted_only) const {
    double sum = 0.0, count = 0.0;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (!matches_[i].found || (fitted_only && held(i))) continue;
      const double r = std::min(std::fabs(matches_[i].residual), bound_);
      sum += r * r;
      count += 1.0;
    }
    return count > 0.0 ? std::sqrt(sum / count) : 0.0;
  }

  ScanFitScale judge(const std::vector<CellMatch>& before, bool first) const {
    double sum_before = 0.0, sum_after = 0.0, count = 0.0;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!held(i)) continue;
      const auto distance = [&](const CellMatch& m) {
        return m.found ? std::min(std::fabs(m.residual), bound_) : bound_;
      };
      const double b = distance(before[i]), a = distance(matches_[i]);
      if (!(std::min(a, b) < bound_)) continue;
      sum_before += b * b;
      sum_after += a * a;
      count += 1.0;
    }
    ScanFitScale scale;
    scale.wavelength = wave_;
    if (count > 0.0) {
      scale.held_before = std::sqrt(sum_before / count);
      scale.held_after = std::sqrt(sum_after / count);
    }
    scale.kept = first || options_.wavelength > 0.0 || sum_after < kGain * sum_before;
    return scale;
  }

  void finish_report(double wave) {
    report_.wavelength = wave;
    report_.bound = bound_;
    double sum = 0.0;
    std::size_t count = 0;
    for (CellMatch& m : matches_) {
      if (!m.found) continue;
      if (!(std::fabs(m.residual) < bound_)) {
        ++report_.far;
        continue;
      }
      sum += m.residual * m.residual;
      ++count;
    }
    report_.matched = count;
    report_.rms = count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
  }

  std::span<const PlaneCell> cells_;
  const FootFinder& feet_;
  const ScanFitOptions& options_;
  ScanFitReport& report_;
  double mean_points_ = 1.0, bound_ = 0.0, wave_ = 0.0;
  std::vector<CellMatch> matches_;
};

}  // namespace

DisplacementLattice fit_scan(std::span<const PlaneCell> cells, const FootFinder& feet,
                             const ScanFitOptions& options, ScanFitReport& report) {
  return ScanFit(cells, feet, options, report).run();
}

}  // namespace tessera
