/// \file import_stages.h
/// A mesh file of any size and order becomes a store (mesh_store.h): "mesh to tiles".
///
///   read      measures, deals vertices out to buckets of bricks
///   vertices  sorts the vertices of each bucket and welds those of exactly the same position
///   corners   gives faces their new corners and deals them out: to the bucket of each corner
///   tiles     repairs each bucket (mesh_repair.h), writes its patches
///   repair    rewrites the patches of which another bucket knows more
///
/// Vertex keys are positions in Morton order of bricks, then of coordinates, times 65536, plus the copy of a
/// split vertex: whatever the order in the file, the same keys.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_repair.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/import/import_plan.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// On the first corner of a dealt face that closes a hole. Numbers of vertices stay below it.
inline constexpr std::uint32_t kSyntheticCorner = 0x80000000u;

inline constexpr int kVertexCopyBits = 16;  ///< low bits of a key of an imported vertex
inline std::uint64_t vertex_copy_key(std::uint32_t number, std::uint16_t copy) {
  return static_cast<std::uint64_t>(number) << kVertexCopyBits | copy;
}

/// A fix and the brick whose patch holds its face.
struct PlacedFix {
  std::uint64_t brick = 0;
  RepairFix fix;
  auto operator<=>(const PlacedFix&) const = default;
};
static_assert(sizeof(PlacedFix) == 24);

/// The stages that import one mesh, in order. Their names begin with "<folder>-".
std::vector<StageEntry> import_stages(const ImportSource& source);

/// The store that they leave.
MeshStore open_imported_mesh(const std::filesystem::path& work, const std::string& folder);

/// Of a finished job's report: format, vertices and faces of what was read, and how much of it was repaired, by kind.
Json import_report(const Json& report, const std::string& folder);

// What the stages share.

/// Names of files, relative to the work directory.
struct ImportNames {
  explicit ImportNames(const std::string& folder) : root(folder + "/") {}
  std::string root;
  std::string plan() const { return root + "import.json"; }
  std::string dealt_vertices() const { return root + "vertices.tsb"; }
  std::string vertices(std::size_t bucket) const;  ///< welded vertices of a bucket
  std::string numbers(std::size_t bucket) const;   ///< DealtNumber of a bucket
  std::string numbering() const { return root + "numbering.json"; }
  std::string dealt_faces() const { return root + "faces.tsb"; }
  std::string tiles(std::size_t bucket) const;
  std::string fixes(std::size_t bucket) const;
  std::string all_fixes() const { return root + "fixes.bin"; }
  std::string repaired(std::size_t bucket) const;
};

/// A vertex of the file and its place among the welded ones of its bucket.
struct DealtNumber {
  std::uint32_t in_file = 0;
  std::uint32_t in_bucket = 0;
};

/// Welded vertices of one bucket: by brick, then by coordinates.
struct BucketVertices {
  std::vector<std::uint64_t> brick;  ///< of each brick with vertices, ascending
  std::vector<std::uint32_t> first;  ///< its first vertex
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;  ///< empty without colour

  /// Returns bytes written.
  std::uint64_t save(const std::filesystem::path& path, const MeshStoreInfo& info) const;
  static BucketVertices load(const std::filesystem::path& path, const MeshStoreInfo& info);
};

/// All welded vertices, numbered through over all buckets.
class ImportedVertices {
 public:
  ImportedVertices(const std::filesystem::path& work, const std::string& folder);
  std::uint32_t first(std::size_t bucket) const { return first_[bucket]; }
  std::uint32_t count() const { return first_.back(); }
  std::size_t bucket_of(std::uint32_t number) const;
  BucketVertices load(std::size_t bucket) const;
  /// Positions and colours of single vertices, numbers ascending.
  void fetch(std::span<const std::uint32_t> numbers, std::vector<Double3>& position,
             std::vector<std::uint32_t>& rgba) const;
  const ImportPlan& plan() const { return plan_; }

 private:
  std::filesystem::path work_;
  ImportNames names_;
  ImportPlan plan_;
  std::vector<std::uint32_t> first_;  ///< per bucket, one more at the end
};

std::unique_ptr<Stage> make_import_read_stage(const JobState& state, const ImportSource& source);
std::unique_ptr<Stage> make_import_vertices_stage(const JobState& state, const ImportSource& source);
std::unique_ptr<Stage> make_import_corners_stage(const JobState& state, const ImportSource& source);
std::unique_ptr<Stage> make_import_tiles_stage(const JobState& state, const ImportSource& source);
std::unique_ptr<Stage> make_import_repair_stage(const JobState& state, const ImportSource& source);

}  // namespace tessera
