#include "kernels/blends/blend_grid.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr std::size_t kMinArcs = 4;
constexpr double kSagittaShare = 1.0 / 3.0;  ///< of the tolerance: between rows
constexpr double kSharpArc = 0.6;            ///< of a row: arcs shorter than that are creases,
constexpr double kSharpShare = 0.25;         ///< if their corner is within so much of the tolerance
constexpr double kLongRow = 1.3;             ///< of the spacing: on flanks
constexpr std::size_t kMinTaper = 3;         ///< ribs over which an edit begins and ends
constexpr double kNearRibs = 2.5,
                 kNearRows = 1.25;  ///< of ribs and spacings: what a node takes its mean over
constexpr int kOffSmooths = 12;
/// Of the rms distance of single vertices: means of noise alone, so smoothed, are about a fifth of it.
constexpr double kTrueShare = 0.6;
constexpr double kNoOff = 1e-9;  ///< of the extent: distances of an exact arc
constexpr int kCurveSteps = 256;

double norm2(const Double2& a) {
  return std::sqrt(a[0] * a[0] + a[1] * a[1]);
}

/// The curve of knots, by arc length.
std::vector<Double2> hermite_curve(const std::vector<ProfileKnot>& knots, std::size_t pieces) {
  std::vector<Double2> dense;
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    const ProfileKnot &a = knots[k], &b = knots[k + 1];
    for (int i = 0; i < kCurveSteps; ++i) {
      const double t = static_cast<double>(i) / kCurveSteps, s = 1.0 - t;
      Double2 p;
      for (std::size_t c = 0; c < 2; ++c)
        p[c] = a.at[c] * s * s * (1.0 + 2.0 * t) + b.at[c] * t * t * (1.0 + 2.0 * s) +
               a.tangent[c] * s * s * t - b.tangent[c] * t * t * s;
      dense.push_back(p);
    }
  }
  dense.push_back(knots.back().at);
  std::vector<double> gone(dense.size(), 0.0);
  for (std::size_t i = 1; i < dense.size(); ++i)
    gone[i] = gone[i - 1] + norm2({dense[i][0] - dense[i - 1][0], dense[i][1] - dense[i - 1][1]});
  std::vector<Double2> out;
  std::size_t i = 1;
  for (std::size_t k = 0; k <= pieces; ++k) {
    const double want = gone.back() * static_cast<double>(k) / static_cast<double>(pieces);
    while (i + 1 < dense.size() && gone[i] < want) ++i;
    const double piece = gone[i] - gone[i - 1];
    const double t = piece > 0.0 ? (want - gone[i - 1]) / piece : 0.0;
    out.push_back(
        {dense[i - 1][0] * (1.0 - t) + dense[i][0] * t, dense[i - 1][1] * (1.0 - t) + dense[i][1] * t});
  }
  return out;
}

class GridMaker {
 public:
  GridMaker(const Fishbone& bone, const std::vector<RibVertex>& near, const BlendOptions& options,
            double spacing, bool follows)
      : bone_(bone), near_(near), options_(options), spacing_(spacing), follows_(follows) {}

  BlendGrid run() {
    grid_.ribs = bone_.planes.size();
    grid_.closed = bone_.planes.closed();
    find_sharp();
    edit_profiles();
    choose_rows();
    position();
    return std::move(grid_);
  }

 private:
  bool has_radius() const {
    return options_.edit == BlendEdit::kRound ||
           (options_.edit == BlendEdit::kProfile && options_.radius > 0.0);
  }

  void find_sharp() {
    if (options_.edit != BlendEdit::kNone) {
      grid_.sharp = options_.edit == BlendEdit::kRound && options_.radius == 0.0;
      return;
    }
    const double half = 0.5 * bone_.mean_arc_angle(), r = bone_.mean_radius();
    grid_.sharp = bone_.mean_arc() < kSharpArc * spacing_ &&
                  r * (1.0 / sin_cos(half).cos - 1.0) < kSharpShare * options_.tolerance;
  }

