#include "stream/stages/weld/uncross_stage.h"

#include "stream/files/json.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/weld/near_faces.h"

namespace tessera {
namespace {

class UncrossStage : public Stage {
 public:
  UncrossStage(const JobState& state, int round, const WrittenBy& written)
      : work_(state.work),
        round_(round),
        written_(written(state)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)),
        needed_(round == 0 || any_returned(state.work, round - 1)) {}

  std::string name() const override { return "uncross-" + std::to_string(round_ + 1); }
  std::size_t task_count() const override { return needed_ ? store_.file_count() : 0; }
  std::uint64_t units() const override { return needed_ ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return uncross_task_bytes(store_.patches().subspan(first, last - first));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    NearFaces near(work_, store_, numbering_, round_, written_, rims_);
    std::vector<std::uint64_t> back;
    std::uint64_t pairs = 0;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      context.advance(1);
      if (numbering_.patches[p].kept_faces == 0) continue;
      for (const Int3& brick : bricks_of(p)) pairs += near.find_crossings(brick, back);
    }
    if (round_ + 1 == kUncrossRounds) back.clear();
    context.count_written(save_returned(context.create(returned_file_name(round_, task)), std::move(back)));
    return {{"crossing_pairs", pairs}, {"torn_bricks", near.torn_bricks()}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    Json sum = sum_counts(summaries, {{"crossing_pairs", 0}, {"torn_bricks", 0}});
    const auto left = sum.at("crossing_pairs").get<std::uint64_t>();
    if (round_ + 1 == kUncrossRounds && left > 0)
      sum["warnings"] = {
          std::to_string(left) +
          " pairs of faces still cross, overlap or touch: `tessera check --crossings` lists them"};
    return sum;
  }

 private:
  /// The brick of a patch, and those without a patch of which it is the first around: faces may reach into them.
  std::vector<Int3> bricks_of(std::size_t patch) const {
    const Int3 here = brick_of_key(store_.patches()[patch].key);
    std::vector<Int3> bricks;
    for (int d = 0; d < 27; ++d) {
      const Int3 n = {here[0] + d % 3 - 1, here[1] + d / 3 % 3 - 1, here[2] + d / 9 - 1};
      if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
      const std::int64_t there = store_.find(brick_key(n));
      const bool kept = there >= 0 && numbering_.patches[static_cast<std::size_t>(there)].kept_faces > 0;
      if (n == here || (!kept && kept_patches_around(store_, numbering_, n).front() == patch))
        bricks.push_back(n);
    }
    return bricks;
  }

  std::filesystem::path work_;
  int round_;
  WrittenPositions written_;
  PatchStore store_;
  Numbering numbering_;
  bool needed_;
  mutable PatchRims rims_;
};

}  // namespace

std::uint64_t uncross_task_bytes(std::span<const PatchEntry> patches) {
  return NearFaces::bytes(patches) + (std::uint64_t{2} << 20);
}

namespace {

constexpr double kUncrossTime = 0.2;  ///< microseconds a face, of scans that are mostly borders

StageForecast forecast_uncross(const PlannedScan& scan, int round) {
  return {
      .tasks = scan.groups.size(),
      .task_bytes = scan.patches.max_of_tasks(uncross_task_bytes),
      .sure_bytes = uncross_task_bytes({}),
      .files = scan.groups.size(),
      .processor_us = round == 0 ? scan.faces * kUncrossTime : 0.0};  // only the first looks at all bricks
}

}  // namespace

std::vector<StageEntry> uncross_stages(const WrittenBy& written) {
  std::vector<StageEntry> stages;
  for (int round = 0; round < kUncrossRounds; ++round)
    stages.push_back({"uncross-" + std::to_string(round + 1),
                      [round, written](const JobState& state) {
                        return std::make_unique<UncrossStage>(state, round, written);
                      },
                      [round](const PlannedScan& scan) { return forecast_uncross(scan, round); }});
  return stages;
}

}  // namespace tessera
