#include "kernels/edit/edit_basis.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "kernels/mesh/closest_face.h"
#include "octree/error.h"
#include "octree/small_matrix.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

using Faces = std::span<const std::array<std::uint32_t, 3>>;
using Matrix4 = SmallMatrix<4>;
using Turn = std::array<double, 9>;

constexpr int kSpreadRounds = 6;  ///< rings that a turn is measured over, beyond its own
constexpr Turn kNoTurn = {1, 0, 0, 0, 1, 0, 0, 0, 1};

std::string place(const Double3& p) {
  char text[100];
  std::snprintf(text, sizeof text, "(%.6g, %.6g, %.6g)", p[0], p[1], p[2]);
  return text;
}

/// Pieces of the support that touch no vertex that is given: nothing holds them.
struct Loose {
  std::vector<std::vector<std::uint32_t>> pieces;  ///< by their lowest vertex; ascending
  std::size_t vertices = 0;
};

Loose find_loose(const Laplacian& metric, const EditRegions& regions) {
  const std::size_t n = regions.role.size();
  UnionFind pieces(n);
  std::vector<std::uint8_t> held(n, 0);
  const SparseMatrix& l = metric.stiffness;
  const auto joined = [&](auto&& use) {
    for (std::int32_t v = 0; v < l.rows; ++v) {
      if (regions.role[static_cast<std::size_t>(v)] != kSupportVertex) continue;
      for (std::int32_t e = l.start[v]; e < l.start[v + 1]; ++e)
        if (l.value[static_cast<std::size_t>(e)] != 0.0) use(v, l.column[static_cast<std::size_t>(e)]);
    }
  };
  joined([&](std::int32_t v, std::int32_t w) {
    if (regions.role[static_cast<std::size_t>(w)] == kSupportVertex)
      pieces.unite(static_cast<std::uint32_t>(v), static_cast<std::uint32_t>(w));
  });
  joined([&](std::int32_t v, std::int32_t w) {
    if (regions.role[static_cast<std::size_t>(w)] != kSupportVertex)
      held[pieces.find(static_cast<std::uint32_t>(v))] = 1;
  });
  Loose out;
  std::vector<std::size_t> number(n, 0);  // from 1
  for (std::uint32_t v = 0; v < n; ++v) {
    if (regions.role[v] != kSupportVertex || held[pieces.find(v)]) continue;
    std::size_t& at = number[pieces.find(v)];
    if (at == 0) {
      out.pieces.emplace_back();
      at = out.pieces.size();
    }
    out.pieces[at - 1].push_back(v);
    ++out.vertices;
  }
  return out;
}

[[noreturn]] void refuse(const Loose& loose, std::span<const Double3> position) {
  const std::size_t count = loose.pieces.size();
  throw InputError("the support lacks constraints: " + std::to_string(count) +
                   (count == 1 ? " piece" : " pieces") + " of it, " + std::to_string(loose.vertices) +
                   (loose.vertices == 1 ? " vertex" : " vertices") + ", the first near " +
                   place(position[loose.pieces[0][0]]) + ", " + (count == 1 ? "touches" : "touch") +
                   " neither a fixed vertex nor a handle; fix a part of it or leave it out of the support");
}

/// The held vertex nearest to each piece, of several the one met first.
std::vector<std::uint32_t> nearest_held(const Loose& loose, std::span<const Double3> position,
                                        std::span<const std::uint8_t> held) {
  std::vector<std::array<std::uint32_t, 3>> points;
  for (std::uint32_t v = 0; v < held.size(); ++v)
    if (held[v]) points.push_back({v, v, v});
  const ClosestFaces closest(position, points, position[points[0][0]]);
  std::vector<std::uint32_t> out;
  for (const auto& piece : loose.pieces) {
    ClosestFaces::Hit best{std::numeric_limits<double>::infinity(), ClosestFaces::kNone};
    for (const std::uint32_t v : piece)
      if (const auto hit = closest.closest(position[v] - closest.origin(), best.square, ClosestFaces::kNone);
          hit.slot != ClosestFaces::kNone)
        best = hit;
    out.push_back(points[closest.face(best.slot)][0]);
  }
  return out;
}

