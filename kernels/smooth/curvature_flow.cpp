#include "kernels/smooth/curvature_flow.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "octree/edge_faces.h"
#include "octree/error.h"
#include "octree/union_find.h"
#include "octree/vector.h"
#include "solvers/laplacian_system.h"

namespace tessera {
namespace {

using Columns = Double3;

/// Of the linear systems: the first is that of the whole step, the second of the membranes inside a plate's.
constexpr double kTolerance = 1e-8;
constexpr double kInnerTolerance = 1e-6;
/// Each step of a plate's solver leaves about a sixth of the error.
constexpr int kMaxFlowSteps = 60;
/// A part of a step is not cut shorter than 2^-10 of it, and no step is cut more often than 64 times.
constexpr int kMaxHalvings = 10;
constexpr int kMaxCuts = 64;
/// Where more than so many vertices, and one in fifty, would have to move as one, the step is too long.
constexpr std::size_t kFewVertices = 20, kShareOfVertices = 50;
/// Times that faces beside those which move as one may join them.
constexpr int kMaxRounds = 20;

std::span<double> flat(std::vector<Double3>& v) {
  return {v.empty() ? nullptr : v.front().data(), 3 * v.size()};
}
std::span<const double> flat(std::span<const Double3> v) {
  return {v.empty() ? nullptr : v.front().data(), 3 * v.size()};
}

Columns dots(std::span<const Double3> u, std::span<const Double3> v) {
  Columns s = {0, 0, 0};
  for (std::size_t i = 0; i < u.size(); ++i)
    for (std::size_t a = 0; a < 3; ++a) s[a] += u[i][a] * v[i][a];
  return s;
}

/// L f at all vertices, from differences, so that nothing is lost far from the origin.
std::vector<Double3> stiffness_times(const SparseMatrix& stiffness, std::span<const Double3> f) {
  std::vector<Double3> out(f.size(), Double3{0, 0, 0});
  for (std::size_t i = 0; i < f.size(); ++i)
    for (std::int32_t e = stiffness.start[i]; e < stiffness.start[i + 1]; ++e)
      for (std::size_t a = 0; a < 3; ++a)
        out[i][a] += stiffness.value[e] * (f[static_cast<std::size_t>(stiffness.column[e])][a] - f[i][a]);
  return out;
}

/// The systems of a flow, one after the other: analysed again only when the pattern changes.
///
/// With K = -L among the free vertices and a^2 = step, the plate's matrix M + step K M^-1 K lies between the half and
/// the whole of (M + a K) M^-1 (M + a K), since 1 + t^2 <= (1 + t)^2 <= 2 (1 + t^2): conjugate gradients with two
/// membranes as preconditioner take a dozen steps on any mesh, and the plate's matrix is never made.
class FlowSystem {
 public:
  FlowSystem(const FlowOptions& options, FlowReport& report) : flow_(options), report_(report) {
    options_.memory_bytes = options.memory_bytes;
    options_.neighbours = &neighbours_;
    options_.tolerance = options.order == 2 ? kInnerTolerance : kTolerance;
  }

  /// What a step moves, or nothing when there is no solution: the report says why.
  std::vector<Double3> displacements(std::span<const Double3> position, FaceSpan faces,
                                     std::span<const std::uint8_t> fixed, double step) {
    const Laplacian lap = laplacian({position, faces}, {.weights = flow_.weights});
    report_.degenerate_faces = lap.report.degenerate_faces;
    if (!factor(lap, laplacian_system(lap, 1, fixed), position, step)) return {};
    std::vector<Double3> load = stiffness_times(lap.stiffness, position);
    if (flow_.order == 2) {
      // No bending at fixed vertices. Half a star tells of none: L f there is the slope across the border, and a plate
      // that is to have none folds over the border.
      for (std::size_t v = 0; v < load.size(); ++v)
        for (double& x : load[v]) x = fixed[v] != 0 ? 0.0 : -x / lap.mass[v];
      load = stiffness_times(lap.stiffness, load);
    }
    std::vector<Double3> b(vertex_.size()), x(vertex_.size(), Double3{0, 0, 0});
    for (std::size_t i = 0; i < b.size(); ++i)
      for (std::size_t a = 0; a < 3; ++a) b[i][a] = step * load[vertex_[i]][a];
    report_.solve = flow_.order == 2 ? solve_plate(b, x) : solver_->solve(flat(b), flat(x), 3);
    ++report_.systems;
    if (report_.solve.status != SolveStatus::kSolved) return {};
    std::vector<Double3> out(position.size(), Double3{0, 0, 0});
    for (std::size_t i = 0; i < x.size(); ++i) out[vertex_[i]] = x[i];
    return out;
  }

