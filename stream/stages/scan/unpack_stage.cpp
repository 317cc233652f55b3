#include "stream/stages/scan/unpack_stage.h"

#include <algorithm>
#include <span>

#include "stream/files/json.h"
#include "stream/formats/points/grid_stream.h"
#include "stream/points/cubes.h"
#include "stream/points/unpacked_points.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/task_counts.h"

namespace tessera {
namespace {

/// Bytes of what the pass leaves, by the headers.
std::uint64_t unpacked_bytes(const PointInputs& inputs) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < inputs.file_count(); ++i) {
    const PointFileInfo& info = inputs.file(i).info();
    if (!info.packed && inputs.thin_buckets() == 0) continue;
    const PointAttributes& has = info.attributes;
    sum += info.credible_points() *
           ((info.grid.known() ? 12 : 24) + (has.normals ? 12 : 0) + (has.sensor ? 2 : 0) +
            (has.echo ? sizeof(Echo) : 0) + (has.colour ? 4 : 0) + (has.intensity_16 ? 2 : 0));
  }
  return sum;
}

class UnpackStage : public Stage {
 public:
  UnpackStage(const JobState& job, std::shared_ptr<const PointInputs> inputs)
      : job_(job), inputs_(std::move(inputs)) {
    const std::filesystem::path folder = job_.work / "unpacked";
    const std::uint64_t all = unpacked_bytes(*inputs_);
    const DiskNeed need = {job_.work, all - std::min(all, bytes_below(folder)),
                           "unpacking in " + job_.work.string()};
    require_disk(std::span(&need, 1), kLargerDisk);
  }
  std::string name() const override { return "unpack"; }
  std::size_t task_count() const override { return inputs_->has_packed() ? inputs_->task_count() : 0; }
  std::uint64_t units() const override { return task_count() > 0 ? inputs_->bytes() : 0; }
  std::string unit_name() const override { return "bytes"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    return inputs_->is_packed(task) ? PointInputs::kReadBytes + UnpackedWriter::kBytes +
                                          cube_dealer_bytes(inputs_->thin_buckets()) +
                                          (inputs_->has_grid_normals() ? GridStream::kBytes : 0)
                                    : kLittle;
  }
  std::uint64_t finish_bytes() const override { return kLittle; }

  Json run(std::size_t task, TaskContext& context) const override {
    if (!inputs_->is_packed(task)) {
      context.advance(inputs_->task_input_bytes(task));
      return {{"points", 0}, {"bytes", 0}};
    }
    UnpackedWriter out(context.create(PointInputs::unpacked_file(task)));
    CubeDealer dealer(reconstruct_options(job_).thin, inputs_->thin_buckets());
    const auto add = [&](std::uint32_t file, std::uint32_t bucket, const PointChunk& chunk) {
      out.add(file, inputs_->file(file).info().grid, chunk, bucket);
    };
    const ReadCounts counts =
        inputs_->read(task, context, true, [&](std::uint32_t file, const PointChunk& chunk) {
          if (inputs_->thin_buckets() > 0)
            dealer.deal(file, chunk, add);
          else
            add(file, 0, chunk);
        });
    dealer.finish(add);
    const std::uint64_t bytes = out.finish(counts);
    context.count_written(bytes);
    return {{"points", counts.points}, {"bytes", bytes}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    if (summaries.empty()) return {{"skipped", "no input is packed, none is thinned"}};
    return sum_counts(summaries);
  }

 private:
  static constexpr std::uint64_t kLittle = std::uint64_t{1} << 20;
  JobState job_;
  std::shared_ptr<const PointInputs> inputs_;
};

}  // namespace

std::unique_ptr<Stage> make_unpack_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs) {
  return std::make_unique<UnpackStage>(job, std::move(inputs));
}
std::unique_ptr<Stage> make_unpack_stage(const JobState& job) {
  return make_unpack_stage(job, open_packed_inputs(job, false));
}

}  // namespace tessera
