#include "stream/stages/weld/blunt_stage.h"

#include <algorithm>

#include "kernels/smooth/crease_blunting.h"
#include "stream/files/json.h"
#include "stream/points/plan.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/orient_sight.h"
#include "stream/stages/weld/blunt_reader.h"
#include "stream/stages/weld/border_moves.h"

namespace tessera {
namespace {

bool is_blunted(const ReconstructOptions& options, const Plan& plan) {
  return options.smooths_border() && plan.noise_cells > 0.0;
}

class BluntStage : public Stage {
 public:
  explicit BluntStage(const JobState& state)
      : work_(state.work),
        sparse_(Plan::of_work(state.work).is_sparse()),
        needed_(is_blunted(reconstruct_options(state), Plan::of_work(state.work)) &&
                (sparse_ || std::filesystem::exists(state.work / kSurfacePointFolder) ||
                 std::filesystem::exists(state.work / kRoomFile))),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {}

  std::string name() const override { return "blunt"; }
  std::size_t task_count() const override { return needed_ ? store_.file_count() : 0; }
  std::uint64_t units() const override { return needed_ ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return blunt_task_bytes(store_.patches().subspan(first, last - first));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    BluntReader reader(work_, store_, numbering_, sparse_);
    BorderMovesWriter writer(context.create(border_moves_file_name(task, kBluntFolder)));
    CreaseMesh mesh;
    std::vector<std::uint64_t> name;
    std::vector<MovedVertex> moves;
    std::uint64_t moved = 0;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      context.advance(1);
      if (numbering_.patches[p].kept_faces == 0 || !reader.gather(p, mesh, name)) continue;
      const auto own = std::lower_bound(name.begin(), name.end(), patch_vertex(p, 0)) - name.begin();
      const auto end = std::lower_bound(name.begin(), name.end(), patch_vertex(p + 1, 0)) - name.begin();
      const std::vector<Double3> before(mesh.position.begin() + own, mesh.position.begin() + end);
      blunt_creases(mesh);
      moves.clear();
      for (auto v = own; v < end; ++v) {
        const auto at = static_cast<std::size_t>(v);
        if (mesh.position[at] != before[static_cast<std::size_t>(v - own)])
          moves.push_back({static_cast<std::uint32_t>(name[at]), narrow(mesh.position[at])});
      }
      writer.add(store_.patches()[p].key, moves);
      moved += moves.size();
    }
    context.count_written(writer.finish());
    return {{"moved_vertices", moved}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"moved_vertices", 0}});
  }

 private:
  std::filesystem::path work_;
  bool sparse_;
  bool needed_;
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::uint64_t blunt_task_bytes(std::span<const PatchEntry> patches) {
  return BluntReader::bytes(patches) + (std::uint64_t{2} << 20);
}

std::unique_ptr<Stage> make_blunt_stage(const JobState& state) {
  return std::make_unique<BluntStage>(state);
}

namespace {

constexpr double kBluntTime = 0.4;  ///< microseconds a face: 0.25 and 0.6 of two field scans

}  // namespace

StageForecast forecast_blunt(const PlannedScan& scan) {
  if (!is_blunted(scan.options, scan.plan)) return idle_forecast();
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(blunt_task_bytes),
          .sure_bytes = blunt_task_bytes({}),
          .files = scan.groups.size(),
          .processor_us = scan.faces * kBluntTime};
}

}  // namespace tessera
