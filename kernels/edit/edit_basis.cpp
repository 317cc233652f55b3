#include "kernels/edit/edit_basis.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "kernels/mesh/closest_face.h"
#include "octree/error.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

std::string position_text(const Double3& p) {
  char text[100];
  std::snprintf(text, sizeof text, "(%.6g, %.6g, %.6g)", p[0], p[1], p[2]);
  return text;
}

[[noreturn]] void refuse_near(const SingularSystem& e, const BoundaryModelOptions& options,
                              std::span<const Double3> position) {
  const std::string where =
      e.vertex < 0 ? "" : " near " + position_text(position[static_cast<std::size_t>(e.vertex)]);
  throw SingularSystem(
      "the support lacks constraints" + where + " for order " + std::to_string(options.order) +
          ": its system is singular, as it is where nothing holds a piece, or where faces are "
          "too thin for their cotangents; lower the order, fix a part of it there, or solve on an "
          "even base of fewer vertices",
      e.vertex);
}

/// Pieces of the support that touch no vertex that is given: nothing holds them.
struct Loose {
  std::vector<std::vector<std::uint32_t>> pieces;  ///< by their lowest vertex; ascending
  std::size_t vertices = 0;
};

Loose find_loose(const Laplacian& metric, const EditRegions& regions) {
  const std::size_t n = regions.role.size();
  UnionFind pieces(n);
  std::vector<std::uint8_t> pinned(n, 0);
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
      pinned[pieces.find(static_cast<std::uint32_t>(v))] = 1;
  });
  Loose out;
  std::vector<std::size_t> number(n, 0);  // from 1
  for (std::uint32_t v = 0; v < n; ++v) {
    if (regions.role[v] != kSupportVertex || pinned[pieces.find(v)]) continue;
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
                   position_text(position[loose.pieces[0][0]]) + ", " + (count == 1 ? "touches" : "touch") +
                   " neither a fixed vertex nor a handle; fix a part of it or leave it out of the support");
}

/// The held vertex nearest to each piece, of several the one met first.
std::vector<std::uint32_t> nearest_pinned(const Loose& loose, std::span<const Double3> position,
                                          std::span<const std::uint8_t> pinned) {
  std::vector<std::array<std::uint32_t, 3>> points;
  for (std::uint32_t v = 0; v < pinned.size(); ++v)
    if (pinned[v]) points.push_back({v, v, v});
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
        row[first + 4 * h + c] = share * (p[c] - basis.centre[h][c]) / basis.radius[h];
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

/// Roles, frames of the handles around their vertices, and what has targets. \throws InputError  a handle has no vertex
EditBasis framed_basis(std::span<const Double3> position, const EditRegions& regions) {
  const std::size_t handles = regions.handles.size();
  EditBasis basis;
  basis.role = regions.role;
  basis.target = regions.target;
  std::vector<std::size_t> members(handles, 0);
  std::vector<Double3> low(handles, {1e300, 1e300, 1e300}), high(handles, {-1e300, -1e300, -1e300});
  for (std::size_t v = 0; v < position.size(); ++v) {
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
    basis.centre.push_back((low[h] + high[h]) * 0.5);
    basis.radius.push_back(members[h] == 1 ? 1.0 : std::max(0.5 * norm(high[h] - low[h]), 1e-300));
  }
  return basis;
}

/// n x width(): rows of vertices that are given; zero for the support.
/// \param position  where targets are meant from \param fair  of all, as the smooth base has them
std::vector<double> given_values(const EditBasis& basis, std::span<const Double3> position,
                                 std::span<const Double3> fair) {
  const std::size_t w = basis.width(), first = basis.first_handle();
  std::vector<double> values(position.size() * w, 0.0);
  for (std::size_t v = 0; v < position.size(); ++v) {
    const std::int32_t role = basis.role[v];
    if (role == kFixedVertex || role == kTargetVertex) {
      Double3 goes = fair[v];
      if (role == kTargetVertex)
        goes = fair[v] == position[v] ? basis.target[v] : fair[v] + (basis.target[v] - position[v]);
      for (std::size_t c = 0; c < 3; ++c) {
        values[v * w + c] = fair[v][c];
        if (!basis.target.empty()) values[v * w + 3 + c] = goes[c];
      }
    }
    if (role < 0) continue;
    const auto h = static_cast<std::size_t>(role);
    for (std::size_t c = 0; c < 3; ++c)
      values[v * w + first + 4 * h + c] = (fair[v][c] - basis.centre[h][c]) / basis.radius[h];
    values[v * w + first + 4 * h + 3] = 1.0;
  }
  return values;
}

/// Every loose piece moves with what is nearest to it: its rows of `values`, its vertices among the active ones.
void follow_all(const Loose& loose, std::span<const Double3> position, EditBasis& basis,
                std::span<double> values) {
  if (loose.pieces.empty()) return;
  std::vector<std::uint8_t> pinned(position.size(), 1);
  for (const auto& piece : loose.pieces)
    for (const std::uint32_t v : piece) pinned[v] = 0;
  const std::vector<std::uint32_t> near = nearest_pinned(loose, position, pinned);
  for (std::size_t k = 0; k < near.size(); ++k) {
    follow(basis, position, loose.pieces[k], near[k], values);
    basis.active.insert(basis.active.end(), loose.pieces[k].begin(), loose.pieces[k].end());
  }
  std::sort(basis.active.begin(), basis.active.end());
}

/// The rows of some vertices, of `width` numbers each.
std::vector<double> rows_of(std::span<const std::int32_t> vertices, std::span<const double> values,
                            std::size_t width) {
  std::vector<double> rows;
  rows.reserve(vertices.size() * width);
  for (const std::int32_t v : vertices) {
    const auto row = values.subspan(static_cast<std::size_t>(v) * width, width);
    rows.insert(rows.end(), row.begin(), row.end());
  }
  return rows;
}

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
      for (std::size_t c = 0; c < 3; ++c) frame[h][a][c] = basis.radius[h] * pose[h].matrix[3 * c + a];
    frame[h][3] = pose[h].apply(basis.centre[h]);
  }
  const std::size_t pinned = rests ? 0 : first - 3;
  for (std::size_t k = 0; k < basis.active.size(); ++k) {
    const double* row = basis.columns.data() + k * w;
    Double3 p = {row[pinned], row[pinned + 1], row[pinned + 2]};
    for (std::size_t h = 0; h < handles; ++h)
      for (std::size_t a = 0; a < 4; ++a) p = p + frame[h][a] * row[first + 4 * h + a];
    out[static_cast<std::size_t>(basis.active[k])] = p;
  }
  return out;
}

}  // namespace

