#include "kernels/maps/parameterize.h"

#include <algorithm>
#include <cmath>

#include "kernels/maps/disk_topology.h"
#include "octree/error.h"
#include "octree/portable_math.h"
#include "solvers/hermitian_multigrid.h"
#include "solvers/laplacian_system.h"
#include "solvers/multifrontal_solver.h"

namespace tessera {
namespace {

using Loop = std::vector<std::uint32_t>;

// Bytes a vertex beside the mesh, at the most; measured on disks of 10^4 to 10^6 vertices.
constexpr std::uint64_t kConformalSystemBytes = 230;  // the Laplacian and its split, without the solver
constexpr std::uint64_t kFactorSystemBytes =
    800;  // least squares: the system of both coordinates, without the factor
constexpr std::uint64_t kComplexBytes = 420;    // least squares by multigrid, all in all
constexpr std::uint64_t kMultigridBytes = 180;  // of the conformal system: the least that solves it
constexpr std::uint64_t kMinBytes = 4'000'000;
constexpr double kMultigridTolerance = 1e-8;
constexpr int kMaxCycles = 5000;

std::string mebibytes(std::uint64_t bytes) {
  return std::to_string((bytes >> 20) + 1) + " MiB";
}

/// Share of the border's length up to each of its vertices, in [0, 1).
std::vector<double> arc_shares(const TriangleSpan& mesh, const Loop& loop) {
  std::vector<double> share(loop.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    share[i] = sum;
    sum += norm(mesh.positions[loop[i]] - mesh.positions[loop[(i + 1) % loop.size()]]);
  }
  if (!(sum > 0.0)) throw InputError("the border of the mesh has no length; repair the mesh first");
  for (double& s : share) s /= sum;
  return share;
}

Double2 on_circle(double share) {
  const SinCos at = sin_cos(2.0 * kPi * share);
  return {0.5 + 0.5 * at.cos, 0.5 + 0.5 * at.sin};
}

/// Border vertices on the unit square. The four vertices nearest to a quarter of the length become its
/// corners, so that no face is cut off by a corner between two vertices.
void place_on_square(const Loop& loop, const std::vector<double>& share, std::vector<Double2>& uv) {
  const std::size_t n = loop.size();
  if (n < 4) throw InputError("a border of three vertices has no square; choose the circle");
  std::array<std::size_t, 5> corner{};
  for (std::size_t c = 1; c < 4; ++c) {
    std::size_t best = corner[c - 1] + 1;
    for (std::size_t i = best; i < n - (3 - c); ++i)
      if (std::fabs(share[i] - 0.25 * double(c)) < std::fabs(share[best] - 0.25 * double(c))) best = i;
    corner[c] = best;
  }
  corner[4] = n;
  constexpr std::array<Double2, 5> kCorners = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}}};
  for (std::size_t side = 0; side < 4; ++side) {
    const double low = share[corner[side]], high = side == 3 ? 1.0 : share[corner[side + 1]];
    for (std::size_t i = corner[side]; i < corner[side + 1]; ++i) {
      const double t = high > low ? (share[i] - low) / (high - low) : 0.0;
      for (std::size_t k = 0; k < 2; ++k)
        uv[loop[i]][k] = kCorners[side][k] + t * (kCorners[side + 1][k] - kCorners[side][k]);
    }
  }
}

Laplacian sound_laplacian(const TriangleSpan& mesh, bool clamped) {
  Laplacian lap = laplacian(
      mesh, {.weights = clamped ? LaplacianWeights::kClampedCotangent : LaplacianWeights::kCotangent});
  if (lap.report.degenerate_faces > 0)
    throw InputError(std::to_string(lap.report.degenerate_faces) +
                     " face(s) have no area, the first is face " +
                     std::to_string(lap.report.first_degenerate) +
                     ": they have no angles to keep; remesh or repair the mesh first");
  return lap;
}

/// Unused vertices have empty rows: they are held, or the matrix would be singular.
std::vector<std::uint8_t> unused_vertices(const TriangleSpan& mesh) {
  std::vector<std::uint8_t> unused(mesh.positions.size(), 1);
  for (const auto& face : mesh.faces)
    for (const std::uint32_t v : face) unused[v] = 0;
  return unused;
}

std::vector<Double3> positions_of(const TriangleSpan& mesh, const ConstrainedSystem& system) {
  std::vector<Double3> at;
  at.reserve(system.free_vertices.size());
  for (const std::int32_t v : system.free_vertices) at.push_back(mesh.positions[static_cast<std::size_t>(v)]);
  return at;
}

void require_solved(SolveStatus status, const std::string& message) {
  if (status == SolveStatus::kTooLarge) throw ResourceError(message);
  if (status == SolveStatus::kNotConverged)
    throw ResourceError("a factor does not fit the memory, and " + message + " instead: allow more memory");
  if (status != SolveStatus::kSolved) throw InputError("the mesh has no parameterization: " + message);
}

