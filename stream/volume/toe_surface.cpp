#include "stream/volume/toe_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "kernels/mesh/polygon_triangulation.h"
#include "kernels/survey/polygon_delaunay.h"
#include "octree/error.h"
#include "octree/small_matrix.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

/// Of all pieces while they are sorted, and of points and their triangulation.
constexpr std::uint64_t kPieceBytes = 3 * sizeof(ToePiece), kPointBytes = 600;
/// Gaps narrower than this share of the outline are rounding.
constexpr double kRoundingGap = 1e-8;

std::vector<ToePiece> gather_pieces(const MeshStore& mesh, const std::vector<VolumeArea>& areas,
                                    const Double3& origin, WorkerPool& pool, MemoryBudget& budget) {
  std::vector<ToePiece> pieces;
  std::mutex mutex;
  pool.run_tasks(
      mesh.patches().size(), [&](std::size_t p) { return 3 * mesh.block_bytes(std::array{p}); }, budget,
      [&](std::size_t p) {
        throw_if_stopped();
        std::vector<ToePiece> found;
        const std::vector<PlanFace> faces = plan_faces(triangles_of(mesh.load(std::array{p}), origin));
        add_toe_pieces(faces, windows_of(areas, faces, origin), found);
        const std::lock_guard lock(mutex);
        pieces.insert(pieces.end(), found.begin(), found.end());
        budget.require(2 * kPieceBytes * pieces.size(), "the outlines of polygons over this mesh");
      });
  std::sort(pieces.begin(), pieces.end());
  return pieces;
}

[[noreturn]] void refuse(const std::filesystem::path& file, const VolumeArea& area, const std::string& why) {
  throw InputError(fmt::format("{}: polygon {} {}", file.string(), area.name, why));
}

void require_covered(const std::filesystem::path& file, const VolumeArea& area,
                     const std::vector<ToeRing>& rings, const Double3& origin, double widest) {
  double length = 0.0, uncovered = 0.0;
  const ToeRing* worst = &rings.front();
  for (const ToeRing& ring : rings) {
    length += ring.length, uncovered += ring.uncovered;
    if (ring.widest_gap > worst->widest_gap) worst = &ring;
  }
  const bool bare = std::any_of(rings.begin(), rings.end(),
                                [](const ToeRing& r) { return !std::isfinite(r.points.front().height); });
  if (!bare && worst->widest_gap <= std::max(widest, kRoundingGap * length)) return;
  refuse(file, area,
         fmt::format(
             "leaves the mesh: {:.6g} of the {:.6g} of its outline ({:.3g} %) have no mesh, the longest "
             "piece {:.6g} from {:.10g}, {:.10g} on, so there is no toe line; draw it on the mesh, or let "
             "the line run straight over gaps with --toe-gap",
             uncovered, length, 100.0 * uncovered / length, worst->widest_gap, worst->gap_at[0] + origin[0],
             worst->gap_at[1] + origin[1]));
}

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

Triangles triangulate(const std::filesystem::path& file, const VolumeArea& area,
                      const std::vector<std::vector<Double2>>& rings) {
  std::size_t corners = 0;
  for (const auto& ring : rings) {
    corners += ring.size() + 2;
    if (ring.size() < 3) refuse(file, area, "has a ring of fewer than three corners");
  }
  if (corners > kMaxPolygonCorners)
    refuse(file, area,
           fmt::format("crosses {} edges of the mesh, and toes are spanned over {} points at most: give "
                       "--base toe-plane, a smaller polygon or a decimated mesh",
                       corners, kMaxPolygonCorners));
  auto triangles = polygon_delaunay(rings);
  if (!triangles)
    refuse(file, area, "has an outline that crosses or touches itself or its holes, so it spans no surface");
  return *std::move(triangles);
}

