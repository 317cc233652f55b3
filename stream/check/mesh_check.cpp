#include "stream/check/mesh_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "octree/error.h"
#include "octree/vector.h"
#include "stream/check/mesh_shape.h"
#include "stream/check/mesh_topology.h"
#include "stream/files/json.h"
#include "stream/formats/vertex_store.h"
#include "stream/meshes/mesh_weld.h"

namespace tessera {
namespace {

constexpr std::uint64_t kOwnBytes = std::uint64_t{8}
                                    << 20;  // histogram, scratch around a vertex, allocator slack
constexpr std::uint64_t kSlots = 65536;     // resolution at which ranges of vertices are chosen

/// Shares of the cap. A range and its neighbours in time never exceed it together.
struct Shares {
  explicit Shares(std::uint64_t cap) {
    const std::uint64_t work = cap > 2 * kOwnBytes ? cap - kOwnBytes : cap / 2;
    vertices = work / 10;
    spill = work / 5;
    range = work / 4;
    links = work / 3;
    chunks = work / 12;
  }
  std::uint64_t vertices, spill, range, links, chunks;
};

void read_vertices(MeshReader& mesh, const MeshCheckOptions& options, VertexStore& store, MeshCheck& check) {
  constexpr double kHuge = std::numeric_limits<double>::infinity();
  check.min = {kHuge, kHuge, kHuge};
  check.max = {-kHuge, -kHuge, -kHuge};
  mesh.read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t>) {
    if (options.check_stop) options.check_stop();
    store.append(positions);
    for (const Double3& p : positions) {
      if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) {
        ++check.nonfinite_vertices;
        continue;
      }
      for (std::size_t axis = 0; axis < 3; ++axis) {
        check.min[axis] = std::min(check.min[axis], p[axis]);
        check.max[axis] = std::max(check.max[axis], p[axis]);
      }
    }
  });
  check.vertices = store.size();
  if (check.nonfinite_vertices == check.vertices) check.min = check.max = {0, 0, 0};
}

/// Ranges of vertices that fit the share, from a histogram of corners.
TopologyPlan plan_ranges(MeshReader& mesh, const MeshCheckOptions& options, std::uint64_t vertices,
                         const Shares& shares) {
  const bool wide = vertices > 0xffffffffULL;
  int shift = 0;
  while ((vertices >> shift) >= kSlots) ++shift;
  std::vector<std::uint64_t> corners((vertices >> shift) + 1, 0);
  mesh.read_faces([&](std::span<const MeshFace> faces) {
    if (options.check_stop) options.check_stop();
    for (const MeshFace& face : faces) {
      for (const std::uint64_t v : face) {
        if (v < vertices) ++corners[v >> shift];
      }
    }
  });
  TopologyPlan plan;
  plan.bounds = {0};
  std::uint64_t in_range = 0;
  for (std::uint64_t slot = 0; slot < corners.size(); ++slot) {
    const std::uint64_t begin = slot << shift;
    const std::uint64_t end = std::min(vertices, (slot + 1) << shift);
    const std::uint64_t together =
        topology_range_bytes(end - plan.bounds.back(), in_range + corners[slot], wide);
    if (together > shares.range && begin > plan.bounds.back()) {
      plan.bounds.push_back(begin);
      in_range = 0;
    }
    const std::uint64_t alone = topology_range_bytes(end - begin, corners[slot], wide);
    if (alone > shares.range) {
      const std::uint64_t wanted = alone / std::max<std::uint64_t>(1, shares.range) * options.memory_bytes;
      throw ResourceError("the mesh check cannot hold the " + std::to_string(corners[slot] / 3) +
                          " faces around vertices " + std::to_string(begin) + " to " +
                          std::to_string(end - 1) + " at once; raise --memory to " +
                          std::to_string((wanted >> 20) + 64) + "M");
    }
    in_range += corners[slot];
  }
  if (plan.bounds.back() < vertices || plan.bounds.size() == 1) plan.bounds.push_back(vertices);
  constexpr std::uint64_t kKinds = 5;  // SpillBuckets of a topology
  plan.chunk_bytes =
      std::clamp<std::uint64_t>(shares.chunks / (kKinds * (plan.bounds.size() - 1)), 512, 1u << 18);
  plan.link_bytes = shares.links;
  return plan;
}

}  // namespace

MeshCheck check_mesh(MeshReader& source, const MeshCheckOptions& options) {
  MeshCheck check;
  check.format = source.format();
  check.declared_vertices = source.header().vertices;
  check.declared_faces = source.header().faces;
  check.welded = options.weld || !source.shared_vertices() || source.split_vertices();
  std::unique_ptr<WeldedMesh> welded;
  if (check.welded) {
    welded = std::make_unique<WeldedMesh>(
        source, WeldOptions{options.memory_bytes, options.temp, options.check_stop});
  }
  MeshReader& mesh = check.welded ? *welded : source;

  // A welded mesh keeps a quarter of the cap for itself.
  const std::uint64_t own = check.welded ? options.memory_bytes / 4 * 3 : options.memory_bytes;
  const std::uint64_t quality_bytes = options.quality ? own / 3 : 0;
  const Shares shares(own - quality_bytes);
  VertexStore positions(options.temp, mesh.header().double_positions, shares.vertices);
  read_vertices(mesh, options, positions, check);
  check.file_vertices = check.welded ? welded->source_vertices() : check.vertices;

  std::optional<SpillPool> pool(std::in_place, options.temp, shares.spill);
  auto topology = make_mesh_topology(plan_ranges(mesh, options, check.vertices, shares), *pool);
  std::vector<MeshFace> sound;
  mesh.read_faces([&](std::span<const MeshFace> faces) {
    if (options.check_stop) options.check_stop();
    sound.clear();
    for (const MeshFace& face : faces) {
      if (std::max({face[0], face[1], face[2]}) < check.vertices) sound.push_back(face);
    }
    check.faces += faces.size();
    check.bad_index_faces += faces.size() - sound.size();
    topology->add(sound);
  });
  MeshShape shape(check.min, check.max);
  const std::uint64_t memory = shares.spill + shares.range + shares.links + shares.chunks;
  std::optional<MeshQualityPass> quality;
  if (options.quality && shape.usable()) {
    quality.emplace(
        check.faces, (check.min + check.max) * 0.5,
        MeshQualityOptions{quality_bytes, memory, options.temp, options.threads, options.check_stop});
    shape.pass_to(*quality);
  }
  topology->analyse(positions, shape, options.check_stop, check);
  shape.store(check);
  topology.reset();  // its memory is theirs now
  pool.reset();
  if (quality && check.has_shape)
    check.quality = quality->finish(check.area, check.solid() && check.volume < 0.0);
  quality.reset();
  if (options.cleanliness)
    check.cleanliness = measure_cleanliness(mesh, positions, {memory, options.temp, options.check_stop});
  if (options.crossings) {
    check.crossings =
        find_crossings(mesh, positions, {memory, options.temp, options.threads, options.check_stop, {}});
  }
  return check;
}

}  // namespace tessera
