/// \file merge_stages.h
/// The stages of a merge, out of core (kernels/merge has the rules):
///
///   scale   faces -> how long edges are, ranks, lattice of the strip
///   joints  border edges of a mesh that another one passes
///   cover   faces -> those that stay, those near a cut, leaves of the lattice where the strip is made
///   strip   bricks -> field of all meshes, surface, what of it is free of those that stay
///   zip     strip and cut borders -> triangles between them; holds what lies along the joints, not the meshes
///
/// Every patch and brick is worked on for itself, from what lies around it: tasks carry no meaning.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "kernels/merge/merge_sheet.h"
#include "stream/files/packed_file.h"
#include "stream/import/import_needs.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"
#include "stream/stages/merge/merge_job.h"

namespace tessera {

/// What "scale" decided.
struct MergePlan {
  static constexpr const char* kFile = "merge/plan.json";
  Lattice lattice;   ///< of the strip
  Double3 origin{};  ///< of all distances
  MergeRange range;
  MeshStoreInfo info;              ///< of what is written
  std::vector<std::size_t> order;  ///< input by rank
  std::vector<double> edge;        ///< per rank: mean length
  std::vector<double> fade;        ///< per rank

  static void fields(auto& self, auto&& field) {
    field("h", self.lattice.h);
    field("origin_brick", self.lattice.origin_brick);
    field("origin", self.origin);
    field("apart", self.range.apart);
    field("beyond", self.range.beyond);
    field("double_positions", self.info.double_positions);
    field("colour", self.info.colour);
    field("shift", self.info.shift);
    field("order", self.order);
    field("edge", self.edge);
    field("fade", self.fade);
  }
  void save(const std::filesystem::path& path) const;
  static MergePlan of_work(const std::filesystem::path& work);
};

/// A border edge that another mesh passes.
struct JointEdge {
  std::uint64_t rank = 0;
  Double3 a{}, b{};
  auto operator<=>(const JointEdge&) const = default;
};
inline constexpr const char* kJointsFile = "merge/joints.bin";
inline constexpr PackedKind kJointsKind = {"TSJOINT1", "a file of joints"};
inline constexpr const char* kLeavesFile = "merge/leaves.bin";
inline constexpr PackedKind kLeavesKind = {"TSLEAVE1", "a file of leaves"};

template <class Record>
std::vector<Record> load_merge_list(const std::filesystem::path& path, const PackedKind& kind) {
  const PackedFile file(path, kind, sizeof(Section));
  std::vector<Record> all;
  for (const Section& section : file.table<Section>()) {
    const std::vector<Record> part = file.load<Record>(section);
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

std::string merge_import(std::size_t input);  ///< folder of an imported input: "mesh-0"

/// Some patches of one mesh.
struct MergeTask {
  std::size_t rank = 0;
  std::size_t first = 0, end = 0;
};

/// All meshes of the job, by rank.
class MergeMeshes {
 public:
  /// \param joints  whether to load what "joints" found
  MergeMeshes(const std::filesystem::path& work, bool joints);

  const MergePlan& plan() const { return plan_; }
  std::size_t count() const { return stores_.size(); }
  const MeshStore& store(std::size_t rank) const { return stores_[rank]; }
  std::vector<MergeTask> tasks() const;
  std::uint64_t face_count() const;  ///< of all of them

  /// Whether a mesh other than `rank` comes near a box.
  bool is_alone(std::size_t rank, const MeshBox& box) const;
  /// What meshes are near a box.
  struct Near {
    std::vector<std::unique_ptr<MergeSheet>> sheets;  ///< per rank, null where nothing is
    std::vector<std::vector<std::uint32_t>> rgba;     ///< per rank and vertex, empty without colours
    std::vector<const MergeSheet*> pointers() const;
  };
  /// \param margin  around the box  \param block  if not null: of rank `own`, taken as it is
  Near load(const MeshBox& box, double margin, std::size_t own = ~std::size_t{0},
            const MeshBlock* block = nullptr) const;
  std::uint64_t near_bytes(const MeshBox& box, double margin) const;
  std::uint64_t shared_bytes() const { return joints_.size() * sizeof(JointEdge); }
  const std::vector<JointEdge>& joints() const { return joints_; }

 private:
  MergePlan plan_;
  std::vector<MeshStore> stores_;
  std::vector<JointEdge> joints_;
};

/// What stages share that look at every face of every mesh: a task takes some patches of one of them.
class MergeFacesStage : public Stage {
 public:
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return meshes_.face_count(); }
  std::string unit_name() const override { return "faces"; }

 protected:
  MergeFacesStage(const JobState& state, bool joints)
      : state_(state), meshes_(state.work, joints), tasks_(meshes_.tasks()) {}

  JobState state_;
  MergeMeshes meshes_;
  std::vector<MergeTask> tasks_;
};

/// Keys in the merged mesh: vertices of inputs and of the strip, bricks of inputs and of the strip.
constexpr std::uint64_t merged_vertex(std::size_t rank, std::uint64_t key) {
  return (static_cast<std::uint64_t>(rank) + 1) << 48 | key;
}
constexpr std::uint64_t merged_brick(std::size_t rank, std::uint64_t key) {
  return (static_cast<std::uint64_t>(rank) + 1) << 44 | key;
}
inline constexpr std::size_t kMaxMerged = 4000;
inline constexpr std::size_t kStripRank = 0xffe;  ///< in keys: behind all inputs

/// How many cells of the lattice around a face of the band the strip may pass, beside half of MergeRange::apart.
inline constexpr double kStripCells = 2.0;

constexpr std::uint64_t merge_leaf_key(const Int3& leaf) {
  return static_cast<std::uint64_t>(leaf[2]) << 40 | static_cast<std::uint64_t>(leaf[1]) << 20 |
         static_cast<std::uint64_t>(leaf[0]);
}
constexpr Int3 merge_leaf(std::uint64_t key) {
  return {static_cast<std::int32_t>(key & 0xfffff), static_cast<std::int32_t>(key >> 20 & 0xfffff),
          static_cast<std::int32_t>(key >> 40)};
}

/// Stores by what stages leave: "kept", "rims", "strip"; and the merged mesh.
MeshStore open_merge_store(const std::filesystem::path& work, const std::string& folder);
MeshStore open_merged_mesh(const std::filesystem::path& work);

// What stages take, told before the meshes are read: a patch, and what lies around it of all meshes (merge_near_bytes()).
std::uint64_t merge_near_bytes(const MeshSize& near);
std::uint64_t merge_joints_bytes(const RunOptions& run, std::uint64_t patch_bytes, std::uint64_t near_bytes);
std::uint64_t merge_cover_bytes(const RunOptions& run, const MeshSize& patch, std::uint64_t near_bytes);
/// \param leaves  of the strip in a brick   \param kept_bytes  of what stays there, as merge_near_bytes()
std::uint64_t merge_strip_bytes(std::uint64_t leaves, std::uint64_t near_bytes, std::uint64_t kept_bytes);
/// \param strip  with the faces near cuts, all of them
std::uint64_t merge_zip_bytes(const MeshSize& strip, std::uint64_t patch_bytes);

std::unique_ptr<Stage> make_merge_scale_stage(const JobState& state, const MergeOptions& options);
std::unique_ptr<Stage> make_merge_joints_stage(const JobState& state);
std::unique_ptr<Stage> make_merge_cover_stage(const JobState& state);
std::unique_ptr<Stage> make_merge_strip_stage(const JobState& state);
std::unique_ptr<Stage> make_merge_zip_stage(const JobState& state);

}  // namespace tessera
