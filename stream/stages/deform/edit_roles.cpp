#include "stream/stages/deform/edit_roles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/stages/deform/vertex_batches.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoNeighbour = 0xffffffffu;

/// Regions with the positions of the vertices that they name.
std::vector<EditRegion> with_vertices(const EditScript& script, const RegionSource& source,
                                      TaskContext& context) {
  std::vector<EditRegion> regions = script.regions;
  struct Named {
    std::uint64_t vertex;
    std::size_t region, slot;
    bool operator<(const Named& o) const { return vertex < o.vertex; }
  };
  std::vector<Named> named;
  for (std::size_t r = 0; r < regions.size(); ++r) {
    for (std::size_t k = 0; k < script.vertices[r].size(); ++k)
      named.push_back({script.vertices[r][k], r, regions[r].points.size() + k});
    regions[r].points.resize(regions[r].points.size() + script.vertices[r].size());
  }
  if (named.empty()) return regions;
  std::stable_sort(named.begin(), named.end());
  std::uint64_t first = 0;
  std::size_t at = 0;
  open_mesh_file(source.mesh)
      ->read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
        context.check_stop();
        for (; at < named.size() && named[at].vertex < first + batch.size(); ++at)
          regions[named[at].region].points[named[at].slot] = batch[named[at].vertex - first];
        first += batch.size();
      });
  if (at < named.size())
    throw InputError("region " + std::to_string(named[at].region + 1) + " names vertex " +
                     std::to_string(named[at].vertex) + ", but the mesh has " + std::to_string(first) +
                     ": they count from 0");
  return regions;
}

/// Ring by ring, from the lowest neighbour that has one.
void spread_along(const BaseSurface& base, std::vector<std::uint32_t>& colour, std::vector<double>& known) {
  for (bool more = true; more;) {
    more = false;
    std::vector<std::uint32_t> from(colour.size(), kNoNeighbour);
    for (const auto& f : base.faces)
      for (const std::uint32_t v : f)
        for (const std::uint32_t u : f)
          if (!std::isfinite(known[v]) && std::isfinite(known[u])) from[v] = std::min(from[v], u);
    for (std::size_t v = 0; v < from.size(); ++v)
      if (from[v] != kNoNeighbour) {
        colour[v] = colour[from[v]];
        known[v] = 0.0;
        more = true;
      }
  }
}

/// Per vertex of the base the colour of the mesh's vertex nearest to it; where none is nearer than to another vertex of the
/// base, that of the next one along the surface. Empty where no region asks for it, or the mesh has none.
std::vector<std::uint32_t> painted(const BaseSurface& base, const EditScript& script,
                                   const RegionSource& source, TaskContext& context) {
  if (std::none_of(script.regions.begin(), script.regions.end(),
                   [](const EditRegion& r) { return r.shape == RegionShape::kPainted; }))
    return {};
  const std::vector<Double3>& at = base.position;
  std::vector<std::array<std::uint32_t, 3>> points;
  for (std::uint32_t v = 0; v < at.size(); ++v) points.push_back({v, v, v});
  const ClosestFaces closest(at, points, at.front());
  std::vector<std::uint32_t> colour(at.size(), 0);
  std::vector<double> best(at.size(), std::numeric_limits<double>::infinity());
  bool coloured = false;
  const auto mesh = open_mesh_file(source.mesh);
  stream_vertices(
      *mesh, source.window, context,
      [&](std::uint64_t, DisplacedBatch& b) {
        // The nearest vertex of the base, and how far it is.
        b.displaced.of.assign(b.position.size(), {});
        b.distance.assign(b.position.size(), std::numeric_limits<double>::infinity());
        for (std::size_t i = 0; i < b.position.size(); ++i) {
          const auto hit = closest.closest(b.position[i] - closest.origin(),
                                           std::numeric_limits<double>::infinity(), ClosestFaces::kNone);
          if (hit.slot == ClosestFaces::kNone) continue;
          b.displaced.of[i].face = closest.face(hit.slot);
          b.distance[i] = hit.square;
        }
      },
      [&](DisplacedBatch& b) {
        coloured = coloured || !b.rgba.empty();
        for (std::size_t i = 0; i < b.rgba.size(); ++i)
          if (const std::uint32_t v = b.displaced.of[i].face; b.distance[i] < best[v]) {
            best[v] = b.distance[i];
            colour[v] = b.rgba[i];
          }
      });
  if (!coloured) return {};
  spread_along(base, colour, best);
  return colour;
}

}  // namespace

EditRegions base_regions(const BaseSurface& base, const EditScript& script, const RegionSource& source,
                         TaskContext& context) {
  const std::vector<EditRegion> listed = with_vertices(script, source, context);
  const std::vector<std::uint32_t> colour = painted(base, script, source, context);
  return resolve_regions(listed, {base.position, base.faces, base.sharp, colour}, script.order);
}

bool takes_by_place(const EditScript& script) {
  return std::none_of(script.regions.begin(), script.regions.end(),
                      [](const EditRegion& r) { return r.shape == RegionShape::kPoints; });
}

}  // namespace tessera