/// Rows of the columns for a piece that moves with the vertex `near`: the mean of the handles' maps by its weights, moved to
/// where it goes.
void follow(const EditBasis& basis, std::span<const Double3> position, std::span<const std::uint32_t> piece,
            std::uint32_t near, std::span<double> values) {
  const std::size_t w = basis.width(), first = basis.first_handle();
  const std::vector<double> at(values.begin() + static_cast<std::ptrdiff_t>(near * w),
                               values.begin() + static_cast<std::ptrdiff_t>((near + 1) * w));
  double fixed = 1.0;
  for (std::size_t h = 0; h < basis.centre.size(); ++h) fixed -= at[first + 4 * h + 3];
  const auto mean = [&](const Double3& p, std::span<double> row) {
    for (std::size_t k = 0; k < first; ++k) row[k] = fixed * p[k % 3];
    for (std::size_t h = 0; h < basis.centre.size(); ++h) {
      const double share = at[first + 4 * h + 3];
      for (std::size_t c = 0; c < 3; ++c)
        row[first + 4 * h + c] = share * (p[c] - basis.centre[h][c]) / basis.reach[h];
      row[first + 4 * h + 3] = share;
    }
  };
  std::vector<double> there(w);
  mean(position[near], there);
  for (const std::uint32_t v : piece) {
    const std::span<double> row = values.subspan(v * w, w);
    mean(position[v], row);
    for (std::size_t k = 0; k < w; ++k) row[k] += at[k] - there[k];
  }
}

}  // namespace

EditBasis edit_basis(std::span<const Double3> position, const Laplacian& metric, const EditRegions& regions,
                     const BoundaryModelOptions& options, EditBasisReport& report) {
  const std::size_t n = position.size(), handles = regions.handles.size();
  EditBasis basis;
  basis.role = regions.role;
  basis.target = regions.target;
  basis.centre.assign(handles, Double3{});
  basis.reach.assign(handles, 0.0);
  std::vector<std::uint8_t> free(n);
  std::vector<std::size_t> members(handles, 0);
  std::vector<Double3> low(handles, {1e300, 1e300, 1e300}), high(handles, {-1e300, -1e300, -1e300});
  for (std::size_t v = 0; v < n; ++v) {
    free[v] = regions.role[v] == kSupportVertex;
    if (regions.role[v] < 0) continue;
    const auto h = static_cast<std::size_t>(regions.role[v]);
    ++members[h];
    for (std::size_t c = 0; c < 3; ++c) {
      low[h][c] = std::min(low[h][c], position[v][c]);
      high[h][c] = std::max(high[h][c], position[v][c]);
    }
  }
  for (std::size_t h = 0; h < handles; ++h) {
    if (members[h] == 0)
      throw InputError("the handle '" + regions.handles[h] +
                       "' has no vertex: no vertex lies in its region, or later regions took them");
    basis.centre[h] = (low[h] + high[h]) * 0.5;
    basis.reach[h] = std::max(0.5 * norm(high[h] - low[h]), 1e-300);
    if (members[h] == 1) basis.reach[h] = 1.0;
  }
  if (std::count(free.begin(), free.end(), 1) == 0)
    throw InputError("the support has no vertex: no vertex lies in it, or later regions took them all");
  const Loose loose = find_loose(metric, regions);
  report.loose_pieces = loose.pieces.size();
  report.loose_vertices = loose.vertices;
  if (!loose.pieces.empty() && regions.loose == LoosePieces::kRefuse) refuse(loose, position);
  for (const auto& piece : loose.pieces)
    for (const std::uint32_t v : piece) {
      free[v] = 0;
      if (regions.loose == LoosePieces::kFix) basis.role[v] = kFixedVertex;
    }
  if (std::count(free.begin(), free.end(), 1) == 0) refuse(loose, position);

  BoundaryModel model(metric, free, regions.smoothness, options);
  const std::size_t w = basis.width(), first = basis.first_handle();
  std::vector<double> values(n * w, 0.0);
  for (std::size_t v = 0; v < n; ++v) {
    const std::int32_t role = basis.role[v];
    if (role == kFixedVertex || role == kTargetVertex) {
      const Double3& goes = role == kTargetVertex ? basis.target[v] : position[v];
      for (std::size_t c = 0; c < 3; ++c) {
        values[v * w + c] = position[v][c];
        if (!basis.target.empty()) values[v * w + 3 + c] = goes[c];
      }
    }
    if (role < 0) continue;
    const auto h = static_cast<std::size_t>(role);
    for (std::size_t c = 0; c < 3; ++c)
      values[v * w + first + 4 * h + c] = (position[v][c] - basis.centre[h][c]) / basis.reach[h];
    values[v * w + first + 4 * h + 3] = 1.0;
  }
  model.solve(values, static_cast<int>(w));
  basis.active = model.free_vertices();
  if (!loose.pieces.empty() && regions.loose == LoosePieces::kFollow) {
    std::vector<std::uint8_t> held(n, 1);
    for (const auto& piece : loose.pieces)
      for (const std::uint32_t v : piece) held[v] = 0;
    const std::vector<std::uint32_t> near = nearest_held(loose, position, held);
    for (std::size_t k = 0; k < near.size(); ++k) {
      follow(basis, position, loose.pieces[k], near[k], values);
      basis.active.insert(basis.active.end(), loose.pieces[k].begin(), loose.pieces[k].end());
    }
    std::sort(basis.active.begin(), basis.active.end());
  }
  basis.columns.reserve(basis.active.size() * w);
  for (const std::int32_t v : basis.active) {
    const auto row = values.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(v) * w);
    basis.columns.insert(basis.columns.end(), row, row + static_cast<std::ptrdiff_t>(w));
  }
  report.model = model.report();
  const std::vector<Double3> rest = rest_base(basis, position);
  report.energy = model.energy({rest.front().data(), 3 * n}, 3);
  return basis;
}

