#include "kernels/holes/hole_filling.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>

#include "kernels/holes/hole_mesh.h"
#include "kernels/holes/hole_triangulation.h"
#include "octree/vector.h"
#include "solvers/envelope_cholesky.h"
#include "solvers/sparse_matrix.h"

namespace tessera {
namespace {

/// Below this mean cosine at the rim, of the loop or of the patch, the patch folds back over the faces it should continue. A
/// cap on a tube has 0, the outside of a flat piece -1.
constexpr double kMinBoundaryCosine = -0.4;
/// Slivers must not own the energy: bounds of the cotangents, and of the area under a hinge in squared edges.
constexpr double kMaxCotangent = 10.0;
constexpr double kMinArea = 0.05;
constexpr int kRelaxRounds = 12;
/// The coefficients of the energy come from the shape it changes; a second time they fit.
constexpr int kDihedralRounds = 2;
/// More entries per unknown in the envelope are not factored: hole_bytes() holds. A round hole of the most
/// vertices has 250.
constexpr std::uint64_t kMaxEnvelope = 400;

/// Cosine between the vector area of the loop, as a filling runs, and the mesh's normals at the rim, mean weighted by
/// length: 1 for a hole in a sheet, 0 for the end of a tube, -1 for the outer border of a sheet. Unlike the faces of a
/// triangulation it says the same of a border that goes up and down.
double loop_cosine(const HoleLoop& loop, const std::vector<Double3>& boundary_normal) {
  const std::vector<Double3>& p = loop.position;
  Double3 area{};
  for (std::size_t i = 1; i + 1 < p.size(); ++i) area = area + triangle_normal(p[0], p[i], p[i + 1]);
  area = unit_or_zero(area);
  double sum = 0.0, length_sum = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double length = norm(p[(i + 1) % p.size()] - p[i]);
    length_sum += length;
    sum += length * dot(area, boundary_normal[i]);
  }
  return length_sum > 0.0 ? sum / length_sum : 1.0;
}

/// Length of the rim's edges, root mean square: slivers count little.
double boundary_edge(const HoleLoop& loop) {
  double sum = 0.0;
  const std::size_t n = loop.position.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Double3 d = loop.position[(i + 1) % n] - loop.position[i];
    sum += dot(d, d);
  }
  return std::sqrt(sum / static_cast<double>(n));
}

double boundary_length(const HoleLoop& loop) {
  double sum = 0.0;
  const std::size_t n = loop.position.size();
  for (std::size_t i = 0; i < n; ++i) sum += norm(loop.position[(i + 1) % n] - loop.position[i]);
  return sum;
}

double area_of(const HoleLoop& loop, const std::vector<std::array<std::uint32_t, 3>>& faces) {
  double sum = 0.0;
  for (const auto& f : faces) {
    const Double3& a = loop.position[f[0]];
    sum += 0.5 * norm(cross(loop.position[f[1]] - a, loop.position[f[2]] - a));
  }
  return sum;
}

double cotangent(const Double3& a, const Double3& b) {
  const double c = dot(a, b), s = norm(cross(a, b));
  if (!(std::fabs(c) < kMaxCotangent * s)) return c < 0.0 ? -kMaxCotangent : kMaxCotangent;
  return c / s;
}

/// Bending energy of one edge: (weight / 2) |sum_k factor[k] x_k|^2 over its two ends and the two corners
/// opposite.
struct Hinge {
  std::array<std::uint32_t, 4> vertex;
  std::array<double, 4> factor;
  double weight = 0.0;
};

/// x0, x1 the edge, x2 and x3 the corners opposite. Zero for four points in a plane.
Hinge make_hinge(const std::array<std::uint32_t, 4>& vertex, const std::vector<Double3>& x, double edge) {
  const Double3 &x0 = x[vertex[0]], &x1 = x[vertex[1]], &x2 = x[vertex[2]], &x3 = x[vertex[3]];
  const double c01 = cotangent(x1 - x0, x2 - x0), c02 = cotangent(x1 - x0, x3 - x0);
  const double c03 = cotangent(x0 - x1, x2 - x1), c04 = cotangent(x0 - x1, x3 - x1);
  const double area = 0.5 * (norm(cross(x1 - x0, x2 - x0)) + norm(cross(x1 - x0, x3 - x0)));
  return {
      vertex, {c03 + c04, c01 + c02, -c01 - c03, -c02 - c04}, 3.0 / std::max(area, kMinArea * edge * edge)};
}

