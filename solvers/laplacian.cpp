#include "solvers/laplacian.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include "octree/error.h"
#include "octree/lists.h"
#include "octree/vector.h"
#include "solvers/intrinsic_delaunay.h"

namespace tessera {
namespace {

/// Cotangents at the three corners, squared lengths of the edges opposite to them and the area.
struct FaceShape {
  Double3 cot{}, squared{};
  double area = 0.0;
  bool sound = false;
};

FaceShape shape_of(const TriangleSpan& mesh, const std::array<std::uint32_t, 3>& face,
                   double degenerate_ratio) {
  FaceShape s;
  std::array<Double3, 3> edge;  // edge k lies opposite corner k
  for (int k = 0; k < 3; ++k) {
    const Double3& from = mesh.positions[face[(k + 1) % 3]];
    const Double3& to = mesh.positions[face[(k + 2) % 3]];
    edge[k] = to - from;
    s.squared[k] = dot(edge[k], edge[k]);
  }
  const double twice = norm(cross(edge[0], edge[1]));
  const double longest = std::max({s.squared[0], s.squared[1], s.squared[2]});
  if (!(twice > degenerate_ratio * longest)) return s;
  s.sound = true;
  s.area = 0.5 * twice;
  for (int k = 0; k < 3; ++k) {
    const Double3 &u = edge[(k + 1) % 3], &v = edge[(k + 2) % 3];
    s.cot[k] = -(dot(u, v)) / twice;
  }
  return s;
}

/// The same from edge lengths; edge k lies opposite corner k.
FaceShape shape_of(const std::array<double, 3>& length) {
  FaceShape s;
  const double twice = 2.0 * triangle_area(length);
  for (int k = 0; k < 3; ++k) s.squared[k] = length[k] * length[k];
  if (!(twice > 0.0)) return s;
  s.sound = true;
  s.area = 0.5 * twice;
  for (int k = 0; k < 3; ++k)
    s.cot[k] = (s.squared[(k + 1) % 3] + s.squared[(k + 2) % 3] - s.squared[k]) / (2.0 * twice);
  return s;
}

/// Share of each corner in the area: Voronoi where no angle is obtuse, else 1/2 at the obtuse corner, 1/4
/// beside it.
Double3 mixed_areas(const FaceShape& s) {
  for (int k = 0; k < 3; ++k)
    if (s.cot[k] < 0.0) {
      Double3 share = {0.25 * s.area, 0.25 * s.area, 0.25 * s.area};
      share[k] = 0.5 * s.area;
      return share;
    }
  Double3 share{};
  for (int k = 0; k < 3; ++k) {
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    share[k] = 0.125 * (s.squared[a] * s.cot[a] + s.squared[b] * s.cot[b]);
  }
  return share;
}

void check(const TriangleSpan& mesh) {
  const std::size_t n = mesh.positions.size();
  if (n > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()) ||
      mesh.faces.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max() / 3))
    throw ResourceError("a mesh of " + std::to_string(n) + " vertices and " +
                        std::to_string(mesh.faces.size()) + " faces is too large for one system: split it");
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (const std::uint32_t v : mesh.faces[f]) {
      if (v >= n)
        throw InputError("face " + std::to_string(f) + ": vertex index " + std::to_string(v) +
                         " is not below the number of vertices, " + std::to_string(n));
      if (!all_finite(mesh.positions[v]))
        throw InputError("vertex " + std::to_string(v) + " of face " + std::to_string(f) + " is not finite");
    }
}

struct Entry {
  std::int32_t column;
  double weight;
};