  void edit_profiles() {
    const std::size_t n = grid_.ribs;
    profiles_ = bone_.profiles;
    full_.assign(n, 1.0);
    if (options_.edit == BlendEdit::kNone) {
      if (grid_.sharp)
        for (RibProfile& p : profiles_) p.radius = 0.0;
      return;
    }
    if (!grid_.closed) {
      double change = spacing_;
      if (has_radius())
        for (const RibProfile& p : bone_.profiles) {
          RibProfile q = p;
          q.radius = options_.radius;
          change = std::max(change, std::fabs(q.tangent_length() - p.tangent_length()));
        }
      const auto wanted = static_cast<std::size_t>(std::ceil(2.0 * change / bone_.planes.spacing()));
      const std::size_t taper = std::min(std::max(kMinTaper, wanted), (n - 1) / 3);
      for (std::size_t i = 0; i < n; ++i) {
        // Not quite none at the ends: an arc of radius zero would have all its rows in one point.
        const double t =
            std::min(1.0, static_cast<double>(std::min(i, n - 1 - i) + 1) / static_cast<double>(taper + 1));
        full_[i] = t * t * (3.0 - 2.0 * t);
      }
      grid_.first_whole = taper;
    }
    if (!has_radius()) return;
    for (std::size_t i = 0; i < n; ++i) {
      RibProfile& p = profiles_[i];
      const double r = bone_.convex ? options_.radius : -options_.radius;
      p.radius += full_[i] * (r - p.radius);
    }
  }

  void choose_rows() {
    double longest = 0.0, flank = 0.0;
    for (std::size_t i = 0; i < grid_.ribs; ++i) {
      const RibProfile &was = bone_.profiles[i], &is = profiles_[i];
      longest =
          std::max({longest, is.arc_length(), options_.edit == BlendEdit::kNone ? 0.0 : was.arc_length()});
      outer_.push_back(std::max(was.tangent_length(), is.tangent_length()) + spacing_);
      flank = std::max(flank, outer_.back() - is.tangent_length());
      grid_.extent.push_back(0.5 * was.arc_length() + outer_.back() - was.tangent_length());
    }
    if (!grid_.sharp) {
      const double arc_angle = bone_.mean_arc_angle(), r = longest / std::max(arc_angle, 1e-3);
      const double by_sagitta = 0.5 * arc_angle * std::sqrt(r / (2.0 * kSagittaShare * options_.tolerance));
      grid_.arcs = std::max({kMinArcs, static_cast<std::size_t>(std::ceil(longest / spacing_)),
                             static_cast<std::size_t>(std::ceil(by_sagitta))});
    }
    if (options_.edit == BlendEdit::kProfile) {
      curve_ = hermite_curve(options_.profile, 4 * grid_.arcs);
      double length = 0.0;
      for (std::size_t i = 1; i < curve_.size(); ++i)
        length += norm2({curve_[i][0] - curve_[i - 1][0], curve_[i][1] - curve_[i - 1][1]});
      const RibProfile& p = profiles_[grid_.ribs / 2];
      const double chord = 2.0 * std::fabs(p.radius) * sin_cos(0.5 * p.arc_angle()).sin;
      grid_.arcs = std::max(grid_.arcs, static_cast<std::size_t>(std::ceil(length * chord / spacing_)));
      curve_ = hermite_curve(options_.profile, grid_.arcs);
    }
    flanks_ = std::max<std::size_t>(grid_.sharp ? 2 : 1,
                                    static_cast<std::size_t>(std::ceil(flank / (kLongRow * spacing_))));
    grid_.first_arc = flanks_;
    grid_.rows = 2 * flanks_ + grid_.arcs + 1;
  }

