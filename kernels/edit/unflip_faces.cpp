#include "kernels/edit/unflip_faces.h"

#include <algorithm>
#include <cmath>

#include "octree/lists.h"

namespace tessera {
namespace {

constexpr int kRounds = 5;
constexpr int kFirstRings = 2;     ///< twice as many in every round
constexpr int kSweepsPerRing = 8;  ///< Gauss-Seidel carries a correction a ring or two at a time
constexpr int kHalvings = 3, kYieldRounds = 8;
/// Cosine of 84 degrees: faces this close to a right angle count as flipped, since another measure may call them so.
constexpr double kBarely = 0.1;
constexpr double kMaxEdgeWeight = 20,
                 kMinEdgeWeight = 0.02;  ///< of an edge: slivers neither dominate nor detach

/// An edge by what it weighs on its side of a face.
struct Spoke {
  std::uint32_t to;
  double weight;
};

/// Both ways, once for each face at an edge; for vertices near turned faces alone there would be as much to sort out.
Lists<Spoke> spokes(const RotatedBase& base) {
  return make_lists<Spoke>(base.rest.size(), [&](const auto& put) {
    for (const auto& f : base.faces)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = f[(k + 1) % 3], b = f[(k + 2) % 3];
        if (!base.free[a] && !base.free[b]) continue;
        const Double3 u = base.rest[a] - base.rest[f[k]], v = base.rest[b] - base.rest[f[k]];
        const double area = norm(cross(u, v));
        const double weight =
            area > 0.0 ? std::clamp(0.5 * dot(u, v) / area, kMinEdgeWeight, kMaxEdgeWeight) : kMinEdgeWeight;
        put(a, Spoke{b, weight});
        put(b, Spoke{a, weight});
      }
  });
}

/// Free vertices within some rings of the faces, ascending.
std::vector<std::uint32_t> around(const RotatedBase& base, const Lists<Spoke>& spokes,
                                  std::span<const std::uint32_t> faces, int rings) {
  std::vector<std::uint8_t> in(base.rest.size(), 0);
  std::vector<std::uint32_t> out;
  const auto add = [&](std::uint32_t v) {
    if (!base.free[v] || in[v]) return;
    in[v] = 1;
    out.push_back(v);
  };
  for (const std::uint32_t j : faces)
    for (const std::uint32_t v : base.faces[j]) add(v);
  for (std::size_t begin = 0; rings > 0; --rings) {
    const std::size_t end = out.size();
    for (; begin < end; ++begin)
      for (const Spoke& s : spokes[out[begin]]) add(s.to);
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Sweeps over the vertices: each to the mean of where its edges, turned, lead from its neighbours.
void relax(const RotatedBase& base, const Lists<Spoke>& spokes, std::span<const std::uint32_t> vertices,
           int sweeps, std::span<Double3> posed) {
  std::vector<Double3> ahead;  // per vertex: what edges add to the mean of neighbours
  std::vector<double> all;
  for (const std::uint32_t v : vertices) {
    Double3 sum = {0, 0, 0};
    double weight = 0.0;
    for (const Spoke& s : spokes[v]) {
      const Double3 edge = base.rest[v] - base.rest[s.to];
      Double3 to = rotated(base.rotation[v], edge);
      if (base.free[s.to]) to = (to + rotated(base.rotation[s.to], edge)) * 0.5;
      sum = sum + to * s.weight;
      weight += s.weight;
    }
    ahead.push_back(sum);
    all.push_back(weight);
  }
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      Double3 sum = ahead[i];
      for (const Spoke& s : spokes[vertices[i]]) sum = sum + posed[s.to] * s.weight;
      posed[vertices[i]] = sum * (1.0 / all[i]);
    }
}

}  // namespace

std::vector<std::uint32_t> flipped_faces(const RotatedBase& base, std::span<const Double3> posed) {
  const std::vector<Rotation> rotation = fitted_rotations(base.rest, posed, base.faces);
  std::vector<std::uint32_t> out;
  for (std::uint32_t j = 0; j < base.faces.size(); ++j) {
    const auto& f = base.faces[j];
    if (!base.free[f[0]] && !base.free[f[1]] && !base.free[f[2]]) continue;
    Rotation sum{};
    for (const std::uint32_t v : f)
      for (std::size_t k = 0; k < 9; ++k) sum[k] += rotation[v][k];
    const Double3 was = triangle_normal(base.rest[f[0]], base.rest[f[1]], base.rest[f[2]]),
                  is = triangle_normal(posed[f[0]], posed[f[1]], posed[f[2]]);
    const Double3 should = rotated(sum, was);
    if (dot(should, is) < kBarely * norm(should) * norm(is)) out.push_back(j);
  }
  return out;
}

UnflipReport unflip(const RotatedBase& base, std::vector<Double3>& posed) {
  std::vector<std::uint32_t> faces = flipped_faces(base, posed);
  UnflipReport report{faces.size(), faces.size()};
  if (faces.empty()) return report;
  const Lists<Spoke> edges = spokes(base);
  std::vector<Double3> trial = posed;
  for (int round = 0; round < kRounds && !faces.empty(); ++round) {
    const int rings = kFirstRings << round;
    relax(base, edges, around(base, edges, faces, rings), kSweepsPerRing * rings, trial);
    faces = flipped_faces(base, trial);
    if (faces.size() >= report.left) continue;
    report.left = faces.size();
    posed = trial;
  }
  return report;
}

std::size_t yield_to(const RotatedBase& base, std::span<const Double3> other, std::size_t left,
                     std::vector<Double3>& posed) {
  std::vector<Double3> trial = posed;
  const std::vector<Double3> mine = posed;
  std::vector<int> rounds(posed.size(), 0);
  std::vector<std::uint8_t> flipped, near;
  std::vector<std::uint32_t> faces = flipped_faces(base, trial);
  for (int round = 0; round < kYieldRounds && left > 0; ++round) {
    flipped.assign(posed.size(), 0);
    for (const std::uint32_t j : faces)
      for (const std::uint32_t v : base.faces[j]) flipped[v] = 1;
    near = flipped;
    for (const auto& f : base.faces)
      if ((flipped[f[0]] | flipped[f[1]] | flipped[f[2]]) != 0) near[f[0]] = near[f[1]] = near[f[2]] = 1;
    for (std::size_t v = 0; v < near.size(); ++v) {
      if (!near[v] || !base.free[v] || rounds[v] > kHalvings) continue;
      double share = 1.0;  // that stays
      for (int r = 0; r <= rounds[v]; ++r) share *= 0.5;
      trial[v] = ++rounds[v] > kHalvings ? other[v] : other[v] + (mine[v] - other[v]) * share;
    }
    faces = flipped_faces(base, trial);
    if (faces.size() >= left) continue;
    left = faces.size();
    posed = trial;
  }
  return left;
}

}  // namespace tessera
