#include "kernels/decimate/reference_mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

/// The other end of a line at `at` than that to `from`, or where from is kNoCorner the first one.
/// \return false where not exactly two lines meet
bool next_on_line(const ReferenceMesh& mesh, std::uint32_t at, std::uint32_t from, std::uint32_t& next) {
  std::size_t lines = 0;
  bool came = from == kNoCorner;
  const auto visit = [&](std::uint32_t w) {
    ++lines;
    if (w == from)
      came = true;
    else if (lines == 1 || from != kNoCorner)
      next = w;
  };
  const std::uint32_t first = mesh.corner[at];
  std::uint32_t c = first;
  do {
    if (mesh.is_line(prev_corner(c))) visit(mesh.vertex(next_corner(c)));
    const std::uint32_t ahead = mesh.next_in_fan(c);
    if (ahead == kNoCorner && mesh.is_line(next_corner(c))) visit(mesh.vertex(prev_corner(c)));
    c = ahead;
  } while (c != kNoCorner && c != first);
  return lines == 2 && came;
}

void set_heights(ReferenceMesh& mesh) {
  mesh.max_height.resize(mesh.vertices.size(), 0.0f);
  for (const ReferenceMesh::Face& f : mesh.faces) {
    const Double3 a = mesh.vertices[f.vertex[0]].at, b = mesh.vertices[f.vertex[1]].at - a,
                  c = mesh.vertices[f.vertex[2]].at - a;
    const double longest2 = std::max({dot(b, b), dot(c, c), dot(c - b, c - b)});
    if (!(longest2 > 0.0)) continue;
    const auto height = static_cast<float>(norm(cross(b, c)) / std::sqrt(longest2));
    for (const std::uint32_t v : f.vertex) mesh.max_height[v] = std::max(mesh.max_height[v], height);
  }
}

}  // namespace

ReferenceMesh::ReferenceMesh(const CollapseMesh& mesh, bool heights) {
  // Written once: made empty first, arrays of this size would go through memory twice.
  faces.reserve(mesh.faces().size());
  for (const CollapseFace& from : mesh.faces())
    faces.push_back({{from.vertex[0], from.vertex[1], from.vertex[2]},
                     0,
                     {from.opposite[0], from.opposite[1], from.opposite[2]},
                     (from.state & (7u * kStateBorder | 7u * kStateCrease)) |
                         ((std::bit_cast<std::uint32_t>(from.bound) + Face::kLineBits) & ~Face::kLineBits)});
  vertices.reserve(mesh.vertices());
  corner.reserve(mesh.vertices());
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
    vertices.push_back({mesh.at(v), 0, 0});
    corner.push_back(mesh.corner(v));
  }
  if (heights) set_heights(*this);
}

bool line_deviation(const ReferenceMesh& mesh, std::uint32_t u, std::uint32_t v, std::uint32_t q,
                    double limit, double& deviation) {
  constexpr int kMaxSteps = 100000;
  const Double3 start = mesh.vertices[v].at, edge = mesh.vertices[q].at - start;
  const double length2 = dot(edge, edge);
  double max2 = 0.0;
  const auto add = [&](std::uint32_t w) {
    const Double3 r = mesh.vertices[w].at - start;
    const Double3 off = r - edge * (length2 > 0.0 ? std::clamp(dot(r, edge) / length2, 0.0, 1.0) : 0.0);
    max2 = std::max(max2, dot(off, off));
    return max2 <= limit * limit;
  };
  if (!add(u)) return false;
  std::uint32_t ahead[2] = {kNoCorner, kNoCorner};
  if (!next_on_line(mesh, u, kNoCorner, ahead[0]) || !next_on_line(mesh, u, ahead[0], ahead[1])) return false;
  for (std::uint32_t& at : ahead) {
    std::uint32_t before = u;
    for (int step = 0; at != v && at != q; ++step) {
      std::uint32_t next = kNoCorner;
      if (step == kMaxSteps || at == u || !add(at) || !next_on_line(mesh, at, before, next)) return false;
      before = at;
      at = next;
    }
  }
  deviation = std::sqrt(max2) * (1.0 + 0x1p-40);
  return ahead[0] != ahead[1];
}

bool gather_fan(const ReferenceMesh& mesh, std::uint32_t start, std::vector<std::uint32_t>& fan) {
  fan.clear();
  std::uint32_t c = start;
  do {
    fan.push_back(c);
    c = mesh.next_in_fan(c);
  } while (c != kNoCorner && c != start);
  return c == start;
}

std::uint32_t corner_behind_line(const ReferenceMesh& mesh, std::uint32_t v) {
  const std::uint32_t first = mesh.corner[v];
  std::uint32_t c = first;
  while (!mesh.is_line(prev_corner(c))) {
    c = mesh.next_in_fan(c);
    if (c == kNoCorner || c == first) return kNoCorner;
  }
  return c;
}

}  // namespace tessera