  /// A node without what the surface has beside the profile.
  struct Foot {
    Double2 at{}, normal{};
    double run = 0.0;      ///< on the profile as it was
    bool follows = false;  ///< is there on the surface that is there
  };
  Foot foot(std::size_t i, std::size_t row) const {
    const RibProfile &was = bone_.profiles[i], &is = profiles_[i];
    const bool kept = options_.edit == BlendEdit::kNone;
    const std::size_t last = grid_.first_arc + grid_.arcs;
    Foot out;
    if (row >= grid_.first_arc && row <= last) {
      const double share = grid_.arcs == 0
                               ? 0.5
                               : static_cast<double>(row - grid_.first_arc) / static_cast<double>(grid_.arcs);
      out.at = is.on_arc(share);
      out.normal = is.arc_normal(share);
      out.run = (share - 0.5) * was.arc_length();
      out.follows = kept;
      if (!curve_.empty()) out.at = on_curve(is, row - grid_.first_arc, out.at, full_[i]);
      return out;
    }
    const std::size_t side = row < grid_.first_arc ? 0 : 1;
    const std::size_t step = side == 0 ? grid_.first_arc - row : row - last;
    const double begin = is.tangent_length();
    const double from =
        begin + (outer_[i] - begin) * static_cast<double>(step) / static_cast<double>(flanks_);
    out.at = is.on_flank(side, from);
    out.normal = is.flank_normal(side);
    const double beyond = from - was.tangent_length();
    out.run = (side == 0 ? -1.0 : 1.0) * (0.5 * was.arc_length() + beyond);
    out.follows = kept || beyond > 0.0;
    return out;
  }

  Double2 on_curve(const RibProfile& p, std::size_t k, const Double2& arc, double share) const {
    const Double2 a = p.on_arc(0.0), b = p.on_arc(1.0), up = p.arc_normal(0.5);
    const Double2 chord = {b[0] - a[0], b[1] - a[1]};
    const double length = norm2(chord);
    const Double2& c = curve_[k];
    const Double2 on = {a[0] + c[0] * chord[0] + c[1] * length * up[0],
                        a[1] + c[0] * chord[1] + c[1] * length * up[1]};
    return {arc[0] + share * (on[0] - arc[0]), arc[1] + share * (on[1] - arc[1])};
  }

  /// Mean distance of the vertices near a node to the profile as it was.
  void mean_off(std::size_t i, const std::vector<Foot>& feet, std::vector<double>& off) const {
    const double n = static_cast<double>(grid_.ribs), r = static_cast<double>(i);
    std::vector<double> weight(grid_.rows, 0.0);
    off.assign(grid_.rows, 0.0);
    const auto range = [&](double low, double high, double shift) {
      auto at = std::lower_bound(near_.begin(), near_.end(), low,
                                 [](const RibVertex& v, double rib) { return v.position.rib < rib; });
      for (; at != near_.end() && at->position.rib <= high; ++at) {
        const double a = (at->position.rib + shift - r) / kNearRibs;
        for (std::size_t row = 0; row < grid_.rows; ++row) {
          const double b = (at->across.run - feet[row].run) / (kNearRows * spacing_);
          if (!(b * b < 1.0) || !(a * a < 1.0)) continue;
          const double w = (1.0 - a * a) * (1.0 - a * a) * (1.0 - b * b) * (1.0 - b * b);
          weight[row] += w;
          off[row] += w * at->across.distance;
        }
      }
    };
    range(r - kNearRibs, r + kNearRibs, 0.0);
    if (grid_.closed && r < kNearRibs) range(r - kNearRibs + n, n, -n);
    if (grid_.closed && r + kNearRibs > n) range(0.0, r + kNearRibs - n, n);
    for (std::size_t row = 0; row < grid_.rows; ++row)
      off[row] = weight[row] > 0.0 && feet[row].follows ? off[row] / weight[row] : 0.0;
  }