/// A factor in memory, the same bits on every machine, or null with the reason in report.choice where it does not fit.
/// \param memory  for both; 0 = no limit
std::unique_ptr<LinearSolver> fitting_factor(const SparseMatrix& a, std::uint64_t memory, FactorStore& store,
                                             ParameterizeReport& report) {
  auto solver = make_multifrontal_solver({.ordering = Ordering::kMinimumDegree, .tolerance = 1e-10}, store);
  report.factor = solver->analyse(a);
  require_solved(report.factor.status, report.factor.message);
  const std::uint64_t bytes = report.factor.peak_bytes + report.factor.factor_entries * sizeof(double);
  if (memory > 0 && bytes > memory) {
    report.choice = "a factor of " + std::to_string(a.rows) + " unknowns needs " + mebibytes(bytes) +
                    ", allowed are " + mebibytes(memory);
    return nullptr;
  }
  report.choice = std::to_string(a.rows) + " unknowns: Cholesky, the factor fits";
  return solver;
}

/// What comes after report.factor = solver.analyse(): factor, solve for all columns of `values`, which get the result.
void factor_and_solve(LinearSolver& solver, const ConstrainedSystem& system, std::span<double> values,
                      int columns, ParameterizeReport& report) {
  if (report.factor.status == SolveStatus::kSolved) report.factor = solver.factor(system.matrix);
  require_solved(report.factor.status, report.factor.message);
  const std::vector<double> b = system.right_hand_side(values, columns);
  std::vector<double> x(b.size());
  report.solve = solver.solve(b, x, columns);
  require_solved(report.solve.status, report.solve.message);
  system.scatter(x, values, columns);
}

void conformal(const TriangleSpan& mesh, const Loop& loop, const ParameterizeOptions& options,
               Parameterization& out) {
  const std::vector<double> share = arc_shares(mesh, loop);
  if (options.border == ParameterBorder::kSquare) {
    place_on_square(loop, share, out.uv);
  } else {
    for (std::size_t i = 0; i < loop.size(); ++i) out.uv[loop[i]] = on_circle(share[i]);
  }
  Laplacian lap = sound_laplacian(mesh, options.clamp_weights);
  out.report.negative_weights = lap.report.negative_weights;
  std::vector<std::uint8_t> fixed = unused_vertices(mesh);
  for (const std::uint32_t v : loop) fixed[v] = 1;
  if (std::count(fixed.begin(), fixed.end(), 0) == 0) return;  // every vertex lies on the border
  const ConstrainedSystem system = laplacian_system(lap, 1, fixed);
  lap = {};
  const std::vector<Double3> at = positions_of(mesh, system);
  const std::span<double> values(out.uv.front().data(), 2 * out.uv.size());
  SolverOptions how;
  if (options.memory_bytes > 0)
    how.memory_bytes = options.memory_bytes - fixed.size() * kConformalSystemBytes;
  how.tolerance = 1e-10;
  how.positions = at;
  ParameterizeReport& report = out.report;
  report.unknowns = system.free_vertices.size();
  MemoryFactorStore store;
  auto solver = fitting_factor(system.matrix, how.memory_bytes, store, report);
  if (!solver) {
    solver = make_solver(SolverKind::kMultigrid, how);
    report.factor = solver->analyse(system.matrix);
    report.choice += ", so multigrid";
  }
  factor_and_solve(*solver, system, values, 2, report);
}

/// Two border vertices far apart: pins at the ends of the border's longest extent distort least.
std::array<std::uint32_t, 2> far_pair(const TriangleSpan& mesh, const Loop& loop) {
  const auto farthest = [&](std::uint32_t from) {
    return *std::max_element(loop.begin(), loop.end(), [&](std::uint32_t a, std::uint32_t b) {
      return norm(mesh.positions[a] - mesh.positions[from]) < norm(mesh.positions[b] - mesh.positions[from]);
    });
  };
  const std::uint32_t a = farthest(loop.front());
  return {a, farthest(a)};
}

/// Into [0, 1]^2, shape kept.
void fit_unit_square(const TriangleSpan& mesh, std::vector<Double2>& uv) {
  Double2 low = {1e300, 1e300}, high = {-1e300, -1e300};
  for (const auto& face : mesh.faces)
    for (const std::uint32_t v : face)
      for (std::size_t k = 0; k < 2; ++k) {
        low[k] = std::min(low[k], uv[v][k]);
        high[k] = std::max(high[k], uv[v][k]);
      }
  const double extent = std::max(high[0] - low[0], high[1] - low[1]);
  for (Double2& p : uv)
    for (std::size_t k = 0; k < 2; ++k) p[k] = (p[k] - low[k]) / extent;
}

