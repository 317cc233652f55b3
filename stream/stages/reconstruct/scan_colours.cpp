#include "stream/stages/reconstruct/scan_colours.h"

#include <utility>

#include "octree/error.h"
#include "stream/formats/points/quantise.h"
#include "stream/points/plan.h"
#include "stream/points/point_inputs.h"
#include "stream/stages/scan/point_colours.h"

namespace tessera {
namespace {

/// A pass inside a stage that counts other units.
class UncountedContext : public TaskContext {
 public:
  explicit UncountedContext(TaskContext& outer) : outer_(outer) {}
  std::filesystem::path create(const std::string& name) override { return outer_.create(name); }
  void check_stop() const override { outer_.check_stop(); }
  void advance(std::uint64_t) override {}
  void count_read(std::uint64_t bytes) override { outer_.count_read(bytes); }
  void count_written(std::uint64_t bytes) override { outer_.count_written(bytes); }

 private:
  TaskContext& outer_;
};

class JobColours : public BakeColours {
 public:
  explicit JobColours(const JobState& state)
      : inputs_(open_packed_inputs(state, false)),
        plan_(Plan::of_work(state.work)),
        by_(colour_by(reconstruct_options(state).colour)) {}
  void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) override {
    UncountedContext uncounted(context);
    ChunkQuanta quanta;
    std::vector<std::uint32_t> rgba;
    for (std::size_t task = 0; task < inputs_->task_count(); ++task)
      inputs_->read(task, uncounted, true, [&](std::uint32_t, const PointChunk& chunk) {
        quanta.compute(chunk, plan_.lattice.h);
        colour_points(by_, plan_, chunk, quanta.z, rgba);
        for (std::size_t i = 0; i < chunk.size(); ++i)
          if (quanta.disposition[i] == PointClass::kGood && rgba[i] != 0)
            sink(Double3{chunk.x[i], chunk.y[i], chunk.z[i]} - shift, rgba[i] & 0xffffffu, {});
      });
  }
  std::uint64_t bytes() const override { return PointInputs::kReadBytes + (std::uint64_t{4} << 20); }

 private:
  std::shared_ptr<const PointInputs> inputs_;
  Plan plan_;
  ColourBy by_;
};

}  // namespace

std::unique_ptr<BakeColours> colours_of_job(const JobState& state) {
  return std::make_unique<JobColours>(state);
}

void require_colours(const JobState& state) {
  const auto inputs = open_packed_inputs(state, false);
  if (!has_point_colours(colour_by(reconstruct_options(state).colour), *inputs))
    throw InputError(state.inputs.front().string() +
                     ": its points have no colours, so there is nothing for --texture to show");
}

}  // namespace tessera