namespace {

std::vector<Double3> solution(const EditBasis& basis, std::span<const Double3> position,
                              std::span<const Placement> pose, bool rests) {
  const std::size_t w = basis.width(), first = basis.first_handle(), handles = basis.centre.size();
  std::vector<Double3> out(position.begin(), position.end());
  for (std::size_t v = 0; v < out.size(); ++v) {
    const std::int32_t role = basis.role[v];
    if (role >= 0) out[v] = pose[static_cast<std::size_t>(role)].apply(position[v]);
    if (role == kTargetVertex && !rests) out[v] = basis.target[v];
  }
  std::vector<std::array<Double3, 4>> frame(handles);  // axes and origin, moved
  for (std::size_t h = 0; h < handles; ++h) {
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t c = 0; c < 3; ++c) frame[h][a][c] = basis.reach[h] * pose[h].matrix[3 * c + a];
    frame[h][3] = pose[h].apply(basis.centre[h]);
  }
  const std::size_t held = rests ? 0 : first - 3;
  for (std::size_t k = 0; k < basis.active.size(); ++k) {
    const double* row = basis.columns.data() + k * w;
    Double3 p = {row[held], row[held + 1], row[held + 2]};
    for (std::size_t h = 0; h < handles; ++h)
      for (std::size_t a = 0; a < 4; ++a) p = p + frame[h][a] * row[first + 4 * h + a];
    out[static_cast<std::size_t>(basis.active[k])] = p;
  }
  return out;
}

}  // namespace

std::vector<Double3> rest_base(const EditBasis& basis, std::span<const Double3> position) {
  const std::vector<Placement> still(basis.centre.size());
  return solution(basis, position, still, true);
}

std::vector<Double3> smooth_base(const EditBasis& basis, std::span<const Double3> position,
                                 std::span<const Placement> pose) {
  return solution(basis, position, pose, false);
}