/// Stiffness from a weight for each corner (of the edge opposite to it), row by row through the faces of a
/// vertex in ascending order: both entries of an edge are then the same sum, and the matrix is symmetric to
/// the bit.
SparseMatrix assemble(std::size_t n, std::span<const std::array<std::uint32_t, 3>> faces,
                      std::span<const Double3> weight, LaplacianWeights kind, LaplacianReport& report) {
  const auto corners = make_lists<std::int32_t, std::int32_t>(n, [&](const auto& put) {
    for (std::size_t f = 0; f < faces.size(); ++f)
      for (int k = 0; k < 3; ++k) put(faces[f][k], static_cast<std::int32_t>(3 * f) + k);
  });
  SparseMatrix m;
  m.rows = m.columns = static_cast<std::int32_t>(n);
  m.start.assign(n + 1, 0);
  m.column.reserve(n + faces.size() * 3 + faces.size() / 8);
  m.value.reserve(m.column.capacity());
  std::vector<Entry> row;
  for (std::size_t i = 0; i < n; ++i) {
    const auto self = static_cast<std::int32_t>(i);
    row.clear();
    for (const std::int32_t c : corners[i]) {
      const std::int32_t f = c / 3;
      const int k = c % 3;
      for (const int side : {1, 2}) {
        const auto j = static_cast<std::int32_t>(faces[f][(k + side) % 3]);
        const double w = kind == LaplacianWeights::kUniform ? 1.0 : 0.5 * weight[f][(k + 3 - side) % 3];
        if (j != self) row.push_back({j, w});
      }
    }
    std::stable_sort(row.begin(), row.end(),
                     [](const Entry& a, const Entry& b) { return a.column < b.column; });
    double diagonal = 0.0;
    std::size_t slot = m.column.size();
    bool placed = false;
    for (std::size_t e = 0; e < row.size();) {
      const std::int32_t j = row[e].column;
      double w = row[e++].weight;
      for (; e < row.size() && row[e].column == j; ++e)
        if (kind != LaplacianWeights::kUniform) w += row[e].weight;
      if (w < 0.0) {
        report.negative_weights += j > self;
        if (kind == LaplacianWeights::kClampedCotangent) w = 0.0;
      }
      if (!placed && j > self) {
        slot = m.column.size();
        placed = true;
        m.column.push_back(self);
        m.value.push_back(0.0);
      }
      m.column.push_back(j);
      m.value.push_back(w);
      diagonal -= w;
    }
    if (!placed) {
      slot = m.column.size();
      m.column.push_back(self);
      m.value.push_back(0.0);
    }
    m.value[slot] = diagonal;
    if (m.entries() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
      throw ResourceError("a Laplacian has more than 2^31 entries: split the mesh");
    m.start[i + 1] = static_cast<std::int32_t>(m.entries());
  }
  return m;
}

void fill_massless(Laplacian& out) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const double m : out.mass)
    if (m > 0.0) smallest = std::min(smallest, m);
  for (double& m : out.mass)
    if (!(m > 0.0)) {
      m = std::isfinite(smallest) ? smallest : 1.0;
      ++out.report.massless_vertices;
    }
}

}  // namespace

Laplacian laplacian(const TriangleSpan& mesh, const LaplacianOptions& options) {
  check(mesh);
  const std::size_t n = mesh.positions.size();
  Laplacian out;
  out.mass.assign(n, 0.0);
  if (options.weights == LaplacianWeights::kUniform) {
    out.stiffness = assemble(n, mesh.faces, {}, options.weights, out.report);
    for (std::size_t i = 0; i < n; ++i) out.mass[i] = out.stiffness.start[i + 1] - out.stiffness.start[i] - 1;
    fill_massless(out);
    return out;
  }
  std::vector<Double3> cot(mesh.faces.size());
  std::size_t sound = 0;
  const auto take = [&](std::size_t f, const std::array<std::uint32_t, 3>& face, const FaceShape& s) {
    cot[f] = s.cot;
    if (!s.sound) return;
    ++sound;
    const Double3 share = mixed_areas(s);
    for (int k = 0; k < 3; ++k) out.mass[face[k]] += share[k];
  };
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceShape s = shape_of(mesh, mesh.faces[f], options.degenerate_ratio);
    if (!s.sound) {
      if (out.report.degenerate_faces++ == 0) out.report.first_degenerate = static_cast<std::int64_t>(f);
    }
    if (options.weights != LaplacianWeights::kIntrinsicDelaunay)
      take(f, mesh.faces[f], s);
    else
      sound += s.sound;
  }
  if (sound == 0) throw InputError("the mesh has no face with an area: remesh or repair it first");
  if (options.weights == LaplacianWeights::kIntrinsicDelaunay) {
    IntrinsicMesh intrinsic = intrinsic_delaunay(mesh);
    out.report.flips = intrinsic.flips;
    out.report.unflippable = intrinsic.not_delaunay;
    for (std::size_t f = 0; f < intrinsic.faces.size(); ++f)
      take(f, intrinsic.faces[f], shape_of(intrinsic.length[f]));
    out.stiffness = assemble(n, intrinsic.faces, cot, options.weights, out.report);
  } else {
    out.stiffness = assemble(n, mesh.faces, cot, options.weights, out.report);
  }
  fill_massless(out);
  return out;
}

}  // namespace tessera
