#include "stream/stages/smooth/untangle_stages.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/smooth/tangled_tile.h"
#include "stream/stages/smooth/vertices_back.h"

namespace tessera {
namespace {

const std::string kUntangled = "untangle";
constexpr std::size_t kPatchesPerTask = 64;
/// From this round on what lies around goes back as well: else tangles walk on.
constexpr int kWideRound = 6;

std::string round_name(int round) {
  return kUntangled + "-" + std::to_string(round);
}

bool untangles(const SmoothPlan& plan) {
  return !plan.rounds.empty() && !plan.keep_crossings;
}

MeshStore smoothed_store(const JobState& state, const SmoothPlan& plan) {
  return open_smoothed(state, plan, plan.rounds.size());
}

/// What a round left, or several.
std::vector<std::filesystem::path> found_files(const JobState& state, int round) {
  return list_task_files(state.work / round_name(round), ".back");
}
VerticesBack found_in_rounds(const JobState& state, int rounds) {
  std::vector<std::vector<std::filesystem::path>> files;
  for (int round = 1; round <= rounds; ++round) files.push_back(found_files(state, round));
  return VerticesBack(files);
}

/// Patches of the store that may hold a vertex of the last round.
std::vector<std::uint8_t> patches_with_last(const MeshStore& store, const VerticesBack& back) {
  std::vector<std::uint8_t> with(store.patches().size(), 0);
  for (const Double3& p : back.last())
    for (const std::size_t patch : store.select({p, p})) with[patch] = 1;
  return with;
}

class UntangleStage : public Stage {
 public:
  UntangleStage(const JobState& state, const SmoothPlan& plan, int round)
      : round_(round),
        smoothed_(smoothed_store(state, plan)),
        given_(plan.mesh(state)),
        back_(found_in_rounds(state, round - 1)) {
    if (round > 1 && back_.last().empty()) return;
    const double move = longest_move(state.work, plan.rounds.size());
    // What meets now and did not in the round before has vertices that went back then.
    const PatchRange range = load_range(state.work, 0);
    regions_ = round > 1
                   ? ContactRegions(smoothed_, back_.last(), range, move, round >= kWideRound)
                   : ContactRegions(list_task_files(state.work / smooth_folder(plan.rounds.size()), ".met"));
    SmoothTiling tiling;
    tiling.rings = 0;
    // Vertices that went back may come near from so far away.
    tiling.range = round > 1 ? TangledTile::reach(move) : 0.0;
    tiling.tile_bricks = state.run.tile_cells / kBrickCells;
    tiling.tile_bytes = state.run.memory_bytes * 13 / 16 / static_cast<std::uint64_t>(state.run.threads);
    tiling.bytes = [bytes = back_.bytes() + regions_.bytes()](std::uint64_t vertices, std::uint64_t faces) {
      return untangle_tile_bytes(vertices, faces) + bytes;
    };
    tasks_ = make_smooth_tasks(smoothed_, range, tiling, regions_.patches(smoothed_));
    for (const SmoothTask& task : tasks_)
      for (const SmoothTile& tile : task)
        for (const std::size_t p : tile.patches) faces_ += smoothed_.patches()[p].faces;
  }

  std::string name() const override { return round_name(round_); }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return faces_; }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override { return tessera::task_bytes(tasks_[task]); }

  Json run(std::size_t task, TaskContext& context) const override {
    std::vector<VertexBack> found;
    std::uint64_t pairs = 0;
    for (const SmoothTile& tile : tasks_[task]) {
      context.check_stop();
      pairs += TangledTile(smoothed_, given_, tile, back_, regions_).find(round_ >= kWideRound, found);
      for (const std::size_t p : tile.patches) context.advance(smoothed_.patches()[p].faces);
    }
    if (round_ == kUntangleRounds) found.clear();
    context.count_written(
        VerticesBack::save(context.create(round_name(round_) + "/" + task_file_stem(task) + ".back"), found));
    return {{"pairs", pairs}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    std::uint64_t pairs = 0;
    for (const Json& s : summaries) pairs += s.at("pairs").get<std::uint64_t>();
    Json out = {{"crossing_pairs", pairs}};
    if (round_ == kUntangleRounds && pairs > 0)
      out["warnings"].push_back(
          std::to_string(pairs) +
          " pairs of faces came to cross, overlap or touch that did not as given, and going back did not "
          "part them: `tessera check --crossings` lists them");
    return out;
  }

 private:
  int round_;
  MeshStore smoothed_, given_;
  VerticesBack back_;
  ContactRegions regions_;
  std::uint64_t faces_ = 0;
  std::vector<SmoothTask> tasks_;
};

/// Writes the patches of which vertices go back.
class UntangledStage : public Stage {
 public:
  UntangledStage(const JobState& state, const SmoothPlan& plan)
      : mesh_folder_(plan.mesh_folder),
        smoothed_(smoothed_store(state, plan)),
        given_(plan.mesh(state)),
        back_(found_in_rounds(state, kUntangleRounds)) {
    std::vector<std::uint8_t> with(smoothed_.patches().size(), 0);
    for (int round = 1; round <= kUntangleRounds; ++round) {
      const std::vector<std::uint8_t> some =
          patches_with_last(smoothed_, VerticesBack({found_files(state, round)}));
      for (std::size_t p = 0; p < with.size(); ++p) with[p] |= some[p];
    }
    for (std::size_t p = 0; p < with.size(); ++p)
      if (with[p] != 0) patches_.push_back(p);
  }

