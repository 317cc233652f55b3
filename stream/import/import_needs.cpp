#include "stream/import/import_needs.h"

#include <algorithm>

#include "kernels/mesh/mesh_repair.h"
#include "stream/formats/meshes/mesh_arrays.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/import/import_bytes.h"
#include "stream/import/import_ranges.h"
#include "stream/meshes/parts_at_once.h"

namespace tessera {
namespace {

// The shortest lines and records that there are: of an OBJ's vertex and face with digits enough to be told apart.
constexpr std::uint64_t kTextVertexBytes = 24, kTextFaceBytes = 16;
constexpr std::uint64_t kMinBytes = 6;      ///< of any element
constexpr std::uint64_t kDealtBytes = 32;   ///< of a vertex on its way to its bucket
constexpr std::uint64_t kBucketMargin = 5;  ///< quarters, at most: cells are not cut

}  // namespace

MeshSize claimed_mesh_size(const std::filesystem::path& path) {
  if (const MeshArrays* given = given_arrays(path)) return {given->header().vertices, given->header().faces};
  const auto mesh = open_mesh_file(path);
  const std::uint64_t bytes = std::filesystem::file_size(path);
  MeshSize size{std::min(mesh->header().vertices, bytes / kMinBytes),
                std::min(mesh->header().faces, bytes / kMinBytes)};
  if (size.faces == 0) {  // two faces a vertex
    size.vertices = bytes / (kTextVertexBytes + 2 * kTextFaceBytes);
    size.faces = 2 * size.vertices;
  }
  if (!mesh->shared_vertices()) size.vertices = 3 * size.faces;
  return size;
}

std::vector<StageNeed> import_needs(const RunOptions& run, const ImportSource& source, const MeshSize& mesh) {
  const std::uint64_t target = std::max(ImportPlan::kBucketVertices, mesh.vertices / ImportPlan::kMaxBuckets);
  const auto vertices = [&](std::uint64_t bucket) {
    return std::max(import_vertices_task_bytes(std::min(mesh.vertices, bucket), kDealtBytes),
                    kImportVerticesFinishBytes);
  };
  const auto tiles = [&](std::uint64_t bucket) {
    const std::uint64_t dealt = std::min(mesh.vertices, bucket);
    const std::uint64_t faces = mesh.vertices == 0 ? 0 : mesh.faces * dealt / mesh.vertices;
    // Where every face brings its own three corners, they fall together.
    const std::uint64_t own = std::min(dealt, mesh.faces);
    return std::max(import_tiles_task_bytes(own, faces, repair_bytes(faces)), kImportTilesFinishBytes);
  };
  const auto named = [&](const char* stage) { return source.folder + stage; };
  const std::uint64_t maximum = target * kBucketMargin / 4;
  const auto in_ranges = [&](std::uint64_t bytes) { return max_bytes_at_once(run, bytes, kImportLaneBytes); };
  const std::uint64_t read = import_read_bytes(run), corners = import_corners_bytes(run, mesh.vertices);
  return {{named("-read"), read, in_ranges(read)},
          {named("-vertices"), vertices(target), vertices(maximum)},
          {named("-corners"), corners, in_ranges(corners)},
          {named("-tiles"), tiles(target), tiles(maximum)}};
}

std::vector<StageNeed> import_needs(const JobState& state, std::size_t inputs,
                                    const std::function<std::string(std::size_t)>& folder) {
  std::vector<StageNeed> needs;
  for (std::size_t i = 0; i < inputs; ++i)
    for (StageNeed& need : import_needs(state.run, {i, folder(i)}, claimed_mesh_size(state.inputs.at(i))))
      needs.push_back(std::move(need));
  return needs;
}

}  // namespace tessera