  void position() {
    std::vector<std::vector<Foot>> feet(grid_.ribs);
    std::vector<std::vector<double>> off(grid_.ribs);
    for (std::size_t i = 0; i < grid_.ribs; ++i) {
      for (std::size_t row = 0; row < grid_.rows; ++row) feet[i].push_back(foot(i, row));
      mean_off(i, feet[i], off[i]);
    }
    std::vector<double> line(grid_.ribs);
    double sum = 0.0, count = 0.0, noise = 0.0;
    for (std::size_t row = 0; row < grid_.rows; ++row) {
      for (std::size_t i = 0; i < grid_.ribs; ++i) line[i] = off[i][row];
      smooth_line(line, grid_.closed, kOffSmooths);
      for (std::size_t i = 0; i < grid_.ribs; ++i) {
        off[i][row] = feet[i][row].follows ? line[i] : 0.0;
        sum += line[i] * line[i], count += 1.0;
      }
    }
    for (const RibVertex& v : near_) noise += v.across.distance * v.across.distance;
    noise = near_.empty() ? 0.0 : std::sqrt(noise / static_cast<double>(near_.size()));
    const bool is_true =
        follows_ && std::sqrt(sum / count) > kTrueShare * noise && noise > kNoOff * grid_.extent[0];
    for (std::size_t i = 0; i < grid_.ribs; ++i)
      for (std::size_t row = 0; row < grid_.rows; ++row) {
        const Foot& f = feet[i][row];
        const double d = is_true ? off[i][row] : 0.0;
        Double3 p = bone_.planes.at(i, f.at[0] + d * f.normal[0], f.at[1] + d * f.normal[1]);
        if (options_.float_positions)
          for (double& c : p) c = static_cast<double>(static_cast<float>(c));
        grid_.node.push_back(p);
      }
  }

  const Fishbone& bone_;
  const std::vector<RibVertex>& near_;
  const BlendOptions& options_;
  double spacing_;
  bool follows_;
  BlendGrid grid_;
  std::vector<RibProfile> profiles_;  ///< as they shall be
  std::vector<double> full_;          ///< per rib: share of the edit
  std::vector<double> outer_;         ///< per rib: distance of the last row from the corner
  std::vector<Double2> curve_;        ///< per row of the arc, of a profile
  std::size_t flanks_ = 1;            ///< rows beyond the arc on each side
};

}  // namespace

std::vector<std::array<std::uint32_t, 3>> BlendGrid::faces() const {
  std::vector<std::array<std::uint32_t, 3>> out;
  const std::size_t pieces = closed ? ribs : ribs - 1;
  for (std::size_t i = 0; i < pieces; ++i)
    for (std::size_t j = 0; j + 1 < rows; ++j) {
      const auto a = static_cast<std::uint32_t>(at(i, j)),
                 b = static_cast<std::uint32_t>(at((i + 1) % ribs, j));
      out.push_back({a, b, b + 1});
      out.push_back({a, b + 1, a + 1});
    }
  return out;
}

double BlendGrid::radius_of_arcs() const {
  if (arcs < 2) return 0.0;
  double sum = 0.0, count = 0.0;
  const std::size_t end = closed ? ribs : ribs - first_whole;
  for (std::size_t i = closed ? 0 : first_whole; i < end; ++i) {
    const Double3 &a = node[at(i, first_arc)], &b = node[at(i, first_arc + arcs / 2)],
                  &c = node[at(i, first_arc + arcs)];
    const double area = norm(triangle_normal(a, b, c));
    if (!(area > 0.0)) continue;
    sum += norm(b - a) * norm(c - b) * norm(a - c) / (2.0 * area), count += 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

BlendGrid make_blend_grid(const Fishbone& bone, const std::vector<RibVertex>& near,
                          const BlendOptions& options, double spacing, bool follows) {
  return GridMaker(bone, near, options, spacing, follows).run();
}

double flank_beyond(const Fishbone& bone, const BlendOptions& options, double spacing) {
  double maximum = 0.0;
  for (const RibProfile& p : bone.profiles) {
    RibProfile q = p;
    q.radius = options.edit == BlendEdit::kNone ? p.radius : options.radius;
    maximum = std::max(maximum, q.tangent_length() - p.tangent_length());
  }
  return maximum + spacing;
}

}  // namespace tessera