/// The area as part of the complex system of least squares, K of (A + iK) z with z = u + iv: the Dirichlet energy of u
/// and v minus the area they enclose, which is a sum over the border alone, 1/2 sum (u_i v_j - u_j v_i).
SparseMatrix area_form(std::size_t n, const Loop& loop) {
  std::vector<std::array<std::pair<std::int32_t, double>, 2>> row(n, {{{-1, 0.0}, {-1, 0.0}}});
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const std::uint32_t a = loop[i], b = loop[(i + 1) % loop.size()];
    row[a][0] = {static_cast<std::int32_t>(b), 0.5};
    row[b][1] = {static_cast<std::int32_t>(a), -0.5};
  }
  SparseMatrix m;
  m.rows = m.columns = static_cast<std::int32_t>(n);
  m.start.reserve(n + 1);
  m.start.push_back(0);
  for (auto& entries : row) {
    std::sort(entries.begin(), entries.end());
    for (const auto& [column, value] : entries)
      if (column >= 0) {
        m.column.push_back(column);
        m.value.push_back(value);
      }
    m.start.push_back(static_cast<std::int32_t>(m.column.size()));
  }
  return m;
}

/// The two systems of the complex form; where they agree on the fixed vertices, so do their right-hand sides.
struct ComplexSystem {
  ConstrainedSystem laplacian, area;
  std::vector<double> b;  // real and imaginary parts interleaved
};

ComplexSystem complex_system(SparseMatrix&& energy, const Loop& loop, const std::vector<std::uint8_t>& fixed,
                             std::span<const double> values) {
  ComplexSystem out;
  out.laplacian = constrain(energy, fixed);
  energy = {};
  out.area = constrain(area_form(fixed.size(), loop), fixed);
  out.b = out.laplacian.right_hand_side(values, 2);
  const std::vector<double> area = out.area.right_hand_side(values, 2);
  for (std::size_t i = 0; i < out.b.size(); i += 2) {
    out.b[i] -= area[i + 1];
    out.b[i + 1] += area[i];
  }
  return out;
}

/// Whether the factor fits and has served. If not, report.choice says why.
bool solve_by_factor(const SparseMatrix& energy, const Loop& loop, const std::vector<std::uint8_t>& fixed,
                     std::uint64_t memory, std::span<double> values, ParameterizeReport& report) {
  const std::uint64_t n = fixed.size();
  if (memory > 0 && memory <= n * kFactorSystemBytes) {
    report.choice = "for a factor the matrix alone needs " + mebibytes(n * kFactorSystemBytes) +
                    ", allowed are " + mebibytes(memory);
    return false;
  }
  std::vector<std::uint8_t> both(2 * fixed.size());
  for (std::size_t v = 0; v < fixed.size(); ++v) both[2 * v] = both[2 * v + 1] = fixed[v];
  const ConstrainedSystem system = constrain(real_form(energy, area_form(fixed.size(), loop)), both);
  MemoryFactorStore store;
  const auto solver =
      fitting_factor(system.matrix, memory > 0 ? memory - n * kFactorSystemBytes : 0, store, report);
  if (!solver) return false;
  report.unknowns = system.free_vertices.size();
  factor_and_solve(*solver, system, values, 1, report);
  return true;
}

void solve_by_multigrid(const TriangleSpan& mesh, SparseMatrix&& energy, const Loop& loop,
                        const std::vector<std::uint8_t>& fixed, std::span<double> values,
                        ParameterizeReport& report) {
  ComplexSystem system = complex_system(std::move(energy), loop, fixed, values);
  report.unknowns = 2 * system.laplacian.free_vertices.size();
  std::vector<Double3> at = positions_of(mesh, system.laplacian);
  HermitianMultigrid solver(system.laplacian.matrix, system.area.matrix, at);
  at = {};
  report.factor = solver.report();
  require_solved(report.factor.status, report.factor.message);
  std::vector<double> z(system.b.size());
  report.solve = solver.solve(system.b, z, kMultigridTolerance, kMaxCycles);
  require_solved(report.solve.status, report.solve.message);
  system.laplacian.scatter(z, values, 2);
}

