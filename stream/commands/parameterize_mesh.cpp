#include "stream/commands/parameterize_mesh.h"

#include <algorithm>
#include <chrono>

#include "octree/error.h"
#include "stream/formats/meshes/uv_mesh_writer.h"
#include "stream/meshes/mesh_weld.h"
#include "stream/runtime/memory_budget.h"

namespace tessera {
namespace {

/// Bytes a vertex of the mesh in memory: its position and two faces.
constexpr std::uint64_t kMeshBytes = 48;
/// The program and its buffers.
constexpr std::uint64_t kProcessBytes = 12'000'000;

std::uint64_t min_bytes(std::uint64_t vertices, ParameterMethod method) {
  return kProcessBytes + vertices * kMeshBytes + parameterize_bytes(vertices, method);
}

struct LoadedMesh {
  MeshHeader header;
  std::vector<Double3> positions;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

LoadedMesh load(const std::filesystem::path& input, const std::filesystem::path& output, std::uint64_t memory,
                ParameterMethod method, const std::function<void()>& stop) {
  const auto source = open_mesh_file(input);
  std::unique_ptr<WeldedMesh> welded;
  if (!source->shared_vertices() || source->split_vertices())
    welded = std::make_unique<WeldedMesh>(
        *source, WeldOptions{memory / 4, output.has_parent_path() ? output.parent_path() : ".", stop});
  MeshReader& reader = welded ? *welded : *source;
  LoadedMesh mesh;
  mesh.header = reader.header();
  reader.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    if (stop) stop();
    const std::uint64_t vertices = mesh.positions.size() + batch.size();
    if (min_bytes(vertices, method) > memory) {
      const std::uint64_t all = std::max<std::uint64_t>(vertices, mesh.header.vertices);
      throw ResourceError(input.string() + ": a map of " + std::to_string(all) + " vertices needs " +
                          format_bytes(min_bytes(all, method)) + ", allowed are " + format_bytes(memory) +
                          ": give a larger --memory, or decimate the mesh");
    }
    mesh.positions.insert(mesh.positions.end(), batch.begin(), batch.end());
  });
  reader.read_faces([&](std::span<const MeshFace> batch) {
    if (stop) stop();
    for (const MeshFace& f : batch)
      mesh.faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                            static_cast<std::uint32_t>(f[2])});
  });
  mesh.positions.shrink_to_fit();
  mesh.faces.shrink_to_fit();
  mesh.header.vertices = mesh.positions.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.colour = false;
  return mesh;
}

}  // namespace

ParameterizeMeshReport parameterize_mesh(const std::filesystem::path& input,
                                         const std::filesystem::path& output,
                                         const ParameterizeMeshOptions& options) {
  require_uv_extension(output);
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double>(to - from).count();
  };
  const std::uint64_t memory = options.memory_bytes > 0 ? options.memory_bytes : detect_memory_cap().bytes;
  const auto start = Clock::now();
  const LoadedMesh mesh = load(input, output, memory, options.map.method, options.check_stop);
  const auto loaded = Clock::now();
  ParameterizeOptions map = options.map;
  map.memory_bytes = memory - kProcessBytes - mesh.positions.size() * kMeshBytes;
  Parameterization result;
  try {
    result = parameterize({mesh.positions, mesh.faces}, map);
  } catch (const InputError& e) {
    throw InputError(input.string() + ": " + e.what());
  } catch (const ResourceError& e) {
    throw ResourceError(input.string() + ": " + e.what());
  }
  const auto mapped = Clock::now();
  if (options.check_stop) options.check_stop();
  write_uv_mesh(output, mesh.header, mesh.positions, result.uv, mesh.faces);
  return {mesh.positions.size(),         mesh.faces.size(), seconds(start, loaded), seconds(loaded, mapped),
          seconds(mapped, Clock::now()), result.report};
}

}  // namespace tessera
