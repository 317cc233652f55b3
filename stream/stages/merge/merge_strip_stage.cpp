/// Stage "strip" of a merge: the surface along the joints, brick by brick.
#include <algorithm>
#include <cmath>
#include <map>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/merge/blend_field.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/patch_mesh.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kTaskLeaves = 600;
constexpr double kFieldCells = 6.0;  ///< beyond MergeRange::apart: what nodes of a leaf may see
/// Between the strip and faces that stay: an edge of the gap is about a cell.
constexpr double kClearCells = 0.6;
/// Of the field at a vertex: farther away there is no surface, the field jumps.
constexpr double kOffCells = 0.3;
constexpr double kLateralCells = 0.25;         ///< how far the strip may reach beyond where all meshes end
constexpr std::uint64_t kPatchBytes = 24'000;  ///< per leaf, while it is extracted
constexpr std::uint64_t kTaskBytes = DirectFile::kDefaultBuffer + (std::uint64_t{2} << 20);
constexpr int kBrickLeaves = kBrickCells / kLeafCells;

/// Leaves that a brick's field consists of, from -1 to 8 along each axis.
struct StripBrick {
  Int3 brick{};
  std::vector<Int3> leaves;
};

class StripStage : public Stage {
 public:
  explicit StripStage(const JobState& state)
      : meshes_(state.work, true), kept_(open_merge_store(state.work, "kept")) {
    std::map<std::uint64_t, StripBrick> bricks;
    for (const std::uint64_t key : load_merge_list<std::uint64_t>(state.work / kLeavesFile, kLeavesKind)) {
      const Int3 leaf = merge_leaf(key);
      for (int d = 0; d < 27; ++d) {
        // The bricks that have the leaf in their field: its own, and those it lies beside.
        const Int3 side = {d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1};
        Int3 brick, local;
        bool has = true;
        for (std::size_t a = 0; a < 3; ++a) {
          brick[a] = (leaf[a] >> 3) + side[a];
          local[a] = leaf[a] - kBrickLeaves * brick[a];
          has = has && brick[a] >= 0 && local[a] >= -1 && local[a] <= kBrickLeaves;
        }
        if (!has) continue;
        StripBrick& b = bricks[brick_key(brick)];
        b.brick = brick;
        b.leaves.push_back(local);
      }
    }
    tasks_.emplace_back();
    std::size_t leaves = 0;
    for (auto& [key, brick] : bricks) {
      leaves += brick.leaves.size();
      all_leaves_ += brick.leaves.size();
      tasks_.back().push_back(std::move(brick));
      if (leaves < kTaskLeaves) continue;
      tasks_.emplace_back();
      leaves = 0;
    }
    if (tasks_.back().empty()) tasks_.pop_back();
  }