namespace {

constexpr int kPolarSteps = 10;
constexpr double kTurned = 1e-14;  ///< of a rotation: a step less than that was the last
constexpr double kWellTurned =
    1e-3;  ///< of the cube of its size: determinants from which Newton's steps are safe

/// The same where s is far from turning over: its polar factor by Newton's steps R <- (R + R^-T) / 2 (Higham 1986), a tenth of
/// the work. \return false: it is not, or does not settle
bool polar_turn(const std::array<double, 9>& s, double size, Turn& out) {
  for (std::size_t k = 0; k < 9; ++k) out[k] = s[k] / size;
  for (int step = 0; step < kPolarSteps; ++step) {
    const Turn& r = out;
    const Turn cofactor = {r[4] * r[8] - r[5] * r[7], r[5] * r[6] - r[3] * r[8], r[3] * r[7] - r[4] * r[6],
                           r[2] * r[7] - r[1] * r[8], r[0] * r[8] - r[2] * r[6], r[1] * r[6] - r[0] * r[7],
                           r[1] * r[5] - r[2] * r[4], r[2] * r[3] - r[0] * r[5], r[0] * r[4] - r[1] * r[3]};
    const double determinant = r[0] * cofactor[0] + r[1] * cofactor[1] + r[2] * cofactor[2];
    if (!(determinant > kWellTurned)) return false;
    double change = 0.0;
    for (std::size_t k = 0; k < 9; ++k) {
      const double next = 0.5 * (out[k] + cofactor[k] / determinant);
      change = std::max(change, std::fabs(next - out[k]));
      out[k] = next;
    }
    if (change < kTurned) return true;
  }
  return false;
}

/// The rotation nearest to s, of largest trace(R' s): quaternion of the largest eigenvalue (Horn 1987).
Turn best_turn(const std::array<double, 9>& s) {
  double size = 0.0;
  for (const double x : s) size = std::max(size, std::fabs(x));
  if (!(size > 0.0)) return kNoTurn;
  if (Turn polar{}; polar_turn(s, size, polar)) return polar;
  const auto at = [&](int to, int from) { return s[static_cast<std::size_t>(3 * to + from)] / size; };
  Matrix4 a;
  a << at(0, 0) + at(1, 1) + at(2, 2), at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1),
      at(2, 1) - at(1, 2), at(0, 0) - at(1, 1) - at(2, 2), at(0, 1) + at(1, 0), at(0, 2) + at(2, 0),
      at(0, 2) - at(2, 0), at(0, 1) + at(1, 0), at(1, 1) - at(0, 0) - at(2, 2), at(1, 2) + at(2, 1),
      at(1, 0) - at(0, 1), at(0, 2) + at(2, 0), at(1, 2) + at(2, 1), at(2, 2) - at(0, 0) - at(1, 1);
  Matrix4 vector = Matrix4::Identity();
  for (int sweep = 0; sweep < 12; ++sweep) {
    double off = 0.0;
    for (Eigen::Index p = 0; p < 4; ++p)
      for (Eigen::Index q = p + 1; q < 4; ++q) off += a.coeff(p, q) * a.coeff(p, q);
    if (!(off > 1e-30)) break;
    for (Eigen::Index p = 0; p < 3; ++p)
      for (Eigen::Index q = p + 1; q < 4; ++q) {
        if (a.coeff(p, q) == 0.0) continue;
        const double theta = (a.coeff(q, q) - a.coeff(p, p)) / (2.0 * a.coeff(p, q));
        const double t = (theta < 0.0 ? -1.0 : 1.0) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
        const double c = 1.0 / std::sqrt(t * t + 1.0), sn = t * c;
        const auto turn = [c, sn](double& x, double& y) {
          const double u = x, v = y;
          x = c * u - sn * v;
          y = sn * u + c * v;
        };
        for (Eigen::Index k = 0; k < 4; ++k) turn(a.coeffRef(k, p), a.coeffRef(k, q));
        for (Eigen::Index k = 0; k < 4; ++k) turn(a.coeffRef(p, k), a.coeffRef(q, k));
        for (Eigen::Index k = 0; k < 4; ++k) turn(vector.coeffRef(k, p), vector.coeffRef(k, q));
      }
  }
  Eigen::Index best = 0;
  for (Eigen::Index k = 1; k < 4; ++k)
    if (a.coeff(k, k) > a.coeff(best, best)) best = k;
  const double w = vector.coeff(0, best), x = vector.coeff(1, best), y = vector.coeff(2, best),
               z = vector.coeff(3, best);
  const double u = 2.0 / (w * w + x * x + y * y + z * z);
  return {1 - u * (y * y + z * z), u * (x * y - w * z),     u * (x * z + w * y),
          u * (x * y + w * z),     1 - u * (x * x + z * z), u * (y * z - w * x),
          u * (x * z - w * y),     u * (y * z + w * x),     1 - u * (x * x + y * y)};
}

