#include "stream/stages/decimate/simplify_stage.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <nlohmann/json.hpp>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/check/mesh_compare.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/failed_places.h"
#include "stream/runtime/idle_stage.h"
#include "stream/stages/decimate/round_before.h"
#include "stream/stages/decimate/unsettled_region.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kTaskFaces =
    1u << 20;  ///< of block and reference together: a task is worth a file from here
constexpr std::uint64_t kMostTasks = 400;

class SimplifyStage : public Stage {
 public:
  SimplifyStage(const JobState& state, const SimplifyOptions& options, const SimplifyStores& stores,
                const SimplifyPass& pass)
      : work_(state.work),
        options_(options),
        stores_(stores),
        pass_(pass),
        in_(open_pass_input(state, stores, pass)),
        reference_(stores.full(state)) {
    kernel_ = options_.kernel(!in_.info().double_positions);
    if (options_.tolerance > 0.0) require_provable(reference_, options_.tolerance);
    double radius = options_.tolerance;
    for (int round = pass_.round - 1; round >= 0; --round, radius *= 4.0)
      failed_.add(read_failed_faces(work_ / failed_faces_file(round)), radius);
    for (int round = 2; round <= pass_.round; ++round) careful_ *= 0.5;
    if (!pass_.count_costs && options_.target_faces > 0)
      kernel_.max_cost_class =
          json::parse(read_text(work_ / costs_file(pass.pass))).at("cost_class").get<std::uint32_t>();
    blocks_ = cut(in_);
    if (pass_.round > 0) open_round_before(state);
    std::uint64_t total = 0;
    for (const MeshBlockCut& block : blocks_) total += block.faces + block.weight;
    const std::uint64_t target = std::max(kTaskFaces, total / kMostTasks);
    std::uint64_t faces = target;
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      if (faces >= target) {
        first_.push_back(b);
        faces = 0;
      }
      faces += blocks_[b].faces + blocks_[b].weight;
    }
    first_.push_back(blocks_.size());
  }

  std::string name() const override { return pass_.stage_name(); }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return in_.face_count(); }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t most = 0;
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b) {
      std::vector<std::size_t> near;
      if (kernel_.tolerance > 0.0 && pass_.pass > 0) near = reference_.select(reference_box(blocks_[b]));
      std::uint64_t faces = 0;
      for (const std::size_t p : near) faces += reference_.patches()[p].faces;
      most = std::max(most,
                      simplify_task_bytes(in_.block_bytes(blocks_[b].patches) + reference_.block_bytes(near),
                                          blocks_[b].faces, faces, failed_.bytes()));
    }
    return most;
  }

  json run(std::size_t task, TaskContext& context) const override {
    json sum = json::object();
    std::vector<std::uint64_t> costs(kCostClasses, 0);
    std::unique_ptr<MeshFileWriter> writer;
    if (!pass_.count_costs)
      writer = std::make_unique<MeshFileWriter>(
          context.create(pass_.folder() + task_file_stem(task) + ".tmm"), in_.info());
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b) {
      context.check_stop();
      const MeshBlockCut& cut = blocks_[b];
      if (const MeshBlockCut* same = before_ ? before_->same(in_, cut, failed_) : nullptr) {
        const std::uint64_t faces = before_->copy(*same, *writer);
        add_counts(sum, {{"faces_in", cut.faces}, {"faces_out", faces}, {"blocks_kept", std::uint64_t{1}}});
        context.advance(cut.faces);
        continue;
      }
      MeshBlock block = in_.load(cut.patches);
      std::vector<std::uint64_t> held = failed_.keys_near(block, [&] { context.check_stop(); });
      DecimateOptions kernel = kernel_;
      if (!held.empty()) kernel.tolerance *= careful_;
      // In the first pass a block is the reference of its inside: its locked seams bound every collapse. Later
      // passes look where the one before had none.
      MeshBlock reference;
      if (kernel_.tolerance > 0.0 && pass_.pass > 0) {
        UnsettledRegion region = find_unsettled(block);
        if (!region.empty())
          reference = load_near_faces(reference_, block, region.near, 2.0 * kernel_.tolerance);
        std::vector<std::uint64_t> all;
        std::set_union(held.begin(), held.end(), region.settled_keys.begin(), region.settled_keys.end(),
                       std::back_inserter(all));
        held.swap(all);
      }
      const DecimateReport report = decimate(block, pass_.pass == 0 ? block : reference, kernel, held);
      for (std::size_t c = 0; c < kCostClasses; ++c) costs[c] += report.cost_histogram[c];
      add_counts(sum, to_json(report));
      if (writer) write_block(cut, in_.info().lattice, block, *writer);
      context.count_read(in_.block_bytes(cut.patches));
      context.advance(cut.faces);
    }
    if (writer) context.count_written(writer->finish());
    sum["blocks"] = first_[task + 1] - first_[task];
    if (pass_.count_costs) sum["costs"] = costs;
    return sum;
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{2} << 20; }

  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    json sum = json::object();
    for (const json& s : summaries) add_counts(sum, s);
    sum["tolerance"] = kernel_.tolerance;
    if (pass_.count_costs) {
      std::array<std::uint64_t, kCostClasses> costs{};
      for (const json& s : summaries)
        for (std::size_t c = 0; c < kCostClasses; ++c) costs[c] += s.at("costs")[c].get<std::uint64_t>();
      const std::uint32_t limit = cost_class_for(costs, in_.face_count(), options_.target_faces);
      sum["cost_class"] = limit;
      write_durably(context.create(costs_file(pass_.pass)), json{{"cost_class", limit}}.dump());
    }
    return sum;
  }

 private:
  static std::string costs_file(int pass) { return "costs-" + std::to_string(pass + 1) + ".json"; }

  std::vector<MeshBlockCut> cut(const MeshStore& store) const {
    if (pass_.pass == 0 && stores_.first_blocks) return stores_.first_blocks(store);
    return simplify_blocks(store, reference_, options_, pass_.pass);
  }

  void open_round_before(const JobState& state) {
    SimplifyPass before = pass_;
    --before.round;
    SimplifyPass next = before;
    ++next.pass;
    MeshStore in = open_pass_input(state, stores_, before);
    std::vector<MeshBlockCut> blocks = cut(in);
    before_.emplace(std::move(in), open_pass_input(state, stores_, next), std::move(blocks));
  }

  /// All that a collapse in the block may be measured against.
  MeshBox reference_box(const MeshBlockCut& cut) const {
    return grown(in_.box_of(cut.patches), 2.0 * kernel_.tolerance);
  }

  std::filesystem::path work_;
  SimplifyOptions options_;
  SimplifyStores stores_;
  SimplifyPass pass_;
  DecimateOptions kernel_;
  MeshStore in_;
  MeshStore reference_;
  std::vector<MeshBlockCut> blocks_;
  FailedPlaces failed_;
  double careful_ = 1.0;  ///< share of the tolerance in blocks with failed places
  std::optional<RoundBefore> before_;
  std::vector<std::size_t> first_;  ///< block index per task, one more at the end
};

}  // namespace