 private:
  bool factor(const Laplacian& lap, ConstrainedSystem system, std::span<const Double3> position,
              double step) {
    vertex_.assign(system.free_vertices.begin(), system.free_vertices.end());
    report_.unknowns = vertex_.size();
    at_.resize(vertex_.size());
    mass_.resize(vertex_.size());
    for (std::size_t i = 0; i < vertex_.size(); ++i) {
      at_[i] = position[vertex_[i]];
      mass_[i] = lap.mass[vertex_[i]];
    }
    step_ = step;
    neighbours_ = mesh_neighbours(lap, system);
    stiffness_ = std::move(system.matrix);
    SparseMatrix membrane =
        sum(1.0, diagonal_matrix(mass_), flow_.order == 2 ? std::sqrt(step) : step, stiffness_);
    const bool same = solver_ && membrane.start == membrane_.start && membrane.column == membrane_.column;
    membrane_ = std::move(membrane);
    if (!same) {
      options_.positions = at_;
      solver_ = make_solver(flow_.direct ? SolverKind::kAutomatic : SolverKind::kMultigrid, options_);
      report_.factor = solver_->analyse(membrane_);
      report_.choice = report_.factor.choice;
    }
    if (report_.factor.status == SolveStatus::kSolved) report_.factor = solver_->factor(membrane_);
    return report_.factor.status == SolveStatus::kSolved;
  }

  /// z = (M + a K)^-1 M (M + a K)^-1 r
  SolveReport precondition(std::span<const Double3> r, std::vector<Double3>& z) {
    scratch_.resize(r.size());
    SolveReport report = solver_->solve(flat(r), flat(scratch_), 3);
    if (report.status != SolveStatus::kSolved) return report;
    for (std::size_t i = 0; i < r.size(); ++i)
      for (double& x : scratch_[i]) x *= mass_[i];
    return solver_->solve(flat(scratch_), flat(z), 3);
  }

  /// y = (M + step K M^-1 K) p
  void plate_times(std::span<const Double3> p, std::vector<Double3>& y) {
    multiply(stiffness_, flat(p), flat(scratch_), 3);
    for (std::size_t i = 0; i < p.size(); ++i)
      for (double& x : scratch_[i]) x /= mass_[i];
    multiply(stiffness_, flat(scratch_), flat(y), 3);
    for (std::size_t i = 0; i < p.size(); ++i)
      for (std::size_t a = 0; a < 3; ++a) y[i][a] = mass_[i] * p[i][a] + step_ * y[i][a];
  }