/// Points of a ring count together as far as their errors do.
double ring_variance(const ToeRing& ring, const std::vector<double>& weights, const HeightNoise& noise) {
  const std::size_t n = ring.points.size();
  const double half = std::min(0.5 * noise.range_along(), 0.5 * ring.length);
  // Sums of weights up to a point, of the ring twice around and before.
  std::vector<double> along(3 * n), sum(3 * n + 1, 0.0);
  for (std::size_t k = 0; k < 3 * n; ++k) {
    along[k] = ring.points[k % n].along + (static_cast<double>(k / n) - 1.0) * ring.length;
    sum[k + 1] = sum[k] + std::abs(weights[k % n]);
  }
  double variance = 0.0;
  std::size_t low = 0, high = 0;
  for (std::size_t k = n; k < 2 * n; ++k) {
    while (along[low] < along[k] - half) ++low;
    while (high < 3 * n && along[high] <= along[k] + half) ++high;
    variance += std::abs(weights[k - n]) * (sum[high] - sum[low]);
  }
  return noise.deviation * noise.deviation * variance;
}

ToeSurface finish_surface(const VolumeArea& area, const std::vector<ToeRing>& rings,
                          const std::vector<std::vector<double>>& weights,
                          std::vector<SpaceTriangle> triangles, const HeightNoise& noise) {
  ToeSurface out;
  out.low = out.high = triangles.empty() ? 0.0 : triangles[0][0][2];
  for (const SpaceTriangle& t : triangles)
    for (const Double3& p : t) out.low = std::min(out.low, p[2]), out.high = std::max(out.high, p[2]);
  for (std::size_t r = 0; r < rings.size(); ++r) {
    out.outline += rings[r].length, out.uncovered += rings[r].uncovered;
    for (std::size_t k = 0; k < weights[r].size(); ++k)
      out.displaced += std::abs(weights[r][k]) *
                       std::sqrt(1.0 + rings[r].points[k].steepness * rings[r].points[k].steepness);
    if (noise.known()) out.variance += ring_variance(rings[r], weights[r], noise);
  }
  if (noise.known()) out.variance = std::min(out.variance, std::pow(noise.deviation * area.plan_area(), 2));
  out.faces = SliverGrid(plan_faces(triangles));
  out.triangles = std::move(triangles);
  return out;
}

ToeSurface span_triangles(const std::filesystem::path& file, const VolumeArea& area,
                          const std::vector<ToeRing>& rings, const HeightNoise& noise) {
  std::vector<std::vector<Double2>> plan;
  std::vector<Double3> point;
  std::vector<std::vector<double>> weights;
  for (const ToeRing& ring : rings) {
    plan.emplace_back();
    weights.emplace_back(ring.points.size(), 0.0);
    for (const ToePoint& p : ring.points)
      plan.back().push_back(p.at), point.push_back({p.at[0], p.at[1], p.height});
  }
  std::vector<double> weight(point.size(), 0.0);
  std::vector<SpaceTriangle> triangles;
  for (const auto& t : triangulate(file, area, plan)) {
    triangles.push_back({point[t[0]], point[t[1]], point[t[2]]});
    const double third = PlanPiece(PlanTriangle(point[t[0]], point[t[1]], point[t[2]]).shadow()).area() / 3.0;
    for (const std::uint32_t v : t) weight[v] += third;
  }
  std::size_t at = 0;
  for (auto& of : weights)
    for (double& w : of) w = weight[at++];
  return finish_surface(area, rings, weights, std::move(triangles), noise);
}