json to_json(const DecimateReport& r) {
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
          {"refused_by_tolerance", r.by_tolerance},
          {"exact_tests", r.exact_tests},
          {"bound", r.bound}};
}

void add_counts(json& sum, const json& part) {
  for (const auto& [key, value] : part.items()) {
    if (value.is_number_unsigned()) sum[key] = sum.value(key, std::uint64_t{0}) + value.get<std::uint64_t>();
    if (value.is_number_float()) sum[key] = std::max(sum.value(key, 0.0), value.get<double>());
    if (value.is_object()) add_counts(sum.emplace(key, json::object()).first.value(), value);
  }
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
  while (round + 1 < kMostRounds && std::filesystem::exists(work / failed_faces_file(round))) ++round;
  return round;
}

MeshStore open_pass_input(const JobState& state, const SimplifyStores& stores, const SimplifyPass& pass) {
  if (pass.pass == 0) return stores.full(state);
  if (pass.pass == 1 && pass.round == 0 && stores.after_first) return stores.after_first(state);
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
  return make_blocks(in, {options.block_faces, kReferenceBlocks * options.block_faces, pass_shift(pass)},
                     weight);
}

std::uint64_t simplify_task_bytes(std::uint64_t block_bytes, std::uint64_t faces,
                                  std::uint64_t reference_faces, std::uint64_t failed_bytes) {
  // What is loaded is merged from pieces, so it is there twice for a moment; then the kernel works on it.
  return block_bytes + decimate_bytes(faces, reference_faces) + failed_bytes + DirectFile::kDefaultBuffer +
         (std::uint64_t{4} << 20);
}

std::unique_ptr<Stage> make_simplify_stage(const JobState& state, const SimplifyOptions& options,
                                           const SimplifyStores& stores, const SimplifyPass& pass) {
  if (pass.round > last_round(state.work)) return make_idle_stage(pass.stage_name());
  return std::make_unique<SimplifyStage>(state, options, stores, pass);
}

}  // namespace tessera