  /// Conjugate gradients that bear a preconditioner which is not quite the same at every step (Notay 2000). \pre x = 0
  SolveReport solve_plate(std::vector<Double3> r, std::vector<Double3>& x) {
    const std::size_t n = r.size();
    std::vector<Double3> z(n), p(n, Double3{0, 0, 0}), ap(n, Double3{0, 0, 0});
    Columns first{}, energy{};
    SolveReport out;
    for (; out.iterations < kMaxFlowSteps; ++out.iterations) {
      SolveReport inner = precondition(r, z);
      if (inner.status != SolveStatus::kSolved) return inner;
      const Columns rz = dots(r, z), overlap = dots(ap, z);
      if (out.iterations == 0) first = rz;
      // r^T z is the square of the error in the norm of the energy, but for a factor of 1 to 2.
      out.residual = 0.0;
      bool definite = true;
      for (std::size_t a = 0; a < 3; ++a) {
        definite &= rz[a] >= 0.0;
        if (first[a] > 0.0) out.residual = std::max(out.residual, std::sqrt(std::fabs(rz[a]) / first[a]));
      }
      if (out.residual <= kTolerance) return out;
      if (!definite) break;
      Columns share{};
      for (std::size_t a = 0; a < 3; ++a) share[a] = energy[a] > 0.0 ? -overlap[a] / energy[a] : 0.0;
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t a = 0; a < 3; ++a) p[i][a] = z[i][a] + share[a] * p[i][a];
      plate_times(p, ap);
      energy = dots(p, ap);
      const Columns gain = dots(r, p);
      for (std::size_t a = 0; a < 3; ++a) share[a] = energy[a] > 0.0 ? gain[a] / energy[a] : 0.0;
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t a = 0; a < 3; ++a) {
          x[i][a] += share[a] * p[i][a];
          r[i][a] -= share[a] * ap[i][a];
        }
    }
    out.status = SolveStatus::kNotConverged;
    out.message = "the thin plate's system is not solved after " + std::to_string(out.iterations) + " steps";
    return out;
  }

  const FlowOptions& flow_;
  FlowReport& report_;
  SolverOptions options_;
  std::vector<std::size_t> vertex_;  ///< of each unknown
  std::vector<double> mass_;
  double step_ = 0.0;
  SparseMatrix stiffness_;             ///< K
  std::vector<Double3> at_, scratch_;  // at_, neighbours_ and membrane_ are read by the solver
  SparseMatrix neighbours_, membrane_;
  std::unique_ptr<LinearSolver> solver_;
};

/// Which faces a step folds.
class FoldTest {
 public:
  FoldTest(std::size_t vertices, FaceSpan faces) : faces_(faces) {
    EdgeFaces(vertices, faces)
        .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
          if (half.size() == 2) pairs_.emplace_back(half[0] / 3, half[1] / 3);
        });
  }

  /// Faces that turn over and oppose more of their neighbours than before: what turns back into its surroundings heals.
  std::vector<std::uint32_t> faces(std::span<const Double3> before, std::span<const Double3> after) const {
    const std::vector<Double3> was = normals(before), is = normals(after);
    std::vector<int> more(faces_.size(), 0);
    for (const auto& [f, g] : pairs_) {
      const int change =
          static_cast<int>(dot(is[f], is[g]) < 0.0) - static_cast<int>(dot(was[f], was[g]) < 0.0);
      more[f] += change;
      more[g] += change;
    }
    std::vector<std::uint32_t> out;
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (dot(was[f], is[f]) < 0.0 && more[f] > 0) out.push_back(f);
    return out;
  }

 private:
  /// Not of unit length.
  std::vector<Double3> normals(std::span<const Double3> position) const {
    std::vector<Double3> out(faces_.size());
    for (std::size_t f = 0; f < out.size(); ++f) {
      const auto& [p, q, r] = faces_[f];
      out[f] = cross(position[q] - position[p], position[r] - position[p]);
    }
    return out;
  }

  FaceSpan faces_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;  ///< faces that share an edge
};

