#include "kernels/edit/unflip_faces.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/lists.h"

namespace tessera {
namespace {

constexpr int kRounds = 5;
constexpr int kFirstRings = 2;     ///< twice as many in every round
constexpr int kSweepsPerRing = 8;  ///< Gauss-Seidel carries a correction a ring or two at a time
constexpr int kHalvings = 3, kYieldRounds = 8;
constexpr int kLifts = 32, kLiftSweeps = 8;
constexpr int kFirstLifts = 4;  ///< what still has more than a share of its flipped faces then is folded
constexpr std::size_t kLiftedWell = 4;  ///< a quarter
/// Cosine of 84 degrees: faces this close to a right angle count as flipped, since another measure may call them so.
constexpr double kBarely = 0.1;
/// Faces are lifted to a cosine somewhat beyond it, those without an area to a share of the one at rest; no vertex goes farther for
/// it than a share of its shortest edge at rest.
constexpr double kLifted = 0.2, kLiftedArea = 1e-3, kLiftShare = 0.1;
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

struct FlippedFace {
  std::uint32_t face;
  Double3 up;  ///< unit: where its normal should show
};

std::vector<FlippedFace> find_flipped(const RotatedBase& base, std::span<const Double3> posed) {
  const std::vector<Rotation> rotation = fitted_rotations(base.rest, posed, base.faces);
  std::vector<FlippedFace> out;
  for (std::uint32_t j = 0; j < base.faces.size(); ++j) {
    const auto& f = base.faces[j];
    if (!base.free[f[0]] && !base.free[f[1]] && !base.free[f[2]]) continue;
    Rotation sum{};
    for (const std::uint32_t v : f)
      for (std::size_t k = 0; k < 9; ++k) sum[k] += rotation[v][k];
    const Double3 was = triangle_normal(base.rest[f[0]], base.rest[f[1]], base.rest[f[2]]),
                  is = triangle_normal(posed[f[0]], posed[f[1]], posed[f[2]]);
    const Double3 should = rotated(sum, was);
    if (dot(should, is) < kBarely * norm(should) * norm(is)) out.push_back({j, unit_or_zero(should)});
  }
  return out;
}

/// No vertex of this face goes farther than a share of its edges at rest.
void shorten_reach(const RotatedBase& base, std::uint32_t face, std::span<double> reach) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t a = base.faces[face][k], b = base.faces[face][(k + 1) % 3];
    const double length = kLiftShare * norm(base.rest[b] - base.rest[a]);
    reach[a] = std::min(reach[a], length);
    reach[b] = std::min(reach[b], length);
  }
}

/// Moves the free corners of a face, along the gradients of its area as seen from where it should show to, until it shows there.
/// \param reach  how far from `posed` each vertex may go
void lift(const RotatedBase& base, const FlippedFace& flipped, std::span<const Double3> posed,
          std::span<const double> reach, std::span<Double3> trial) {
  const auto& f = base.faces[flipped.face];
  const Double3 normal = triangle_normal(trial[f[0]], trial[f[1]], trial[f[2]]),
                was = triangle_normal(base.rest[f[0]], base.rest[f[1]], base.rest[f[2]]);
  const double lacks = std::max(kLifted * norm(normal), kLiftedArea * norm(was)) - dot(normal, flipped.up);
  if (!(lacks > 0.0)) return;
  std::array<Double3, 3> gradient{};
  double square = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!base.free[f[k]]) continue;
    gradient[k] = cross(flipped.up, trial[f[(k + 2) % 3]] - trial[f[(k + 1) % 3]]);
    square += dot(gradient[k], gradient[k]);
  }
  if (!(square > 0.0)) return;  // a point
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t v = f[k];
    if (!base.free[v]) continue;
    const Double3 by = trial[v] + gradient[k] * (lacks / square) - posed[v];
    const double far = norm(by);
    trial[v] = posed[v] + (far > reach[v] ? by * (reach[v] / far) : by);
  }
}

/// Lifts faces that are turned over, one by one: a surface that is pressed together has a few where it is all but gone, and wants
/// next to nothing to have them upright. Source: Mueller, Heidelberger, Hennix, Ratcliff, "Position Based Dynamics", 2007, its
/// projection of constraints. \param[in,out] posed  keeps the state with the fewest \return how many those are
std::size_t lift_all(const RotatedBase& base, std::vector<FlippedFace> flipped, std::vector<Double3>& posed) {
  const std::size_t before = flipped.size();
  const std::vector<Double3> given = posed;
  std::vector<Double3> trial = posed, up(base.faces.size(), Double3{0, 0, 0});
  std::vector<double> reach(posed.size(), std::numeric_limits<double>::infinity());
  std::vector<std::uint32_t> faces;  // all that were turned over, ascending
  std::size_t left = before;
  for (int round = 0; round < kLifts && left > 0; ++round) {
    if (round == kFirstLifts && left * kLiftedWell > before) break;
    for (const FlippedFace& f : flipped) {
      if (up[f.face] == Double3{0, 0, 0}) {
        faces.push_back(f.face);
        shorten_reach(base, f.face, reach);
      }
      up[f.face] = f.up;
    }
    std::sort(faces.begin(), faces.end());
    for (int sweep = 0; sweep < kLiftSweeps; ++sweep)
      for (const std::uint32_t j : faces) lift(base, {j, up[j]}, given, reach, trial);
    flipped = find_flipped(base, trial);
    if (flipped.size() >= left) continue;
    left = flipped.size();
    posed = trial;
  }
  return left;
}

}  // namespace

std::vector<std::uint32_t> flipped_faces(const RotatedBase& base, std::span<const Double3> posed) {
  std::vector<std::uint32_t> out;
  for (const FlippedFace& f : find_flipped(base, posed)) out.push_back(f.face);
  return out;
}

UnflipReport lift_flipped(const RotatedBase& base, std::vector<Double3>& posed) {
  std::vector<FlippedFace> flipped = find_flipped(base, posed);
  UnflipReport report{flipped.size(), flipped.size()};
  if (!flipped.empty()) report.left = lift_all(base, std::move(flipped), posed);
  return report;
}

UnflipReport unflip(const RotatedBase& base, std::vector<Double3>& posed) {
  std::vector<FlippedFace> flipped = find_flipped(base, posed);
  UnflipReport report{flipped.size(), flipped.size()};
  if (flipped.empty()) return report;
  std::vector<std::uint32_t> faces;
  for (const FlippedFace& f : flipped) faces.push_back(f.face);
  std::vector<Double3> trial = posed;
  report.left = lift_all(base, std::move(flipped), posed);
  if (report.left == 0) return report;
  const Lists<Spoke> edges = spokes(base);
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