  std::string name() const override { return kUntangled; }
  std::size_t task_count() const override {
    return (patches_.size() + kPatchesPerTask - 1) / kPatchesPerTask;
  }
  std::uint64_t units() const override { return patches_.size(); }
  std::string unit_name() const override { return "patches"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return 12 * smoothed_.largest_patch_bytes() + back_.bytes() + kTileSlackBytes;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create(kUntangled + "/" + task_file_stem(task) + ".tmm"), smoothed_.info());
    std::uint64_t returned = 0;
    double change = 0.0;
    const std::size_t end = std::min(patches_.size(), (task + 1) * kPatchesPerTask);
    for (std::size_t i = task * kPatchesPerTask; i < end; ++i) {
      context.check_stop();
      context.advance(1);
      const std::size_t p = patches_[i];
      MeshBlock patch = smoothed_.load({&p, 1});
      const MeshBlock given = given_.load({&p, 1});
      const auto moved = back_.apply(patch, !smoothed_.info().double_positions);
      if (moved.empty()) continue;
      writer.add_moved(smoothed_, p, patch.position);
      const std::vector<std::uint8_t> own = first_here(p);
      for (const auto& [v, before] : moved) {
        if (own[v] == 0) continue;
        ++returned;
        change += squared_distance(patch.position[v], given.position[v]) -
                  squared_distance(before, given.position[v]);
      }
    }
    context.count_written(writer.finish());
    return {{"vertices", returned}, {"square_change", change}};
  }

  std::uint64_t finish_bytes() const override { return kTileSlackBytes; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    std::uint64_t returned = 0;
    double change = 0.0;
    for (const Json& s : summaries) {
      returned += s.at("vertices").get<std::uint64_t>();
      change += s.at("square_change").get<double>();
    }
    return {{"taken_back", returned}, {"square_change", change}};
  }

  std::vector<std::string> obsolete() const override {
    return mesh_folder_.empty() ? std::vector<std::string>{} : std::vector<std::string>{mesh_folder_};
  }

 private:
  /// Per vertex of a patch: no patch before it has it.
  std::vector<std::uint8_t> first_here(std::size_t p) const {
    const MeshHaloBlock near = smoothed_.load_near({&p, 1}, 0.0);
    std::vector<std::uint8_t> first;
    for (const std::uint32_t v : near.core_vertices.at(0)) first.push_back(near.first_patch[v] == p);
    return first;
  }

  std::string mesh_folder_;
  MeshStore smoothed_, given_;
  VerticesBack back_;
  std::vector<std::size_t> patches_;  ///< that may have vertices that go back
};

}  // namespace

std::vector<StageEntry> untangle_stages(const SmoothPlanner& plan) {
  std::vector<StageEntry> stages;
  for (int round = 1; round <= kUntangleRounds; ++round)
    stages.push_back({round_name(round), [=](const JobState& state) -> std::unique_ptr<Stage> {
                        const SmoothPlan now = plan(state);
                        if (!untangles(now)) return make_idle_stage(round_name(round));
                        return std::make_unique<UntangleStage>(state, now, round);
                      }});
  stages.push_back({kUntangled, [=](const JobState& state) -> std::unique_ptr<Stage> {
                      const SmoothPlan now = plan(state);
                      if (!untangles(now)) return make_idle_stage(kUntangled);
                      return std::make_unique<UntangledStage>(state, now);
                    }});
  return stages;
}

MeshStore open_untangled(const JobState& state, const SmoothPlan& plan) {
  if (!untangles(plan)) return open_smoothed(state, plan, plan.rounds.size());
  return MeshStore(list_task_files(state.work / smooth_folder(plan.rounds.size()), ".tmm"),
                   list_task_files(state.work / kUntangled, ".tmm"));
}

void add_untangling(const Json& result, Json& moved) {
  if (result.contains("crossing_pairs")) {
    if (!moved.contains("crossing_pairs_found")) moved["crossing_pairs_found"] = result.at("crossing_pairs");
    moved["crossing_pairs"] = result.at("crossing_pairs");
  }
  if (!result.contains("taken_back")) return;
  moved["taken_back"] = result.at("taken_back");
  const auto vertices = static_cast<double>(moved.at("vertices").get<std::uint64_t>());
  const double rms = moved.at("rms_move").get<double>();
  if (vertices > 0.0)
    moved["rms_move"] =
        std::sqrt(std::max(0.0, rms * rms + result.at("square_change").get<double>() / vertices));
}

std::vector<StageNeed> untangle_needs(const MeshSize& mesh, std::uint64_t patch_vertices) {
  const auto tile = [&](std::uint64_t vertices) {
    return untangle_tile_bytes(vertices, std::min(mesh.faces, 2 * vertices));
  };
  // A patch, and all that may lie around it. Vertices at seams are in every patch.
  const std::uint64_t patch = std::min(mesh.vertices, patch_vertices);
  const std::uint64_t around = std::min(27 * patch, mesh.vertices + mesh.vertices / 4);
  std::vector<StageNeed> needs;
  for (int round = 1; round <= kUntangleRounds; ++round)
    needs.push_back({round_name(round), tile(patch), std::max(tile(patch), tile(around))});
  needs.push_back({kUntangled, 12 * MeshStore::block_bytes(patch, 2 * patch) + kTileSlackBytes, 0});
  needs.back().likely = needs.back().sure;
  return needs;
}

std::uint64_t untangle_tile_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return TangledTile::bytes(vertices, faces) + kTileSlackBytes;
}

}  // namespace tessera