/// Vertices that move as one, so that the faces between them cannot turn.
class Clusters {
 public:
  explicit Clusters(std::size_t vertices) : sets_(vertices) {}
  void join(const std::array<std::uint32_t, 3>& face) {
    for (const std::uint32_t v : face) sets_.unite(face[0], v);
  }
  /// Takes the mean displacement of each cluster, none where it holds a fixed vertex. \return vertices in clusters
  std::size_t level(std::span<const std::uint8_t> fixed, std::vector<Double3>& moved) {
    std::map<std::uint32_t, std::vector<std::uint32_t>> members;
    for (std::uint32_t v = 0; v < sets_.size(); ++v)
      if (const std::uint32_t r = sets_.find(v); r != v) members[r].push_back(v);
    std::size_t count = 0;
    for (auto& [first, others] : members) {
      others.push_back(first);
      Double3 mean = {0, 0, 0};
      bool pinned = false;
      for (const std::uint32_t v : others) {
        pinned |= fixed[v] != 0;
        for (std::size_t a = 0; a < 3; ++a) mean[a] += moved[v][a] / static_cast<double>(others.size());
      }
      for (const std::uint32_t v : others) moved[v] = pinned ? Double3{0, 0, 0} : mean;
      count += others.size();
    }
    return count;
  }

 private:
  UnionFind sets_;
};

std::vector<Double3> plus(std::span<const Double3> position, std::span<const Double3> moved) {
  std::vector<Double3> out(position.begin(), position.end());
  for (std::size_t v = 0; v < out.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a) out[v][a] += moved[v][a];
  return out;
}

/// Where a step leads without folding a face; the few that would fold move as one with their vertices.
/// \param folding  those that fold before; those that fold still, when nothing is returned
/// \param as_one   grows by the number of faces that move as one
std::vector<Double3> unfolded(const FoldTest& fold, FaceSpan faces, std::span<const std::uint8_t> fixed,
                              std::span<const Double3> now, std::vector<Double3> moved,
                              std::vector<std::uint32_t>& folding, std::size_t& as_one) {
  std::vector<Double3> next = plus(now, moved);
  folding = fold.faces(now, next);
  if (folding.empty()) return next;
  Clusters clusters(now.size());
  std::size_t joined = 0;
  for (int round = 0; round < kMaxRounds; ++round) {
    for (const std::uint32_t f : folding) clusters.join(faces[f]);
    joined += folding.size();
    if (clusters.level(fixed, moved) > kFewVertices + now.size() / kShareOfVertices) return {};
    next = plus(now, moved);
    folding = fold.faces(now, next);
    if (!folding.empty()) continue;
    as_one += joined;
    return next;
  }
  return {};
}

}  // namespace

FlowReport curvature_flow(std::span<Double3> position, FaceSpan faces, std::span<const std::uint8_t> fixed,
                          const FlowOptions& options) {
  if (fixed.size() != position.size())
    throw UsageError(std::to_string(fixed.size()) + " flags for " + std::to_string(position.size()) +
                     " vertices");
  if (options.order < 1 || options.order > 2)
    throw UsageError("a flow of order " + std::to_string(options.order) + " is not supported: use 1 or 2");
  if (options.steps < 1 || !(options.step > 0.0)) throw UsageError("a flow needs steps of positive length");
  FlowReport report;
  FlowSystem system(options, report);
  const FoldTest fold(position.size(), faces);
  std::vector<Double3> now(position.begin(), position.end());
  // Lengths in parts of 2^-kMaxHalvings of a step.
  constexpr int kWhole = 1 << kMaxHalvings;
  for (int step = 0; step < options.steps; ++step) {
    int length = kWhole, cuts = 0;
    for (int done = 0; done < kWhole;) {
      length = std::min(length, kWhole - done);
      std::vector<Double3> moved =
          system.displacements(now, faces, fixed, options.step * (static_cast<double>(length) / kWhole));
      if (moved.empty()) return report;
      std::vector<std::uint32_t> folding;
      std::vector<Double3> next =
          unfolded(fold, faces, fixed, now, std::move(moved), folding, report.faces_as_one);
      if (folding.empty()) {
        now = std::move(next);
        done += length;
        length *= 2;
        continue;
      }
      if (length == 1 || ++cuts == kMaxCuts) {
        report.folding_faces = folding.size();
        report.first_folding = folding.front();
        return report;
      }
      length /= 2;
    }
  }
  std::copy(now.begin(), now.end(), position.begin());
  return report;
}

}  // namespace tessera
