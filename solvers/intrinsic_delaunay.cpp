#include "solvers/intrinsic_delaunay.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "octree/edge_faces.h"

namespace tessera {
namespace {

constexpr double kMollify = 1e-6;     // least slack of the triangle inequality, in mean edge lengths
constexpr double kTolerance = 1e-12;  // a sum of cotangents above minus this is Delaunay
constexpr std::size_t kFlipsPerEdge = 100;

/// Slot (3 * face + corner opposite the edge) across each edge, -1 at borders, at edges of three and more
/// faces and between faces of opposite orientation.
std::vector<std::int32_t> glue(std::size_t vertices, const std::vector<std::array<std::uint32_t, 3>>& faces) {
  const auto slot = [](std::uint32_t half) {
    return static_cast<std::int32_t>(half / 3 * 3 + (half % 3 + 2) % 3);
  };
  const auto tail = [&](std::uint32_t half) { return faces[half / 3][half % 3]; };
  std::vector<std::int32_t> twin(faces.size() * 3, -1);
  EdgeFaces(vertices, faces)
      .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
        if (half.size() != 2 || low == high || tail(half[0]) == tail(half[1])) return;
        twin[slot(half[0])] = slot(half[1]);
        twin[slot(half[1])] = slot(half[0]);
      });
  return twin;
}

double cotangent(const std::array<double, 3>& length, int corner) {
  const double a = length[corner], b = length[(corner + 1) % 3], c = length[(corner + 2) % 3];
  const double area = triangle_area(length);
  // A flat triangle: angle 180 degrees opposite its longest edge, else 0.
  if (!(area > 0.0)) return a >= b && a >= c ? -1e30 : 1e30;
  return (b * b + c * c - a * a) / (4.0 * area);
}

}  // namespace

double triangle_area(const std::array<double, 3>& length) {
  std::array<double, 3> s = length;
  std::sort(s.begin(), s.end(), [](double x, double y) { return x > y; });
  const double a = s[0], b = s[1], c = s[2];
  const double q = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
  return q > 0.0 ? 0.25 * std::sqrt(q) : 0.0;
}

IntrinsicMesh intrinsic_delaunay(const TriangleSpan& mesh) {
  IntrinsicMesh out;
  out.faces.assign(mesh.faces.begin(), mesh.faces.end());
  out.length.resize(out.faces.size());
  double total = 0.0;
  for (std::size_t f = 0; f < out.faces.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      // From the smaller index to the larger: both faces see the same bits.
      const std::uint32_t u = out.faces[f][(k + 1) % 3], v = out.faces[f][(k + 2) % 3];
      const auto &p = mesh.positions[std::min(u, v)], &q = mesh.positions[std::max(u, v)];
      double s = 0.0;
      for (int d = 0; d < 3; ++d) s += (q[d] - p[d]) * (q[d] - p[d]);
      out.length[f][k] = std::sqrt(s);
      total += out.length[f][k];
    }
  if (out.faces.empty()) return out;
  const double slack = kMollify * total / static_cast<double>(3 * out.faces.size());
  for (const auto& l : out.length)
    for (int k = 0; k < 3; ++k)
      out.mollified = std::max(out.mollified, slack - (l[(k + 1) % 3] + l[(k + 2) % 3] - l[k]));
  if (out.mollified > 0.0)
    for (auto& l : out.length)
      for (double& v : l) v += out.mollified;

  std::vector<std::int32_t> twin = glue(mesh.positions.size(), out.faces);
  std::deque<std::int32_t> queue;  // one slot of each edge to look at, first come first served
  std::vector<std::uint8_t> queued(twin.size(), 0);
  const auto push = [&](std::int32_t s) {
    if (twin[s] < 0) return;
    s = std::min(s, twin[s]);
    if (queued[s]) return;
    queued[s] = 1;
    queue.push_back(s);
  };
  const auto weight = [&](std::int32_t s) {
    return cotangent(out.length[s / 3], s % 3) + cotangent(out.length[twin[s] / 3], twin[s] % 3);
  };
  for (std::size_t s = 0; s < twin.size(); ++s) push(static_cast<std::int32_t>(s));
  const std::size_t maximum = kFlipsPerEdge * twin.size();
  while (!queue.empty() && out.flips < maximum) {
    const std::int32_t s = queue.front();
    queue.pop_front();
    queued[s] = 0;
    if (twin[s] < 0 || !(weight(s) < -kTolerance)) continue;
    const std::int32_t t = twin[s];
    const std::int32_t f = s / 3, g = t / 3;
    if (f == g) continue;
    const int i = s % 3, j = t % 3;
    // f = (p, a, b) with apex p, g = (q, b, a) with apex q; the edge a-b becomes p-q.
    const std::uint32_t p = out.faces[f][i], a = out.faces[f][(i + 1) % 3], b = out.faces[f][(i + 2) % 3];
    const std::uint32_t q = out.faces[g][j];
    const double ab = out.length[f][i], bp = out.length[f][(i + 1) % 3], pa = out.length[f][(i + 2) % 3];
    const double aq = out.length[g][(j + 1) % 3], qb = out.length[g][(j + 2) % 3];
    const std::int32_t t_bp = twin[3 * f + (i + 1) % 3], t_pa = twin[3 * f + (i + 2) % 3];
    const std::int32_t t_aq = twin[3 * g + (j + 1) % 3], t_qb = twin[3 * g + (j + 2) % 3];
    // Both triangles in the plane: a at the origin, b at (ab, 0), p above, q below.
    const double px = (ab * ab + pa * pa - bp * bp) / (2.0 * ab), py = 2.0 * triangle_area({ab, bp, pa}) / ab;
    const double qx = (ab * ab + aq * aq - qb * qb) / (2.0 * ab), qy = 2.0 * triangle_area({ab, qb, aq}) / ab;
    const double pq = std::sqrt((px - qx) * (px - qx) + (py + qy) * (py + qy));
    if (!(pq > 0.0)) continue;
    // f becomes (p, a, q), g becomes (q, b, p); slot k lies opposite corner k.
    out.faces[f] = {p, a, q};
    out.faces[g] = {q, b, p};
    out.length[f] = {aq, pq, pa};
    out.length[g] = {bp, pq, qb};
    const auto join = [&](std::int32_t slot, std::int32_t other) {
      twin[slot] = other;
      if (other >= 0) twin[other] = slot;
    };
    // An old outer edge may be glued to another slot of these two faces.
    const std::array<std::int32_t, 4> old_slot = {3 * f + (i + 1) % 3, 3 * f + (i + 2) % 3,
                                                  3 * g + (j + 1) % 3, 3 * g + (j + 2) % 3};
    const std::array<std::int32_t, 4> new_slot = {3 * g, 3 * f + 2, 3 * f, 3 * g + 2};
    std::array<std::int32_t, 4> across = {t_bp, t_pa, t_aq, t_qb};
    for (auto& x : across)
      for (int k = 0; k < 4; ++k)
        if (x == old_slot[k]) {
          x = new_slot[k];
          break;
        }
    for (int k = 0; k < 4; ++k) queued[new_slot[k]] = 0;
    for (int k = 0; k < 4; ++k) join(new_slot[k], across[k]);
    join(3 * f + 1, 3 * g + 1);
    ++out.flips;
    for (int k = 0; k < 4; ++k) push(new_slot[k]);
  }
  for (std::size_t s = 0; s < twin.size(); ++s) {
    const auto slot = static_cast<std::int32_t>(s);
    if (twin[s] > slot && weight(slot) < -kTolerance) ++out.not_delaunay;
  }
  return out;
}

}  // namespace tessera