Double3 turned(const Turn& r, const Double3& p) {
  return {r[0] * p[0] + r[1] * p[1] + r[2] * p[2], r[3] * p[0] + r[4] * p[1] + r[5] * p[2],
          r[6] * p[0] + r[7] * p[1] + r[8] * p[2]};
}

}  // namespace

std::vector<Turn> turns(std::span<const Double3> from, std::span<const Double3> to, Faces faces) {
  // Per face A (F - I): the gradient of the displacement d, sum of d_k (n x e_k) / 2 with e_k opposite to corner k, and
  // the turn of the normal. Nothing is divided by, so that slivers weigh what they are.
  std::vector<Turn> sum(from.size(), Turn{}), next;
  std::vector<double> area(from.size(), 0.0), wider;
  for (const auto& f : faces) {
    const Double3 n = triangle_normal(from[f[0]], from[f[1]], from[f[2]]);
    const double a = 0.5 * norm(n);
    const Double3 before = unit_or_zero(n),
                  after = unit_or_zero(triangle_normal(to[f[0]], to[f[1]], to[f[2]]));
    Turn s{};
    const auto add = [&](const Double3& left, const Double3& right) {
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) s[3 * r + c] += left[r] * right[c];
    };
    const Double3 d0 = to[f[0]] - from[f[0]];
    for (std::size_t k = 1; k < 3; ++k) {
      const Double3 opposite = from[f[(k + 2) % 3]] - from[f[(k + 1) % 3]];
      add((to[f[k]] - from[f[k]] - d0) * 0.5, cross(before, opposite));
    }
    add((after - before) * a, before);
    for (const std::uint32_t v : f) {
      for (std::size_t k = 0; k < 9; ++k) sum[v][k] += s[k];
      area[v] += a;
    }
  }
  for (int round = 0; round < kSpreadRounds; ++round) {
    next.assign(sum.size(), Turn{});
    wider.assign(sum.size(), 0.0);
    for (const auto& f : faces) {
      const double all = area[f[0]] + area[f[1]] + area[f[2]];
      if (!(all > 0.0)) continue;
      Turn s;
      for (std::size_t k = 0; k < 9; ++k) s[k] = sum[f[0]][k] + sum[f[1]][k] + sum[f[2]][k];
      for (const std::uint32_t v : f) {
        for (std::size_t k = 0; k < 9; ++k) next[v][k] += s[k];
        wider[v] += all;
      }
    }
    sum.swap(next);
    area.swap(wider);
  }
  for (std::size_t v = 0; v < sum.size(); ++v) {
    Turn& s = sum[v];
    if (s == Turn{} || !(area[v] > 0.0)) {
      s = kNoTurn;
      continue;
    }
    for (std::size_t k = 0; k < 9; ++k) s[k] = s[k] / area[v] + kNoTurn[k];
    s = best_turn(s);
  }
  return sum;
}

std::vector<Double3> posed_base(const EditBasis& basis, std::span<const Double3> position,
                                std::span<const Turn> turn, std::span<const Double3> rest,
                                std::span<const Double3> posed) {
  std::vector<Double3> out(posed.begin(), posed.end());
  for (const std::int32_t k : basis.active) {
    const auto v = static_cast<std::size_t>(k);
    if (posed[v] == rest[v] && turn[v] == kNoTurn) {
      out[v] = position[v];
      continue;
    }
    out[v] = posed[v] + turned(turn[v], position[v] - rest[v]);
  }
  return out;
}

}  // namespace tessera
