#include <algorithm>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/stages/smooth/smooth_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kRangePatches = 64;  ///< patches of one task

class RangeStage : public Stage {
 public:
  RangeStage(const JobState& state, const SmoothPlan& plan) : store_(open_smoothed(state, plan, 0)) {}

  std::string name() const override { return "reach"; }
  std::size_t task_count() const override {
    return (store_.patches().size() + kRangePatches - 1) / kRangePatches;
  }
  std::uint64_t task_bytes(std::size_t) const override {
    return 2 * store_.largest_patch_bytes() + kTileSlackBytes;
  }
  std::uint64_t units() const override { return store_.patches().size(); }
  std::string unit_name() const override { return "patches"; }

  Json run(std::size_t task, TaskContext& context) const override {
    Json edges = Json::array();
    const std::size_t last = std::min(store_.patches().size(), (task + 1) * kRangePatches);
    for (std::size_t p = task * kRangePatches; p < last; ++p) {
      context.check_stop();
      const PatchEdges found = edges_of(store_.load({&p, 1}));
      edges.push_back({p, found.longest, found.squares});
      context.advance(1);
    }
    return {{"edges", std::move(edges)}};
  }
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (store_.face_count() == 0) throw EmptyError("the mesh has no face to smooth");
    range_of(summaries, store_.patches().size()).save(context.create(range_file(0)));
    return {{"patches", store_.patches().size()}, {"faces", store_.face_count()}};
  }
  std::uint64_t finish_bytes() const override { return kTileSlackBytes + 500 * store_.patches().size(); }

 private:
  MeshStore store_;
};

}  // namespace

std::unique_ptr<Stage> make_range_stage(const JobState& state, const SmoothPlan& plan) {
  return std::make_unique<RangeStage>(state, plan);
}

}  // namespace tessera
