#include "stream/meshes/scene_file.h"

#include <array>
#include <filesystem>
#include <limits>
#include <vector>

#include "kernels/scene/mesh_scene.h"
#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/memory_budget.h"

namespace tessera {

bool is_mesh_scene(const std::string& name) {
  const std::string extension = std::filesystem::path(name).extension().string();
  return extension == ".ply" || is_mesh_extension(extension);
}

std::unique_ptr<synth::Scene> open_scene(const synth::SceneOptions& options, std::uint64_t memory_bytes) {
  if (!is_mesh_scene(options.name)) return synth::make_scene(options);
  const auto mesh = open_mesh_file(options.name);
  std::vector<Double3> vertices;
  std::vector<std::array<std::uint32_t, 3>> faces;
  const auto hold = [&] {
    const std::uint64_t bytes = synth::mesh_scene_bytes(vertices.size(), faces.size());
    if (bytes > memory_bytes)
      throw ResourceError(options.name + ": a scene is held in memory, and this mesh takes more than the " +
                          format_bytes(memory_bytes) + " of --memory; decimate it, or scan parts of it");
  };
  mesh->read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    vertices.insert(vertices.end(), batch.begin(), batch.end());
    hold();
  });
  if (vertices.size() > std::numeric_limits<std::uint32_t>::max())
    throw ResourceError(options.name + ": a scene has at most 2^32 vertices");
  mesh->read_faces([&](std::span<const MeshFace> batch) {
    for (const MeshFace& f : batch)
      faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                       static_cast<std::uint32_t>(f[2])});
    hold();
  });
  return synth::make_mesh_scene(options.name, std::move(vertices), std::move(faces));
}

}  // namespace tessera