/// Inner edges of the patch and its rim; the rim's fourth vertices are those of well-shaped triangles that
/// continue the mesh, appended to `x` behind the patch's own.
std::vector<Hinge> make_hinges(const HoleMesh& mesh, const std::vector<Double3>& boundary_normal, double edge,
                               std::vector<Double3>& x) {
  std::vector<Hinge> hinges;
  const auto& triangles = mesh.triangles();
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (std::uint32_t e = 0; e < 3; ++e) {
      const auto& v = triangles[t].vertex;
      const std::uint32_t a = v[e], b = v[(e + 1) % 3], c = v[(e + 2) % 3], u = triangles[t].neighbour[e];
      if (u == HoleMesh::kBoundary) {
        const Double3 out =
            unit_or_zero(cross(x[b] - x[a], boundary_normal[a]));  // the rim's edge a runs to a + 1
        x.push_back((x[a] + x[b]) * 0.5 + out * (0.866 * edge));
        hinges.push_back(make_hinge({a, b, c, static_cast<std::uint32_t>(x.size() - 1)}, x, edge));
      } else if (t < u) {
        const auto& w = triangles[u].vertex;
        std::uint32_t d = 0;
        for (const std::uint32_t k : w)
          if (k != a && k != b) d = k;
        hinges.push_back(make_hinge({a, b, c, d}, x, edge));
      }
    }
  }
  return hinges;
}

/// Smallest cosine between the normals of two faces that meet in the patch or at its rim.
double sharpest(HoleMesh& mesh, const HoleLoop& loop) {
  const auto& x = mesh.positions();
  const auto& triangles = mesh.triangles();
  const auto normal_of = [&](const HoleMesh::Triangle& t) {
    const Double3& a = x[t.vertex[0]];
    return unit_or_zero(cross(x[t.vertex[1]] - a, x[t.vertex[2]] - a));
  };
  double minimum = 1.0;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const Double3 normal = normal_of(triangles[t]);
    for (std::uint32_t e = 0; e < 3; ++e) {
      const std::uint32_t u = triangles[t].neighbour[e];
      if (u != HoleMesh::kBoundary) {
        if (t < u) minimum = std::min(minimum, dot(normal, normal_of(triangles[u])));
        continue;
      }
      const std::uint32_t a = triangles[t].vertex[e], b = triangles[t].vertex[(e + 1) % 3];
      const Double3 beyond = unit_or_zero(cross(x[a] - x[b], loop.opposite[a] - x[b]));
      minimum = std::min(minimum, dot(normal, beyond));
    }
  }
  return minimum;
}

struct Term {
  std::uint32_t row, column;
  double value;
};

/// By row, then column, those of one entry in the order in which they were.
void sort_terms(std::uint32_t n, std::vector<Term>& terms) {
  std::vector<Term> sorted(terms.size());
  std::vector<std::size_t> place(n + std::size_t{1});
  for (const auto key : {&Term::column, &Term::row}) {
    std::fill(place.begin(), place.end(), std::size_t{0});
    for (const Term& t : terms) ++place[t.*key + std::size_t{1}];
    for (std::size_t k = 0; k < n; ++k) place[k + 1] += place[k];
    for (const Term& t : terms) sorted[place[t.*key]++] = t;
    terms.swap(sorted);
  }
}

/// Moves vertices [first, last) of x to the least energy, the others fixed. False if the system is too large
/// or not definite; then x stays.
bool minimise(const std::vector<Hinge>& hinges, std::uint32_t first, std::uint32_t last,
              std::vector<Double3>& x) {
  const std::uint32_t n = last - first;
  std::vector<Double3> right(n);
  std::vector<Term> terms;
  for (const Hinge& hinge : hinges) {
    for (std::size_t i = 0; i < 4; ++i) {
      if (hinge.vertex[i] < first || hinge.vertex[i] >= last) continue;
      const std::uint32_t row = hinge.vertex[i] - first;
      for (std::size_t j = 0; j < 4; ++j) {
        const double q = hinge.weight * hinge.factor[i] * hinge.factor[j];
        const std::uint32_t v = hinge.vertex[j];
        if (v >= first && v < last)
          terms.push_back({row, v - first, q});
        else
          right[row] = right[row] - x[v] * q;
      }
    }
  }
  sort_terms(n, terms);
  SparseMatrix matrix;
  matrix.rows = matrix.columns = static_cast<std::int32_t>(n);
  matrix.start.assign(n + std::size_t{1}, 0);
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (i > 0 && terms[i].row == terms[i - 1].row && terms[i].column == terms[i - 1].column) {
      matrix.value.back() += terms[i].value;
      continue;
    }
    matrix.column.push_back(static_cast<std::int32_t>(terms[i].column));
    matrix.value.push_back(terms[i].value);
    ++matrix.start[terms[i].row + std::size_t{1}];
  }
  std::vector<Term>().swap(terms);
  for (std::size_t r = 0; r < n; ++r) matrix.start[r + 1] += matrix.start[r];
  EnvelopeCholesky solver(matrix);
  if (solver.envelope() > kMaxEnvelope * n || !solver.factor(matrix)) return false;
  std::vector<double> axis(n);
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t v = 0; v < n; ++v) axis[v] = right[v][a];
    solver.solve(axis);
    for (std::size_t v = 0; v < n; ++v) x[first + v][a] = axis[v];
  }
  return true;
}

