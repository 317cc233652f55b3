#include "stream/stages/reconstruct/scan_colours.h"

#include <utility>

#include "octree/error.h"
#include "stream/formats/points/quantise.h"
#include "stream/points/plan.h"
#include "stream/points/point_inputs.h"
#include "stream/stages/scan/point_colours.h"

namespace tessera {
namespace {

class JobColours : public BakeColours {
 public:
  explicit JobColours(const JobState& state)
      : inputs_(open_packed_inputs(state, false)),
        plan_(Plan::of_work(state.work)),
        by_(colour_by(reconstruct_options(state).colour)) {}
  void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) override {
    ChunkQuanta quanta;
    std::vector<std::uint32_t> rgba;
    for (std::size_t task = 0; task < inputs_->task_count(); ++task)
      inputs_->read(task, context, false, [&](std::uint32_t, const PointChunk& chunk) {
        quanta.compute(chunk, plan_.lattice.h);
        colour_points(by_, plan_, chunk, quanta.z, rgba);
        for (std::size_t i = 0; i < chunk.size(); ++i)
          if (quanta.disposition[i] == PointClass::kGood && rgba[i] != 0)
            sink(Double3{chunk.x[i], chunk.y[i], chunk.z[i]} - shift, rgba[i] & 0xffffffu, {});
      });
  }
  std::uint64_t units() const override { return plan_.dispositions.read; }
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