/// The plane of least squares over the length of the line, about its middle.
ToeSurface span_plane(const std::filesystem::path& file, const VolumeArea& area,
                      const std::vector<ToeRing>& rings, const HeightNoise& noise) {
  // Every point stands for half the length to its neighbours.
  std::vector<std::vector<double>> share;
  Double3 middle{};
  double total = 0.0;
  for (const ToeRing& ring : rings) {
    const std::size_t n = ring.points.size();
    share.emplace_back(n, 0.0);
    for (std::size_t k = 0; k < n; ++k) {
      const double next = k + 1 < n ? ring.points[k + 1].along : ring.length;
      const double length = next - ring.points[k].along;
      share.back()[k] += 0.5 * length, share.back()[(k + 1) % n] += 0.5 * length;
    }
    for (std::size_t k = 0; k < n; ++k) {
      const ToePoint& p = ring.points[k];
      middle = middle + Double3{p.at[0], p.at[1], p.height} * share.back()[k];
      total += share.back()[k];
    }
  }
  middle = middle / total;
  Matrix3 normal = Matrix3::zero();
  std::array<double, 3> plane{};
  const auto row_of = [&](const ToePoint& p) {
    return std::array{1.0, p.at[0] - middle[0], p.at[1] - middle[1]};
  };
  for (std::size_t r = 0; r < rings.size(); ++r)
    for (std::size_t k = 0; k < share[r].size(); ++k) {
      const ToePoint& p = rings[r].points[k];
      const auto row = row_of(p);
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) normal(i, j) += share[r][k] * row[i] * row[j];
        plane[i] += share[r][k] * row[i] * (p.height - middle[2]);
      }
    }
  if (!cholesky_factor(normal, 0.0, 1e-12))
    refuse(file, area, "has an outline on one line, which fits no plane");
  cholesky_solve(normal, plane);

  std::vector<SpaceTriangle> triangles;
  std::vector<Double3> point;
  for (const auto& ring : area.rings)
    for (const Double2& p : ring)
      point.push_back(
          {p[0], p[1], middle[2] + plane[0] + plane[1] * (p[0] - middle[0]) + plane[2] * (p[1] - middle[1])});
  // The volume under the plane is its height over the centre of the area, times that.
  std::array<double, 3> moment{};
  for (const auto& t : triangulate(file, area, area.rings)) {
    triangles.push_back({point[t[0]], point[t[1]], point[t[2]]});
    const double size = PlanPiece(PlanTriangle(point[t[0]], point[t[1]], point[t[2]]).shadow()).area();
    const Double3 centre = (point[t[0]] + point[t[1]] + point[t[2]]) / 3.0;
    moment[0] += size, moment[1] += size * (centre[0] - middle[0]),
        moment[2] += size * (centre[1] - middle[1]);
  }
  cholesky_solve(normal, moment);
  for (std::size_t r = 0; r < rings.size(); ++r)
    for (std::size_t k = 0; k < share[r].size(); ++k) {
      const auto row = row_of(rings[r].points[k]);
      share[r][k] *= moment[0] * row[0] + moment[1] * row[1] + moment[2] * row[2];
    }
  return finish_surface(area, rings, share, std::move(triangles), noise);
}

}  // namespace

std::vector<ToeSurface> span_toes(const MeshStore& mesh, const std::filesystem::path& file,
                                  const std::vector<VolumeArea>& areas, const Double3& origin, ToeKind kind,
                                  double widest, const HeightNoise& noise, WorkerPool& pool,
                                  MemoryBudget& budget) {
  const std::vector<ToePiece> pieces = gather_pieces(mesh, areas, origin, pool, budget);
  std::vector<ToeSurface> surfaces;
  std::uint64_t held = 0;
  for (std::uint32_t k = 0; k < areas.size(); ++k) {
    throw_if_stopped();
    const std::vector<ToeRing> rings = toe_rings(areas[k], k, pieces);
    require_covered(file, areas[k], rings, origin, widest);
    std::uint64_t points = 0;
    for (const ToeRing& ring : rings) points += ring.points.size();
    held += points * sizeof(SpaceTriangle) + SliverGrid::bytes(points);
    budget.require(kPieceBytes * pieces.size() + points * kPointBytes + held,
                   "the toe lines of polygons over this mesh");
    surfaces.push_back(kind == ToeKind::kPlane ? span_plane(file, areas[k], rings, noise)
                                               : span_triangles(file, areas[k], rings, noise));
  }
  return surfaces;
}

}  // namespace tessera