/// A patch over a triangulation of the loop, whatever its angles.
HoleFilling make_patch(const HoleLoop& loop, const std::vector<Double3>& boundary_normal,
                       const HoleTriangulation& start, bool smooth, double area, std::uint64_t maximum) {
  const auto n = static_cast<std::uint32_t>(loop.position.size());
  HoleFilling out;
  // Triangles with edges of length e cover sqrt(3)/4 e^2, and there are two of them to a vertex.
  const double boundary = boundary_edge(loop);
  const double edge = std::max(boundary, std::sqrt(area / (0.866 * 0.75 * static_cast<double>(maximum + 1))));
  HoleMesh mesh(loop, start.faces);
  mesh.refine(edge, maximum);
  mesh.relax(kRelaxRounds);
  const auto all = static_cast<std::uint32_t>(mesh.positions().size());
  for (int round = 0; smooth && round < kDihedralRounds && all > n; ++round) {
    std::vector<Double3> x = mesh.positions();
    const std::vector<Hinge> hinges = make_hinges(mesh, boundary_normal, boundary, x);
    out.fair = minimise(hinges, n, all, x);
    if (!out.fair) break;
    x.resize(all);
    mesh.positions() = std::move(x);
  }
  out.min_cosine = sharpest(mesh, loop);
  out.position.assign(mesh.positions().begin() + n, mesh.positions().end());
  if (!mesh.colours().empty()) out.rgba.assign(mesh.colours().begin() + n, mesh.colours().end());
  for (const HoleMesh::Triangle& t : mesh.triangles()) out.faces.push_back(t.vertex);
  return out;
}

}  // namespace

struct HoleFiller::Made {
  std::vector<Double3> boundary_normal;
  double cosine = 0.0;  ///< loop_cosine()
  std::optional<HoleTriangulation> least_dihedral, least_area;
  std::optional<HoleFilling> smooth;
  std::uint64_t smooth_maximum = 0;  ///< of its vertices
};

HoleFiller::HoleFiller(const HoleLoop& loop) : loop_(loop), made_(std::make_unique<Made>()) {
  assert(loop.position.size() >= 3 && loop.position.size() <= kMaxHoleEdges &&
         loop.opposite.size() == loop.position.size());
  made_->boundary_normal = boundary_normals(loop);
  made_->cosine = loop_cosine(loop, made_->boundary_normal);
}

HoleFiller::~HoleFiller() = default;

HoleFilling HoleFiller::fill(const HoleLimits& limits) {
  const bool is_smooth = limits.shape == HoleShape::kSmooth;
  HoleFilling out;
  const auto refused = [&](HoleOutcome why) {
    out.outcome = why;
    return out;
  };
  if (!limits.outer && made_->cosine < kMinBoundaryCosine) return refused(HoleOutcome::kOuter);
  std::optional<HoleTriangulation>& start = is_smooth ? made_->least_dihedral : made_->least_area;
  if (!start)
    start = triangulate_hole(loop_, made_->boundary_normal,
                             is_smooth ? TriangulationGoal::kLeastDihedral : TriangulationGoal::kLeastArea);
  if (start->faces.empty()) return refused(HoleOutcome::kTaken);
  if (!limits.outer && start->boundary_cosine < kMinBoundaryCosine) return refused(HoleOutcome::kOuter);
  const double area = area_of(loop_, start->faces);
  out.width = 4.0 * area / boundary_length(loop_);
  if (out.width > limits.width) return refused(HoleOutcome::kWide);
  const std::uint64_t maximum = std::min(max_hole_vertices(loop_.position.size()), limits.vertices);
  HoleFilling patch;
  if (is_smooth && made_->smooth && made_->smooth_maximum == maximum)
    patch = *made_->smooth;
  else
    patch = make_patch(loop_, made_->boundary_normal, *start, is_smooth, area, maximum);
  if (is_smooth) made_->smooth = patch, made_->smooth_maximum = maximum;
  patch.width = out.width;
  if (!(patch.min_cosine < limits.min_cosine)) return patch;
  out.fair = patch.fair;
  out.min_cosine = patch.min_cosine;
  return refused(HoleOutcome::kSharp);
}

HoleFilling fill_hole(const HoleLoop& loop, const HoleLimits& limits) {
  return HoleFiller(loop).fill(limits);
}

}  // namespace tessera
