// The last relaxations: vertices go where angles and the areas of the cells around them become more alike. Botsch's thesis,
// 3.2.3, draws vertices to neighbours with large cells; here each move is the best one for the cells of the star, by
// Gauss and Newton, so that a few sweeps do. The last of them take residuals by their size instead of its square, as the
// means that are told do, by iteratively reweighted least squares (Holland and Welsch 1977): squares spread what an irregular
// vertex costs over all around it.
#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/remesh/remesher.h"

namespace tessera {
namespace {

constexpr double kHexagon = 0.8660254037844386;  ///< area around a vertex of equilateral triangles of edge 1
constexpr double kDifference = 1e-3;             ///< targets: to differentiate by
constexpr double kFarthestMove = 0.25;           ///< targets: of a move
// Residuals below these count by their square: shares of a cell, sines of what angles are off 60 degrees.
constexpr double kLeastShare = 0.02, kLeastSine = 0.06;
constexpr double kHeldWeight = 1.0;  ///< of the middle of the neighbours then

using Shares = std::array<double, 3>;

/// What of the triangle belongs to the mixed Voronoi cells of its corners (Meyer et al. 2003).
Shares cell_shares(const Double3& a, const Double3& b, const Double3& c) {
  const Double3 ab = b - a, bc = c - b, ca = a - c;
  const double twice = norm(cross(ab, bc));
  if (!(twice > 0.0)) return {};
  const double xa = -dot(ab, ca), xb = -dot(ab, bc), xc = -dot(bc, ca);  // cotangents times twice the area
  if (xa < 0.0 || xb < 0.0 || xc < 0.0)
    return {twice * (xa < 0.0 ? 0.25 : 0.125), twice * (xb < 0.0 ? 0.25 : 0.125),
            twice * (xc < 0.0 ? 0.25 : 0.125)};
  const double wab = dot(ab, ab) * xc, wbc = dot(bc, bc) * xa, wca = dot(ca, ca) * xb, per = 0.125 / twice;
  return {(wab + wca) * per, (wab + wbc) * per, (wbc + wca) * per};
}

/// Normal equations of a move in a plane, of residuals that it changes.
struct MoveFit {
  double xx, xy, yy, x, y;
  /// \param change  of the residual by a move of one along either axis \param missing  of it to what is wanted
  void add(const std::array<double, 2>& change, double missing, double weight) {
    const double wx = weight * change[0], wy = weight * change[1];
    xx += wx * change[0], xy += wx * change[1], yy += wy * change[1];
    x += wx * missing, y += wy * missing;
  }
};

/// What the three angles of the face ask of its first corner, in the plane of the axes.
void add_angles(MoveFit& fit, const Double3& p, const Double3& a, const Double3& b, const Double3 (&axis)[2],
                double target, double weight) {
  const Double3 pa = a - p, pb = b - p, ab = b - a, normal = cross(pa, pb);
  const double twice = norm(normal), a2 = dot(pa, pa), b2 = dot(pb, pb), c2 = dot(ab, ab);
  if (!(twice > 0.0)) return;
  const auto add = [&](double cosine, double squares, const std::array<double, 2>& change) {
    const double per = 1.0 / std::sqrt(squares), sine = per * (0.5 * twice - kHexagon * cosine);
    fit.add(change, -sine, weight / std::max(std::fabs(sine), kLeastSine));
  };
  // A side turns about its other end as its first one moves across it.
  const Double3 across_a = cross(normal, pa) * (-target / (twice * a2)),
                across_b = cross(normal, pb) * (target / (twice * b2));
  const std::array<double, 2> at_a = {dot(across_a, axis[0]), dot(across_a, axis[1])},
                              at_b = {dot(across_b, axis[0]), dot(across_b, axis[1])};
  add(-dot(pa, ab), a2 * c2, at_a);
  add(dot(pb, ab), b2 * c2, at_b);
  add(dot(pa, pb), a2 * b2, {-at_a[0] - at_b[0], -at_a[1] - at_b[1]});
}

}  // namespace

/// Of an area at the vertex, what share of the cell that its target asks for.
double Remesher::share_of_cell(std::uint32_t v, double area) const {
  const double target = info_[v].target;
  return area / (kHexagon * target * target);
}

void Remesher::measure_cells() {
  cells_.assign(info_.size(), 0.0);
  for (const CollapseFace& f : mesh_.faces()) {
    if (f.state & kStateDead) continue;
    const Shares shares = cell_shares(mesh_.at(f.vertex[0]), mesh_.at(f.vertex[1]), mesh_.at(f.vertex[2]));
    for (std::size_t i = 0; i < 3; ++i) cells_[f.vertex[i]] += shares[i];
  }
}

/// Adds `sign` times what the faces of the gathered star, with its centre at p, are to the cells.
void Remesher::add_star_to_cells(std::uint32_t v, const Double3& p, double sign) {
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::uint32_t a = star_.ring[i], b = star_.ring[star_.following(i)];
    const Shares shares = cell_shares(p, mesh_.at(a), mesh_.at(b));
    cells_[v] += sign * shares[0];
    cells_[a] += sign * shares[1];
    cells_[b] += sign * shares[2];
  }
}