  std::string name() const override { return "strip"; }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return all_leaves_; }
  std::string unit_name() const override { return "leaves"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (const StripBrick& b : tasks_[task]) {
      const MeshBox box = box_of(b);
      std::uint64_t bytes = meshes_.near_bytes(box, margin()) + b.leaves.size() * kPatchBytes +
                            sampled_field_bytes(b.leaves.size());
      std::uint64_t vertices = 0, faces = 0;
      const std::vector<std::size_t> patches = kept_.select(box);
      for (const std::size_t p : patches)
        vertices += kept_.patches()[p].vertices, faces += kept_.patches()[p].faces;
      bytes += kept_.block_bytes(patches) + SignedDistance::bytes(vertices, faces);
      maximum = std::max(maximum, bytes);
    }
    return maximum + meshes_.shared_bytes() + 64 * all_leaves_ + kTaskBytes;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create("strip/" + task_file_stem(task) + ".tmm"), meshes_.plan().info);
    std::uint64_t made = 0, faces = 0;
    for (const StripBrick& b : tasks_[task]) {
      context.check_stop();
      const MergePlan& plan = meshes_.plan();
      const MeshBox box = box_of(b);
      const MergeMeshes::Near near = meshes_.load(box, margin());
      const MergeBlend blend(near.pointers(), plan.range);
      const BlendBlock block = {
          plan.lattice,
          plan.origin,
          {b.brick[0] * kBrickCells, b.brick[1] * kBrickCells, b.brick[2] * kBrickCells},
          {kBrickCells, kBrickCells, kBrickCells}};
      const DirectedField field =
          build_blend_field(block, b.leaves, blend, [&context] { context.check_stop(); });
      const MeshBlock rest = kept_.load_box(grown(box, plan.lattice.h));
      const ClosestFaces stay(rest.position, rest.faces, plan.origin);
      ExtractOptions options;
      options.names = true;
      extract_surface(field, options, [&](Patch&& patch) {
        MeshBlock mesh = make_mesh_block(patch, {plan.lattice, {0, 0, 0}, plan.info.double_positions, false});
        made += mesh.faces.size();
        mesh = trim(mesh, blend, stay, context);
        if (plan.info.colour) paint(mesh, blend, near);
        faces += mesh.faces.size();
        writer.add(brick_key(patch.brick), mesh);
      });
      context.advance(b.leaves.size());
    }
    context.count_written(writer.finish());
    return {{"made", made}, {"faces", faces}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    Json sum = {{"made", 0}, {"faces", 0}};
    for (const Json& s : summaries)
      for (const auto& [key, value] : s.items())
        sum[key] = sum[key].get<std::uint64_t>() + value.get<std::uint64_t>();
    return sum;
  }
  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < meshes_.count(); ++i) names.push_back(merge_import(i) + "/");
    return names;
  }

 private:
  double margin() const { return meshes_.plan().range.apart + kFieldCells * meshes_.plan().lattice.h; }

  MeshBox box_of(const StripBrick& b) const {
    MeshBox box;
    for (std::size_t a = 0; a < 3; ++a) {
      int low = kBrickLeaves, high = -1;
      for (const Int3& leaf : b.leaves) low = std::min(low, leaf[a]), high = std::max(high, leaf[a]);
      const int first = b.brick[a] * kBrickCells;
      box.low[a] = meshes_.plan().lattice.world(static_cast<int>(a), first + std::max(-1, 8 * low));
      box.high[a] = meshes_.plan().lattice.world(static_cast<int>(a),
                                                 first + std::min(kBrickCells + 1, 8 * (high + 1)));
    }
    return box;
  }

  /// Faces all of whose vertices are on the surface, where data are, and clear of what stays.
  MeshBlock trim(const MeshBlock& mesh, const MergeBlend& blend, const ClosestFaces& stay,
                 TaskContext& context) const {
    const MergePlan& plan = meshes_.plan();
    const double h = plan.lattice.h, clear = kClearCells * h;
    std::vector<std::uint8_t> good(mesh.position.size());
    for (std::size_t v = 0; v < good.size(); ++v) {
      if (v % 1024 == 0) context.check_stop();
      const Double3 p = mesh.position[v] - plan.origin;
      const MergeBlend::Value value = blend.at(p, kFieldCells * h);
      good[v] =
          value.share > 0.0 && std::fabs(value.distance) <= kOffCells * h &&
          value.lateral <= kLateralCells * h &&
          (stay.empty() || stay.closest(p, clear * clear, ClosestFaces::kNone).slot == ClosestFaces::kNone);
    }
    std::vector<std::uint8_t> keep(mesh.faces.size());
    for (std::size_t f = 0; f < keep.size(); ++f)
      keep[f] = good[mesh.faces[f][0]] && good[mesh.faces[f][1]] && good[mesh.faces[f][2]];
    return select_faces(mesh, keep);
  }

  /// Every vertex has the colour of the nearest one of the mesh that counts most there.
  void paint(MeshBlock& mesh, const MergeBlend& blend, const MergeMeshes::Near& near) const {
    mesh.rgba.clear();
    for (const Double3& p : mesh.position) {
      const auto [rank, vertex] =
          blend.main_vertex(p - meshes_.plan().origin, kFieldCells * meshes_.plan().lattice.h);
      const bool known = vertex != SignedDistance::kNone && !near.rgba[rank].empty();
      mesh.rgba.push_back(known ? near.rgba[rank][vertex] : 0);
    }
  }

  MergeMeshes meshes_;
  MeshStore kept_;
  std::vector<std::vector<StripBrick>> tasks_;
  std::uint64_t all_leaves_ = 0;
};

}  // namespace

std::uint64_t merge_strip_bytes(std::uint64_t leaves, std::uint64_t near_bytes, std::uint64_t kept_bytes) {
  return near_bytes + kept_bytes + leaves * kPatchBytes + sampled_field_bytes(leaves) + kTaskBytes;
}

std::unique_ptr<Stage> make_merge_strip_stage(const JobState& state) {
  return std::make_unique<StripStage>(state);
}

}  // namespace tessera
