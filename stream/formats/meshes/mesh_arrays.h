/// \file mesh_arrays.h
/// Meshes in the caller's memory where a job has files: open_mesh_file() and create_mesh_file() find them under the names that the
/// job's scope gives them (files/job_scope.h), so that no stage knows the difference. Nothing that is given is copied.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <variant>
#include <vector>

#include "octree/vector.h"
#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

/// Three numbers of vertices for each face, of the type that the caller has.
template <class Index>
using FaceSpan = std::span<const std::array<Index, 3>>;
using FaceRows = std::variant<FaceSpan<std::uint32_t>, FaceSpan<std::int32_t>, FaceSpan<std::uint64_t>,
                              FaceSpan<std::int64_t>>;

/// A mesh that the caller keeps as it is until the job is done.
class MeshArrays {
 public:
  /// Looks at every number once. \throws InputError for a face that names no vertex
  MeshArrays(std::span<const Double3> vertices, FaceRows faces);
  /// `double_positions` as a file of them would have it: floats where these lose nothing.
  [[nodiscard]] const MeshHeader& header() const { return header_; }
  /// \pre the arrays outlive it
  [[nodiscard]] std::unique_ptr<MeshReader> open() const;

 private:
  std::span<const Double3> vertices_;
  FaceRows faces_;
  MeshHeader header_;
};

/// What a job made, in memory: as its PLY would be read.
struct MadeMesh {
  std::vector<Double3> vertices;
  std::vector<MeshFace> faces;
};

/// Replaces what is in `made`; colours and flags are dropped. \pre `made` outlives it
[[nodiscard]] std::unique_ptr<MeshWriter> collect_mesh(MadeMesh& made, const MeshHeader& header);

/// What stands for this name in the job of this thread; null where it is a file.
[[nodiscard]] const MeshArrays* given_arrays(const std::filesystem::path& input);
[[nodiscard]] MadeMesh* made_arrays(const std::filesystem::path& output);

}  // namespace tessera