/// Of the cells that faces of the block close around, the mean of their shares.
double Remesher::mean_share() const {
  double sum = 0.0;
  std::size_t cells = 0;
  for (std::uint32_t v = 0; v < info_.size(); ++v) {
    if (mesh_.state(v) & (kVertexKept | kVertexOpen)) continue;
    sum += share_of_cell(v, cells_[v]);
    ++cells;
  }
  return cells > 0 ? sum / static_cast<double>(cells) : 1.0;
}

/// Where the cells of the gathered star become most alike, and its centre does not leave the middle of the ring too far.
/// \param mean  above 0: residuals count by their size, of angles too, and of shares from this one
Double3 Remesher::wish_for_cells(std::uint32_t v, double mean) const {
  const Double3 at = mesh_.at(v), middle = wish(v);
  if (!star_.closed || info_[v].line) return middle;
  Double3 normal{};
  for (std::size_t i = 0; i < star_.faces; ++i)
    normal = normal + cross(mesh_.at(star_.ring[i]) - at, mesh_.at(star_.ring[star_.following(i)]) - at);
  const double length = norm(normal), target = info_[v].target;
  if (!(length > 0.0)) return middle;
  normal = normal * (1.0 / length);
  const Double3 spoke = mesh_.at(star_.ring[0]) - at, across = spoke - normal * dot(spoke, normal);
  const double width = norm(across);
  if (!(width > 0.0)) return middle;
  const Double3 axis[2] = {across * (1.0 / width), cross(normal, across) * (1.0 / width)};
  const bool by_size = mean > 0.0;
  const double held = by_size ? kHeldWeight : options_.angle_weight;
  const Double3 to_middle = (middle - at) * (1.0 / target);
  MoveFit fit{held, 0.0, held, held * dot(to_middle, axis[0]), held * dot(to_middle, axis[1])};
  // Of the centre's cell, then of those of the ring: how they change with a move of a target along either axis.
  std::array<std::array<double, 2>, kMaxRing + 2> change{};
  const std::size_t size = star_.ring_size();
  for (std::size_t i = 0; i < star_.faces; ++i) {
    const std::size_t next = star_.following(i);
    const std::uint32_t a = star_.ring[i], b = star_.ring[next];
    const Shares before = cell_shares(at, mesh_.at(a), mesh_.at(b));
    for (std::size_t k = 0; k < 2; ++k) {
      const Shares after = cell_shares(at + axis[k] * (kDifference * target), mesh_.at(a), mesh_.at(b));
      change[size][k] += share_of_cell(v, after[0] - before[0]) / kDifference;
      change[i][k] += share_of_cell(a, after[1] - before[1]) / kDifference;
      change[next][k] += share_of_cell(b, after[2] - before[2]) / kDifference;
    }
    if (by_size) add_angles(fit, at, mesh_.at(a), mesh_.at(b), axis, target, options_.sine_weight);
  }
  for (std::size_t i = 0; i <= size; ++i) {
    const std::uint32_t w = i < size ? star_.ring[i] : v;
    const double missing = (by_size ? mean : 1.0) - share_of_cell(w, cells_[w]);
    fit.add(change[i], missing, by_size ? 1.0 / std::max(std::fabs(missing), kLeastShare) : 1.0);
  }
  const double determinant = fit.xx * fit.yy - fit.xy * fit.xy;
  if (!(determinant > 0.0)) return middle;
  double dx = (fit.yy * fit.x - fit.xy * fit.y) / determinant,
         dy = (fit.xx * fit.y - fit.xy * fit.x) / determinant;
  const double far = std::sqrt(dx * dx + dy * dy);
  if (far > kFarthestMove) dx *= kFarthestMove / far, dy *= kFarthestMove / far;
  return at + (axis[0] * dx + axis[1] * dy) * target;
}

void Remesher::even_cells(RemeshReport& report) {
  measure_cells();
  begin_guarding();
  for (int i = 0; i < options_.last_relaxations + options_.size_relaxations; ++i) {
    const double mean = i < options_.last_relaxations ? 0.0 : mean_share();
    for (std::uint32_t v = 0; v < info_.size(); ++v) {
      step();
      if ((mesh_.state(v) & kVertexKept) || !mesh_.gather(v, star_)) continue;
      if (info_[v].foot == ReferenceSurface::kNone) continue;
      const Double3 old = mesh_.at(v);
      if (!move_if_far(v, wish_for_cells(v, mean), report)) continue;
      ++report.moves;
      add_star_to_cells(v, old, -1.0);
      add_star_to_cells(v, mesh_.at(v), 1.0);
    }
  }
  std::vector<double>().swap(cells_);
}

}  // namespace tessera
