#include "stream/stages/decimate/simplify_stage.h"

#include <algorithm>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/serial_stage.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/pass_blocks.h"
#include "stream/stages/decimate/unsettled_region.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTaskFaces =
    1u << 18;  ///< of block and reference together: a task is worth a file from here

class SimplifyStage : public Stage {
 public:
  SimplifyStage(const JobState& state, const SimplifyOptions& options, const SimplifyStores& stores,
                const SimplifyPass& pass)
      : options_(options),
        pass_(pass),
        blocks_(state, stores, pass,
                {options.tolerance, options.tolerance, kTaskFaces,
                 [&](const MeshStore& in, const MeshStore& reference) {
                   if (pass.pass == 0 && stores.ran_first(state)) return stores.first_blocks(in);
                   return simplify_blocks(in, reference, options, pass.pass);
                 }}),
        in_(blocks_.in()),
        reference_(blocks_.reference()) {
    kernel_ = options_.kernel(!in_.info().double_positions);
    largest_bytes_ = largest_guess_bytes(state.run.memory_bytes);
    if (!pass_.count_costs && options_.target_faces > 0)
      kernel_.max_cost_class =
          parse_json(read_text(state.work / costs_file(pass.pass))).at("cost_class").get<std::uint32_t>();
  }

  std::string name() const override { return pass_.stage_name(); }
  std::size_t task_count() const override { return blocks_.task_count(); }
  std::uint64_t units() const override { return in_.face_count(); }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = blocks_.first(task); b < blocks_.end(task); ++b) {
      std::vector<std::size_t> near;
      if (kernel_.tolerance > 0.0 && pass_.pass > 0) near = reference_.select(reference_box(blocks_[b]));
      std::uint64_t faces = 0;
      for (const std::size_t p : near) faces += reference_.patches()[p].faces;
      const auto needed = [&](std::uint64_t reference_bytes, std::uint64_t reference_faces) {
        return simplify_task_bytes(in_.block_bytes(blocks_[b].patches) + reference_bytes, blocks_[b].faces,
                                   reference_faces, blocks_.failed_bytes());
      };
      // What the table tells is far above what is near as a rule: run() looks before it loads more than this.
      maximum = std::max(
          {maximum, needed(0, 0), std::min(needed(reference_.block_bytes(near), faces), largest_bytes_)});
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    Json sum = Json::object();
    std::vector<std::uint64_t> costs(kCostClasses, 0);
    std::unique_ptr<MeshFileWriter> writer;
    if (!pass_.count_costs)
      writer = std::make_unique<MeshFileWriter>(
          context.create(pass_.folder() + task_file_stem(task) + ".tmm"), in_.info());
    const std::uint64_t available = task_bytes(task);
    for (std::size_t b = blocks_.first(task); b < blocks_.end(task); ++b) {
      context.check_stop();
      const MeshBlockCut& cut = blocks_[b];
      if (blocks_.copy_unchanged(cut, writer.get(), sum, context)) continue;
      MeshBlock block = in_.load(cut.patches);
      std::vector<std::uint64_t> pinned = blocks_.pinned_keys(block, context);
      DecimateOptions kernel = kernel_;
      if (!pinned.empty()) kernel.tolerance *= blocks_.careful();
      // In the first pass a block is the reference of its inside: its locked seams bound every collapse. Later
      // passes look where the one before had none.
      MeshBlock reference;
      if (kernel_.tolerance > 0.0 && pass_.pass > 0) {
        ActiveRegion region = find_active(block);
        if (!region.empty()) reference = load_reference(cut, block, region.near, available);
        std::vector<std::uint64_t> all;
        std::set_union(pinned.begin(), pinned.end(), region.done_keys.begin(), region.done_keys.end(),
                       std::back_inserter(all));
        pinned.swap(all);
      }
      const DecimateReport report = decimate(block, pass_.pass == 0 ? block : reference, kernel, pinned);
      for (std::size_t c = 0; c < kCostClasses; ++c) costs[c] += report.cost_histogram[c];
      add_counts(sum, to_json(report));
      if (writer) write_block(cut, in_.info().lattice, block, *writer);
      context.count_read(in_.block_bytes(cut.patches));
      context.advance(cut.faces);
    }
    if (writer) context.count_written(writer->finish());
    sum["blocks"] = blocks_.end(task) - blocks_.first(task);
    if (pass_.count_costs) sum["costs"] = costs;
    return sum;
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{2} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    Json sum = sum_counts(summaries);
    sum["tolerance"] = kernel_.tolerance;
    if (pass_.count_costs) {
      std::array<std::uint64_t, kCostClasses> costs{};
      for (const Json& s : summaries)
        for (std::size_t c = 0; c < kCostClasses; ++c) costs[c] += s.at("costs")[c].get<std::uint64_t>();
      const std::uint32_t limit = cost_class_for(costs, in_.face_count(), options_.target_faces);
      sum["cost_class"] = limit;
      write_text(context.create(costs_file(pass_.pass)), dump_json(Json{{"cost_class", limit}}));
    }
    return sum;
  }

 private:
  static std::string costs_file(int pass) { return "costs-" + std::to_string(pass + 1) + ".json"; }

  /// All that a collapse in the block may be measured against.
  MeshBox reference_box(const MeshBlockCut& cut) const {
    return grown(in_.box_of(cut.patches), 2.0 * kernel_.tolerance);
  }

  /// \param bytes  what the task may hold
  MeshBlock load_reference(const MeshBlockCut& cut, const MeshBlock& block,
                           const std::vector<std::uint8_t>& marked, std::uint64_t bytes) const {
    NearFaceLoader near(reference_, block, marked, 2.0 * kernel_.tolerance);
    near.require_fits(
        [&](std::uint64_t reference_bytes, std::uint64_t faces) {
          return simplify_task_bytes(in_.block_bytes(cut.patches) + reference_bytes, cut.faces, faces,
                                     blocks_.failed_bytes());
        },
        bytes, name());
    return near.load();
  }

  SimplifyOptions options_;
  SimplifyPass pass_;
  DecimateOptions kernel_;
  std::uint64_t largest_bytes_ = 0;  ///< of the cap, for one task
  PassBlocks blocks_;
  const MeshStore& in_;
  const MeshStore& reference_;
};

}  // namespace

