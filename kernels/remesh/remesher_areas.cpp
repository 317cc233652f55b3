// The last relaxations: vertices go where angles and the areas of the cells around them become more alike. Botsch's thesis,
// 3.2.3, draws vertices to neighbours with large cells; here each move is the best one for the cells of the star, by
// Gauss and Newton, so that a few sweeps do.
#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/remesh/remesher.h"

namespace tessera {
namespace {

constexpr double kHexagon = 0.8660254037844386;  ///< area around a vertex of equilateral triangles of edge 1
constexpr double kDifference = 1e-3;             ///< targets: to differentiate by
constexpr double kFarthestMove = 0.25;           ///< targets: of a move

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

/// Where the cells of the gathered star become most alike, and its centre does not leave the middle of the ring too far.
Double3 Remesher::wish_for_cells(std::uint32_t v) const {
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
  }
  const double angles = options_.angle_weight;
  const Double3 to_middle = (middle - at) * (1.0 / target);
  double xx = angles, xy = 0.0, yy = angles, x = angles * dot(to_middle, axis[0]),
         y = angles * dot(to_middle, axis[1]);
  for (std::size_t i = 0; i <= size; ++i) {
    const std::uint32_t w = i < size ? star_.ring[i] : v;
    const double missing = 1.0 - share_of_cell(w, cells_[w]);
    const auto& [cx, cy] = change[i];
    xx += cx * cx, xy += cx * cy, yy += cy * cy;
    x += cx * missing, y += cy * missing;
  }
  const double determinant = xx * yy - xy * xy;
  if (!(determinant > 0.0)) return middle;
  double dx = (yy * x - xy * y) / determinant, dy = (xx * y - xy * x) / determinant;
  const double far = std::sqrt(dx * dx + dy * dy);
  if (far > kFarthestMove) dx *= kFarthestMove / far, dy *= kFarthestMove / far;
  return at + (axis[0] * dx + axis[1] * dy) * target;
}

void Remesher::even_cells(RemeshReport& report) {
  measure_cells();
  begin_guarding();
  for (int i = 0; i < options_.last_relaxations; ++i)
    for (std::uint32_t v = 0; v < info_.size(); ++v) {
      step();
      if ((mesh_.state(v) & kVertexKept) || !mesh_.gather(v, star_)) continue;
      if (info_[v].foot == ReferenceSurface::kNone) continue;
      const Double3 old = mesh_.at(v);
      if (!move_if_far(v, wish_for_cells(v), report)) continue;
      ++report.moves;
      add_star_to_cells(v, old, -1.0);
      add_star_to_cells(v, mesh_.at(v), 1.0);
    }
  std::vector<double>().swap(cells_);
}

}  // namespace tessera