void least_squares_conformal(const TriangleSpan& mesh, const Loop& loop, const ParameterizeOptions& options,
                             Parameterization& out) {
  const auto [a, b] = far_pair(mesh, loop);
  if (a == b) throw InputError("the border of the mesh has no extent; repair the mesh first");
  std::vector<std::uint8_t> fixed = unused_vertices(mesh);
  const std::vector<std::uint8_t> unused = fixed;
  fixed[a] = fixed[b] = 1;
  out.uv[b] = {1.0, 0.0};
  const std::span<double> values(out.uv.front().data(), 2 * out.uv.size());
  Laplacian lap = sound_laplacian(mesh, false);
  out.report.negative_weights = lap.report.negative_weights;
  SparseMatrix energy = std::move(lap.stiffness);
  lap = {};
  for (double& v : energy.value) v = -v;
  if (!solve_by_factor(energy, loop, fixed, options.memory_bytes, values, out.report)) {
    const std::string why = out.report.choice;
    solve_by_multigrid(mesh, std::move(energy), loop, fixed, values, out.report);
    out.report.choice = std::to_string(out.report.unknowns) + " unknowns: " + why + ", so multigrid";
  }
  fit_unit_square(mesh, out.uv);
  for (std::size_t v = 0; v < unused.size(); ++v)
    if (unused[v] != 0) out.uv[v] = {0, 0};
}

}  // namespace

std::uint64_t parameterize_bytes(std::uint64_t vertices, ParameterMethod method) {
  return vertices * (method == ParameterMethod::kConformal ? kConformalSystemBytes + kMultigridBytes
                                                           : kComplexBytes) +
         kMinBytes;
}

Parameterization parameterize(const TriangleSpan& mesh, const ParameterizeOptions& options) {
  const std::uint64_t minimum = parameterize_bytes(mesh.positions.size(), options.method);
  if (options.memory_bytes > 0 && options.memory_bytes < minimum)
    throw ResourceError("a map of " + std::to_string(mesh.positions.size()) + " vertices needs " +
                        mebibytes(minimum) + " beside the mesh, allowed are " +
                        mebibytes(options.memory_bytes) + ": allow more memory, or decimate the mesh");
  const SurfaceTopology topology = surface_topology(mesh);
  if (!topology.is_disk())
    throw InputError(
        "the mesh is not a disk (" + topology.describe() +
        "); a disk has Euler characteristic 1, one border and one piece: cut it open, or fill its holes");
  Parameterization out;
  out.uv.assign(mesh.positions.size(), {0, 0});
  const Loop& loop = topology.loops.front();
  if (options.method == ParameterMethod::kConformal) {
    conformal(mesh, loop, options, out);
  } else {
    least_squares_conformal(mesh, loop, options, out);
  }
  out.report.distortion = measure_distortion(mesh, out.uv);
  return out;
}

ParameterDistortion measure_distortion(const TriangleSpan& mesh, const std::vector<Double2>& uv) {
  ParameterDistortion out;
  double area_sum = 0.0, plane_sum = 0.0, ratio_sum = 0.0, angle_sum = 0.0, largest_scale = 0.0;
  std::size_t angles = 0;
  for (const auto& face : mesh.faces) {
    std::array<Double3, 3> p{}, q{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& at = mesh.positions[face[k]];
      p[k] = {at[0], at[1], at[2]};
      q[k] = {uv[face[k]][0], uv[face[k]][1], 0.0};
    }
    const Double3 e = p[1] - p[0], f = p[2] - p[0];
    const double area = norm(cross(e, f));
    if (!(area > 0.0)) continue;
    const double plane = cross(q[1] - q[0], q[2] - q[0])[2];
    area_sum += area;
    plane_sum += std::fabs(plane);
    largest_scale = std::max(largest_scale, std::fabs(plane) / area);
    out.flipped += plane < 0.0;
    out.collapsed += plane == 0.0;
    if (plane == 0.0) continue;
    // Singular values of the map from the face, in an orthonormal frame, to the plane.
    const double x1 = norm(e), x2 = dot(e, f) / x1, y2 = area / x1;
    const Double3 du = (q[1] - q[0]) * (1.0 / x1), dv = ((q[2] - q[0]) - du * x2) * (1.0 / y2);
    const double trace = dot(du, du) + dot(dv, dv), det = std::fabs(du[0] * dv[1] - du[1] * dv[0]);
    const double root = std::sqrt(std::max(0.0, trace * trace - 4.0 * det * det));
    ratio_sum += area * (trace + root) / (2.0 * det);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto angle = [&](const std::array<Double3, 3>& t) {
        return angle_between(unit(t[(k + 1) % 3] - t[k]), unit(t[(k + 2) % 3] - t[k]));
      };
      const double change = std::fabs(angle(p) - angle(q)) * (180.0 / kPi);
      angle_sum += change;
      ++angles;
      out.largest_angle_deg = std::max(out.largest_angle_deg, change);
    }
  }
  if (area_sum > 0.0) {
    out.mean_quasi_conformal = ratio_sum / area_sum;
    out.largest_area_ratio = plane_sum > 0.0 ? largest_scale / (plane_sum / area_sum) : 0.0;
  }
  if (angles > 0) out.mean_angle_deg = angle_sum / static_cast<double>(angles);
  return out;
}

}  // namespace tessera
