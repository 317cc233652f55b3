#include "stream/parameterize_mesh.h"

#include <chrono>

#include "octree/error.h"
#include "stream/formats/uv_mesh_writer.h"
#include "stream/memory_budget.h"
#include "stream/mesh_weld.h"

namespace tessera {
namespace {

/// Positions and faces; Laplacian, system and its split before the factor: measured on disks of 10^4 to 10^6
/// vertices.
constexpr std::uint64_t kBytesPerVertex = 1100;

struct LoadedMesh {
  MeshHeader header;
  std::vector<Double3> positions;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

LoadedMesh load(const std::filesystem::path& input, const std::filesystem::path& output, std::uint64_t memory,
                const std::function<void()>& stop) {
  const auto source = open_mesh_file(input);
  std::unique_ptr<WeldedMesh> welded;
  if (!source->shared_vertices())
    welded = std::make_unique<WeldedMesh>(
        *source, WeldOptions{memory / 4, output.has_parent_path() ? output.parent_path() : ".", stop});
  MeshReader& reader = welded ? *welded : *source;
  LoadedMesh mesh;
  mesh.header = reader.header();
  reader.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    if (stop) stop();
    const std::uint64_t need = (mesh.positions.size() + batch.size()) * kBytesPerVertex;
    if (need > memory)
      throw ResourceError(input.string() + ": has more vertices than " + format_bytes(memory) +
                          " can hold with the linear system (" + std::to_string(kBytesPerVertex) +
                          " bytes a vertex and the factor): give a larger --memory, or decimate the mesh");
    mesh.positions.insert(mesh.positions.end(), batch.begin(), batch.end());
  });
  reader.read_faces([&](std::span<const MeshFace> batch) {
    if (stop) stop();
    for (const MeshFace& f : batch)
      mesh.faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                            static_cast<std::uint32_t>(f[2])});
  });
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
  const LoadedMesh mesh = load(input, output, memory, options.check_stop);
  const auto loaded = Clock::now();
  ParameterizeOptions map = options.map;
  map.memory_bytes = memory - mesh.positions.size() * kBytesPerVertex;
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