std::vector<std::uint8_t> support_flags(std::span<const std::int32_t> role) {
  std::vector<std::uint8_t> flags;
  for (const std::int32_t r : role) flags.push_back(r == kSupportVertex);
  return flags;
}

EditBasis edit_basis(const TriangleSpan& base, const Laplacian& metric, const EditRegions& regions,
                     const BoundaryModelOptions& options, EditBasisReport& report) {
  const std::span<const Double3> position = base.positions;
  EditBasis basis = framed_basis(position, regions);
  std::vector<std::uint8_t> free = support_flags(regions.role);
  const auto none_free = [&] { return std::find(free.begin(), free.end(), 1) == free.end(); };
  if (none_free())
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
  if (none_free()) refuse(loose, position);

  const std::unique_ptr<BoundaryModel> model = [&] {
    try {
      return std::make_unique<BoundaryModel>(metric, free, regions.smoothness, options);
    } catch (const SingularSystem& e) {
      refuse_near(e, options, position);
    }
  }();
  const std::size_t w = basis.width();
  std::vector<double> values = given_values(basis, position, regions.fair.empty() ? position : regions.fair);
  model->solve(values, static_cast<int>(w));
  basis.active = model->free_vertices();
  if (regions.loose == LoosePieces::kFollow) follow_all(loose, position, basis, values);
  basis.columns = rows_of(basis.active, values, w);
  report.model = model->report();
  std::vector<Double3> rest = rest_base(basis, position);
  for (std::size_t v = 0; v < regions.fair.size(); ++v)
    if (basis.role[v] != kSupportVertex) rest[v] = regions.fair[v];
  report.energy = model->energy({rest.front().data(), 3 * position.size()}, 3);
  basis.rotation_columns = rotation_columns(rest, base.faces, basis.active,
                                            {values, w, basis.first_handle(), !basis.target.empty()});
  return basis;
}

std::vector<Double3> rest_base(const EditBasis& basis, std::span<const Double3> position) {
  const std::vector<Placement> still(basis.centre.size());
  return solution(basis, position, still, true);
}

std::vector<Double3> smooth_base(const EditBasis& basis, std::span<const Double3> position,
                                 std::span<const Placement> pose) {
  return solution(basis, position, pose, false);
}

std::vector<Rotation> pose_rotations(const EditBasis& basis, std::span<const Placement> pose) {
  // All of it may go far: where nothing is held only differences between handles turn anything.
  bool pinned = false;
  for (const std::int32_t role : basis.role) pinned = pinned || role == kFixedVertex || role == kTargetVertex;
  std::vector<FrameMotion> motion(pose.size());
  for (std::size_t h = 0; h < pose.size(); ++h) {
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t c = 0; c < 3; ++c)
        motion[h][a][c] = basis.radius[h] * (pose[h].matrix[3 * c + a] - (a == c ? 1.0 : 0.0));
    motion[h][3] = pose[h].apply(basis.centre[h]) - basis.centre[h];
  }
  if (!pinned && !pose.empty()) {
    const Double3 far = motion[0][3];
    for (FrameMotion& m : motion) m[3] = m[3] - far;
  }
  return vertex_rotations(basis.rotation_columns, basis.active.size(), !basis.target.empty(), motion);
}

std::vector<Double3> posed_base(const EditBasis& basis, std::span<const Double3> position,
                                std::span<const Rotation> rotation, std::span<const Double3> rest,
                                std::span<const Double3> posed) {
  std::vector<Double3> out(posed.begin(), posed.end());
  for (std::size_t k = 0; k < basis.active.size(); ++k) {
    const auto v = static_cast<std::size_t>(basis.active[k]);
    if (posed[v] == rest[v] && rotation[k] == kIdentityRotation) {
      out[v] = position[v];
      continue;
    }
    out[v] = posed[v] + rotated(rotation[k], position[v] - rest[v]);
  }
  return out;
}

}  // namespace tessera
