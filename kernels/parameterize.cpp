#include "kernels/parameterize.h"

#include <algorithm>
#include <cmath>

#include "kernels/disk_topology.h"
#include "kernels/portable_math.h"
#include "octree/error.h"
#include "solvers/laplacian_system.h"

namespace tessera {
namespace {

using Loop = std::vector<std::uint32_t>;

double distance(const TriangleSpan& mesh, std::uint32_t a, std::uint32_t b) {
  const auto &p = mesh.positions[a], &q = mesh.positions[b];
  const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
  return std::sqrt(x * x + y * y + z * z);
}

/// Share of the border's length up to each of its vertices, in [0, 1).
std::vector<double> arc_shares(const TriangleSpan& mesh, const Loop& loop) {
  std::vector<double> share(loop.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    share[i] = sum;
    sum += distance(mesh, loop[i], loop[(i + 1) % loop.size()]);
  }
  if (!(sum > 0.0)) throw InputError("the border of the mesh has no length; repair the mesh first");
  for (double& s : share) s /= sum;
  return share;
}

Double2 on_circle(double share) {
  const synth::SinCos at = synth::sin_cos(2.0 * synth::kPi * share);
  return {0.5 + 0.5 * at.cos, 0.5 + 0.5 * at.sin};
}

/// Border vertices on the unit square. The four vertices nearest to a quarter of the length become its
/// corners, so that no face is cut off by a corner between two vertices.
void place_on_square(const Loop& loop, const std::vector<double>& share, std::vector<Double2>& uv) {
  const std::size_t n = loop.size();
  if (n < 4) throw InputError("a border of three vertices has no square; choose --border circle");
  std::array<std::size_t, 5> corner{};
  for (std::size_t c = 1; c < 4; ++c) {
    std::size_t best = corner[c - 1] + 1;
    for (std::size_t i = best; i < n - (3 - c); ++i)
      if (std::fabs(share[i] - 0.25 * double(c)) < std::fabs(share[best] - 0.25 * double(c))) best = i;
    corner[c] = best;
  }
  corner[4] = n;
  constexpr std::array<Double2, 5> at = {{{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}}};
  for (std::size_t side = 0; side < 4; ++side) {
    const double low = share[corner[side]], high = side == 3 ? 1.0 : share[corner[side + 1]];
    for (std::size_t i = corner[side]; i < corner[side + 1]; ++i) {
      const double t = high > low ? (share[i] - low) / (high - low) : 0.0;
      for (std::size_t k = 0; k < 2; ++k) uv[loop[i]][k] = at[side][k] + t * (at[side + 1][k] - at[side][k]);
    }
  }
}

Laplacian sound_laplacian(const TriangleSpan& mesh, bool clamped) {
  Laplacian lap = laplacian(
      mesh, {.weights = clamped ? LaplacianWeights::kClampedCotangent : LaplacianWeights::kCotangent});
  if (lap.report.degenerate_faces > 0)
    throw InputError("face " + std::to_string(lap.report.first_degenerate) + " and " +
                     std::to_string(lap.report.degenerate_faces - 1) +
                     " more have no area, so they have no angles to keep; remesh or repair the mesh first");
  return lap;
}

/// \param positions, neighbours  of the unknowns: what multigrid reads if the factor does not fit
void solve(const ConstrainedSystem& system, const ParameterizeOptions& options,
           const std::vector<std::array<double, 3>>& positions, const SparseMatrix& neighbours,
           std::span<double> values, int width, ParameterizeReport& report) {
  SolverOptions how;
  how.memory_bytes = options.memory_bytes;
  how.prefer_direct = true;
  how.right_hand_sides = static_cast<std::size_t>(width);
  how.tolerance = 1e-10;
  how.positions = positions;
  how.neighbours = &neighbours;
  const auto solver = make_solver(SolverKind::kAutomatic, how);
  report.unknowns = system.free_vertices.size();
  report.factor = solver->analyse(system.matrix);
  report.choice = report.factor.choice;
  if (report.factor.status == SolveStatus::kSolved) report.factor = solver->factor(system.matrix);
  if (report.factor.status == SolveStatus::kTooLarge) throw ResourceError(report.factor.message);
  if (report.factor.status != SolveStatus::kSolved)
    throw InputError("the mesh has no parameterization: " + report.factor.message);
  const std::vector<double> b = system.right_hand_side(values, width);
  std::vector<double> x(b.size());
  report.solve = solver->solve(b, x, width);
  if (report.solve.status == SolveStatus::kNotConverged)
    throw ResourceError("a factor does not fit the memory, and " + report.solve.message +
                        " instead: give a larger --memory");
  if (report.solve.status != SolveStatus::kSolved)
    throw InputError("the mesh has no parameterization: " + report.solve.message);
  system.scatter(x, values, width);
}

/// Unused vertices have empty rows: they are held, or the matrix would be singular.
std::vector<std::uint8_t> unused_vertices(const TriangleSpan& mesh) {
  std::vector<std::uint8_t> unused(mesh.positions.size(), 1);
  for (const auto& face : mesh.faces)
    for (const std::uint32_t v : face) unused[v] = 0;
  return unused;
}

void conformal(const TriangleSpan& mesh, const Loop& loop, const ParameterizeOptions& options,
               Parameterization& out) {
  const std::vector<double> share = arc_shares(mesh, loop);
  if (options.border == ParameterBorder::kSquare) {
    place_on_square(loop, share, out.uv);
  } else {
    for (std::size_t i = 0; i < loop.size(); ++i) out.uv[loop[i]] = on_circle(share[i]);
  }
  const Laplacian lap = sound_laplacian(mesh, options.clamp_weights);
  out.report.negative_weights = lap.report.negative_weights;
  std::vector<std::uint8_t> fixed = unused_vertices(mesh);
  for (const std::uint32_t v : loop) fixed[v] = 1;
  if (std::count(fixed.begin(), fixed.end(), 0) == 0) return;  // every vertex lies on the border
  const ConstrainedSystem system = laplacian_system(lap, 1, fixed);
  std::vector<std::array<double, 3>> at;
  for (const std::int32_t v : system.free_vertices) at.push_back(mesh.positions[static_cast<std::size_t>(v)]);
  solve(system, options, at, mesh_neighbours(lap, system), {out.uv.front().data(), 2 * out.uv.size()}, 2,
        out.report);
}

/// Dirichlet energy of u and v minus the area they enclose, unknowns u_0, v_0, u_1, v_1, ... The area is a
/// sum over the border alone: 1/2 sum (u_i v_j - u_j v_i).
SparseMatrix conformal_energy(const SparseMatrix& stiffness, const Loop& loop) {
  const std::size_t n = static_cast<std::size_t>(stiffness.rows);
  constexpr std::int32_t kNone = -1;
  std::vector<std::array<std::int32_t, 2>> around(n, {kNone, kNone});  // before and after on the border
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const std::uint32_t a = loop[i], b = loop[(i + 1) % loop.size()];
    around[a][1] = static_cast<std::int32_t>(b);
    around[b][0] = static_cast<std::int32_t>(a);
  }
  SparseMatrix m;
  m.rows = m.columns = 2 * stiffness.rows;
  m.start.reserve(2 * n + 1);
  m.column.reserve(2 * stiffness.entries() + 4 * loop.size());
  m.value.reserve(m.column.capacity());
  m.start.push_back(0);
  std::vector<std::pair<std::int32_t, double>> row;
  for (std::size_t i = 0; i < n; ++i)
    for (const int component : {0, 1}) {
      row.clear();
      for (std::int32_t e = stiffness.start[i]; e < stiffness.start[i + 1]; ++e)
        row.emplace_back(2 * stiffness.column[e] + component, -stiffness.value[e]);
      const double sign = component == 0 ? 0.5 : -0.5;
      if (around[i][0] != kNone) row.emplace_back(2 * around[i][0] + 1 - component, sign);
      if (around[i][1] != kNone) row.emplace_back(2 * around[i][1] + 1 - component, -sign);
      std::sort(row.begin(), row.end());
      for (const auto& [column, value] : row) {
        m.column.push_back(column);
        m.value.push_back(value);
      }
      m.start.push_back(static_cast<std::int32_t>(m.column.size()));
    }
  return m;
}

/// Two border vertices far apart: pins at the ends of the border's longest extent distort least.
std::array<std::uint32_t, 2> far_pair(const TriangleSpan& mesh, const Loop& loop) {
  const auto farthest = [&](std::uint32_t from) {
    return *std::max_element(loop.begin(), loop.end(), [&](std::uint32_t a, std::uint32_t b) {
      return distance(mesh, from, a) < distance(mesh, from, b);
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

void least_squares_conformal(const TriangleSpan& mesh, const Loop& loop, const ParameterizeOptions& options,
                             Parameterization& out) {
  const Laplacian lap = sound_laplacian(mesh, false);
  out.report.negative_weights = lap.report.negative_weights;
  const SparseMatrix energy = conformal_energy(lap.stiffness, loop);
  const auto [a, b] = far_pair(mesh, loop);
  if (a == b) throw InputError("the border of the mesh has no extent; repair the mesh first");
  out.uv[b] = {1.0, 0.0};
  const std::vector<std::uint8_t> unused = unused_vertices(mesh);
  std::vector<std::uint8_t> fixed(2 * unused.size());
  for (std::size_t v = 0; v < unused.size(); ++v)
    fixed[2 * v] = fixed[2 * v + 1] = unused[v] != 0 || v == a || v == b;
  const ConstrainedSystem system = constrain(energy, fixed);
  std::vector<std::array<double, 3>> at;
  for (const std::int32_t i : system.free_vertices)
    at.push_back(mesh.positions[static_cast<std::size_t>(i / 2)]);
  solve(system, options, at, system.matrix, {out.uv.front().data(), 2 * out.uv.size()}, 1, out.report);
  for (std::size_t v = 0; v < unused.size(); ++v)
    if (unused[v] != 0) out.uv[v] = {0, 0};
  fit_unit_square(mesh, out.uv);
}

}  // namespace

Parameterization parameterize(const TriangleSpan& mesh, const ParameterizeOptions& options) {
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
  using synth::Vec3;
  ParameterDistortion out;
  double area_sum = 0.0, plane_sum = 0.0, ratio_sum = 0.0, angle_sum = 0.0, largest_scale = 0.0;
  std::size_t angles = 0;
  for (const auto& face : mesh.faces) {
    std::array<Vec3, 3> p, q;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& at = mesh.positions[face[k]];
      p[k] = {at[0], at[1], at[2]};
      q[k] = {uv[face[k]][0], uv[face[k]][1], 0.0};
    }
    const Vec3 e = p[1] - p[0], f = p[2] - p[0];
    const double area = length(cross(e, f));
    if (!(area > 0.0)) continue;
    const double plane = cross(q[1] - q[0], q[2] - q[0]).z;
    area_sum += area;
    plane_sum += std::fabs(plane);
    largest_scale = std::max(largest_scale, std::fabs(plane) / area);
    out.flipped += plane < 0.0;
    out.collapsed += plane == 0.0;
    if (plane == 0.0) continue;
    // Singular values of the map from the face, in an orthonormal frame, to the plane.
    const double x1 = length(e), x2 = dot(e, f) / x1, y2 = area / x1;
    const Vec3 du = (q[1] - q[0]) * (1.0 / x1), dv = ((q[2] - q[0]) - du * x2) * (1.0 / y2);
    const double trace = dot(du, du) + dot(dv, dv), det = std::fabs(du.x * dv.y - du.y * dv.x);
    const double root = std::sqrt(std::max(0.0, trace * trace - 4.0 * det * det));
    ratio_sum += area * (trace + root) / (2.0 * det);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto angle = [&](const std::array<Vec3, 3>& t) {
        return angle_between(normalized(t[(k + 1) % 3] - t[k]), normalized(t[(k + 2) % 3] - t[k]));
      };
      const double change = std::fabs(angle(p) - angle(q)) * (180.0 / synth::kPi);
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