Json to_json(const DecimateReport& r) {
  return {{"faces_in", r.faces_in},
          {"faces_out", r.faces_out},
          {"locked_vertices", r.locked_vertices},
          {"flat_faces_mended", r.flat_faces},
          {"collapses", r.collapses},
          {"candidates", r.candidates},
          {"refused_by_link", r.by_link},
          {"refused_by_fold", r.by_fold},
          {"refused_by_shape", r.by_shape},
          {"refused_by_normal", r.by_normal},
          {"refused_by_colour", r.by_colour},
          {"refused_by_tolerance", r.by_tolerance},
          {"refused_by_crossing", r.by_crossing},
          {"exact_tests", r.exact_tests},
          {"bound", r.bound},
          {"colour_tolerance", r.colour_tolerance},
          {"kept_for_colour", r.kept_for_colour}};
}

std::string SimplifyPass::stage_name() const {
  const std::string name = (count_costs ? "costs-" : "pass-") + std::to_string(pass + 1);
  return round == 0 ? name : "again-" + std::to_string(round) + "-" + name;
}

std::string SimplifyPass::folder() const {
  return stage_name() + "/";
}

std::string failed_faces_file(int round) {
  return "failed-" + std::to_string(round) + ".bin";
}

int last_round(const std::filesystem::path& work) {
  int round = 0;
  while (round + 1 < kMaxRounds && std::filesystem::exists(work / failed_faces_file(round))) ++round;
  return round;
}

MeshStore open_pass_input(const JobState& state, const SimplifyStores& stores, const SimplifyPass& pass) {
  if (pass.pass == 0) return stores.full(state);
  if (pass.pass == 1 && pass.round == 0 && stores.ran_first(state)) return stores.after_first(state);
  const SimplifyPass before{pass.pass - 1, pass.round, false};
  return MeshStore(list_task_files(state.work / before.folder(), ".tmm"));
}

std::vector<MeshBlockCut> simplify_blocks(const MeshStore& in, const MeshStore& reference,
                                          const SimplifyOptions& options, int pass) {
  // Bricks keep their places from pass to pass, so each knows about how much reference it stands for.
  std::vector<std::uint64_t> weight;
  for (const MeshPatchEntry& e : in.patches()) {
    const std::int64_t there = reference.find(e.key);
    weight.push_back(there < 0 ? 0 : reference.patches()[static_cast<std::size_t>(there)].faces);
  }
  return make_blocks(
      in, {options.block_faces, kReferenceBlocks * options.block_faces, pass_shift(pass), true}, weight);
}

std::uint64_t simplify_task_bytes(std::uint64_t block_bytes, std::uint64_t faces,
                                  std::uint64_t reference_faces, std::uint64_t failed_bytes) {
  // What is loaded is merged from pieces, so it is there twice for a moment; then the kernel works on it.
  return block_bytes + decimate_bytes(faces, reference_faces) + failed_bytes + DirectFile::kDefaultBuffer +
         (std::uint64_t{4} << 20);
}

std::unique_ptr<Stage> make_simplify_stage(const JobState& state, const SimplifyOptions& options,
                                           const SimplifyStores& stores, const SimplifyPass& pass) {
  const bool ran = pass.pass == 0 && pass.round == 0 && stores.ran_first(state);
  if (ran || pass.round > last_round(state.work)) return make_idle_stage(pass.stage_name());
  return std::make_unique<SimplifyStage>(state, options, stores, pass);
}

}  // namespace tessera
