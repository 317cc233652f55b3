#include "stream/stages/deform/deform_crossings.h"

#include <memory>
#include <string>

#include "octree/error.h"
#include "stream/check/mesh_crossings.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"
#include "stream/meshes/mesh_weld.h"

namespace tessera {
namespace {

MeshCrossings crossings_of_file(const std::filesystem::path& path, const DeformCrossingOptions& options) {
  const auto source = open_mesh_file(path);
  std::unique_ptr<WeldedMesh> welded;
  if (!source->shared_vertices())
    welded = std::make_unique<WeldedMesh>(
        *source, WeldOptions{options.memory_bytes / 4, options.temp, options.check_stop});
  MeshReader& mesh = welded ? *welded : *source;
  VertexStore positions(options.temp, mesh.header().double_positions, options.memory_bytes / 4);
  mesh.read_vertices([&](std::span<const Double3> some, std::span<const std::uint32_t>) {
    if (options.check_stop) options.check_stop();
    positions.append(some);
  });
  return find_crossings(mesh, positions,
                        {options.memory_bytes / 2, options.temp, options.threads, options.check_stop, {}});
}

}  // namespace

void add_deform_crossings(Json& result, const std::filesystem::path& before,
                          const std::filesystem::path& after, const DeformCrossingOptions& options) {
  try {
    const MeshCrossings was = crossings_of_file(before, options), is = crossings_of_file(after, options);
    result["crossings"] = {
        {"before", {{"cross", was.crossing}, {"overlap", was.overlapping}, {"touch", was.touching}}},
        {"after", to_json(is)}};
    if (is.pairs() > was.pairs())
      result["warnings"].push_back(
          "the edit makes faces meet that did not: " + std::to_string(is.pairs()) +
          " pairs cross, overlap or touch, " + std::to_string(was.pairs()) +
          " did before; the report lists where: a wider support, or less motion, folds less");
  } catch (const ResourceError& error) {
    result["warnings"].push_back(std::string("faces that cross were not counted: ") + error.what());
  }
}

}  // namespace tessera
