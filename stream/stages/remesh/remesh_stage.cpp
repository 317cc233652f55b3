#include "stream/stages/remesh/remesh_stage.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/remesh/sizing_field.h"
#include "kernels/remesh/triangle_quality.h"
#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/task_files.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/serial_stage.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/pass_blocks.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/decimate/unsettled_region.h"
#include "stream/stages/remesh/quality_report.h"
#include "stream/stages/remesh/remesh_region.h"
#include "stream/stages/remesh/remesh_verdict.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTaskFaces = 1u << 17;  ///< of block and weight: a task is worth a file from here
/// Splits come before collapses, so a block has more faces for a while than it will have.
constexpr std::uint64_t kCapacityFactor = 3, kMinCapacity = 4096;
/// So many times the faces, of a block without seams that ran out of room, are needles, cut into pieces as long as they are wide.
constexpr double kNeedleTimesFaces = 9.0 * RemeshVerdict::kMostTimesFaces;
/// So many times the faces it takes for no later step to bring them below what is refused.
constexpr double kEndTimesFaces = 1.5;
/// Edges get longer as long as a round leaves no more than this share of what the one before left.
constexpr double kWorthWhile = 0.95;
/// What creases keep grows less than the square of the length tells.
constexpr double kLongerStill = 1.02;
/// Edges: as far as vertices may have their feet around a block, and farther than a crease must go on to be one.
constexpr double kHaloEdges = 4.0;

/// Keys of new vertices: above those of imported ones, apart for every block of every pass of every round.
std::uint64_t first_new_key(const SimplifyPass& pass, std::size_t block) {
  constexpr int kBlockBits = 26;
  if (block >> kBlockBits) throw ResourceError("remeshing: more blocks than vertices can be named after");
  return std::uint64_t{1} << 63 | static_cast<std::uint64_t>(pass.round) << 61 |
         static_cast<std::uint64_t>(pass.pass) << 58 | static_cast<std::uint64_t>(block) << 32;
}

class RemeshStage : public Stage {
 public:
  RemeshStage(const JobState& state, const RemeshJobOptions& options, const SimplifyStores& stores,
              const SimplifyPass& pass)
      : options_(options),
        pass_(pass),
        sizing_(Sizing::of_work(state.work, pass.round)),
        verdict_(options_, sizing_.edge),
        blocks_(state, stores, pass,
                {options.tolerance,
                 std::max(options.tolerance, 0.25 * (options.adaptive ? sizing_.shortest : sizing_.edge)),
                 kTaskFaces,
                 [&](const MeshStore& in, const MeshStore& reference) {
                   return remesh_blocks(in, reference, options, sizing_, pass.pass);
                 },
                 first_round_of_size(state.work, pass.round)}),
        in_(blocks_.in()),
        reference_(blocks_.reference()) {
    kernel_ = options_.kernel(sizing_.edge, sizing_.shortest, sizing_.fine, !in_.info().double_positions);
    kernel_.find_creases = pass_.pass == 0;
    if (raises()) kernel_.min_angle_deg = options_.min_angle_deg;
    if (evens()) {
      kernel_.max_length_ratio = RemeshJobOptions::kMaxLengthRatio;
      kernel_.kept_angle_deg = std::max(kernel_.kept_angle_deg, options_.min_angle_deg);
    }
    sharp_above_ = std::pow(cosine_of_degrees(options_.min_angle_deg), 2.0);
    if (options_.keeps_faces()) {
      // A round that leaves far more is done anew or refused, and the end of a pass takes some away.
      const auto times = [&](double most) {
        return options_.faces + RemeshVerdict::kAlwaysMoreFaces +
               static_cast<std::uint64_t>((kEndTimesFaces * most - 1.0) *
                                          static_cast<double>(options_.faces));
      };
      kernel_.useless_faces = times(RemeshVerdict::kMostTimesFaces);
      if (pass_.pass == 0 && is_first_coarse()) kernel_.hopeless_faces = times(kNeedleTimesFaces);
    }
    largest_bytes_ = largest_guess_bytes(state.run.memory_bytes);
  }

  std::string name() const override { return pass_.stage_name(); }
  std::size_t task_count() const override { return blocks_.task_count(); }
  std::uint64_t units() const override { return in_.face_count(); }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = blocks_.first(task); b < blocks_.end(task); ++b) {
      const std::vector<std::size_t> near = reference_.select(reference_box(blocks_[b]));
      std::uint64_t faces = 0;
      for (const std::size_t p : near) faces += reference_.patches()[p].faces;
      // What the table tells is far above what is near as a rule: run() looks before it loads more than this.
      maximum = std::max({maximum, needed(blocks_[b], 0, 0),
                          std::min(needed(blocks_[b], reference_.block_bytes(near), faces), largest_bytes_)});
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    Json sum = Json::object();
    TriangleQuality quality;
    MeshFileWriter writer(context.create(pass_.folder() + task_file_stem(task) + ".tmm"), in_.info());
    const std::uint64_t available = task_bytes(task);
    for (std::size_t b = blocks_.first(task); b < blocks_.end(task); ++b) {
      context.check_stop();
      const MeshBlockCut& cut = blocks_[b];
      MeshBlock block;
      if (blocks_.copy_unchanged(cut, &writer, sum, context, is_last() ? &block : nullptr)) {
        judge_block(block, quality, sum);
        continue;
      }
      block = in_.load(cut.patches);
      add_counts(sum, remesh_block(b, block, available, context));
      judge_block(block, quality, sum);
      write_block(cut, in_.info().lattice, block, writer);
      context.count_read(in_.block_bytes(cut.patches));
      context.advance(cut.faces);
    }
    context.count_written(writer.finish());
    sum["blocks"] = blocks_.end(task) - blocks_.first(task);
    if (is_last()) sum["quality"] = fields_to_json(quality);
    return sum;
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{4} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    TriangleQuality quality;
    Json sum = Json::object();
    for (Json s : summaries) {
      if (is_last()) quality.merge(fields_from_json<TriangleQuality>(s.at("quality")));
      s.erase("quality");
      add_counts(sum, s);
    }
    if (!is_last()) return refuse_needles(sum);
    sum["quality"] = quality_report(quality, sizing_.edge);
    if (sizing_.fine && options_.keeps_faces() &&
        (verdict_.are_far_more(quality.faces) || RemeshVerdict::is_poor(sum))) {
      write_text(context.create(sizing_file(pass_.round + 1)), dump_json(sizing_.coarser().to_json()));
      sum["less_near"] = true;
      return sum;
    }
    if (!verdict_.are_far_more(quality.faces)) return verdict_.judge_shape(sum);
    const bool helped = sizing_.left == 0 ||
                        static_cast<double>(quality.faces) <= kWorthWhile * static_cast<double>(sizing_.left);
    if (pass_.round + 1 == kMaxRounds || !helped) verdict_.refuse_far_more(quality.faces);
    const double times =
        kLongerStill * std::sqrt(static_cast<double>(quality.faces) / static_cast<double>(options_.faces));
    const Sizing longer = sizing_.longer(times, quality.faces);
    write_text(context.create(sizing_file(pass_.round + 1)), dump_json(longer.to_json()));
    sum["longer_edge"] = longer.edge;
    return sum;
  }

 private:
  /// Whether no edges were made longer yet, and none keep nearer to the input than they need.
  bool is_first_coarse() const { return !sizing_.fine && sizing_.left == 0; }
  /// After the first pass of all: what later ones cannot make good. \throws ValidationError  as RemeshVerdict::refuse_far_more()
  const Json& refuse_needles(const Json& sum) const {
    const auto count = [&](const char* key) { return sum.value(key, std::uint64_t{0}); };
    if (pass_.pass == 0 && is_first_coarse() && count("locked_vertices") == 0 &&
        count("refused_by_room") > 0 && verdict_.are_far_more(count("faces_out"), kNeedleTimesFaces))
      verdict_.refuse_far_more(count("faces_out"));
    return sum;
  }
  /// Of the round: the shape of what it leaves is told.
  bool is_last() const { return pass_.pass + 1 == options_.all_passes(); }

  void judge_block(const MeshBlock& block, TriangleQuality& quality, Json& sum) const {
    if (!is_last()) return;
    quality.add(block, sizing_.edge);
    if (options_.adaptive) {
      const UnevenEdges left = find_uneven(block, RemeshJobOptions::kMaxLengthRatio);
      add_counts(sum, {{"uneven_left", left.uneven}, {"edges_seen", left.edges}});
    }
    if (!(options_.min_angle_deg > 0.0)) return;
    const SharpFaces left = count_sharp(block, options_.min_angle_deg);
    add_counts(sum, {{"sharp_left", left.faces}, {"sharp_between_lines", left.between_lines}});
  }
  // Whether it is one of the passes behind the others.
  bool raises() const { return pass_.pass >= options_.passes && !evens(); }
  bool evens() const { return options_.evens_in(pass_.pass); }

  /// The first pass does all of a block, later ones what lies near the seams of the ones before.
  Json remesh_block(std::size_t b, MeshBlock& block, std::uint64_t bytes, TaskContext& context) const {
    const UnevenEdges uneven = evens() ? find_uneven(block, kernel_.max_length_ratio) : UnevenEdges{};
    const std::vector<std::uint8_t> near = near_active(block, [&](std::size_t f) {
      if (evens()) return uneven.at_face[f] != 0;
      if (!raises()) return (block.face_flags[f] & kFaceDone) == 0;  // an earlier pass could not settle it
      const auto& t = block.faces[f];
      return sharpness(block.position[t[0]], block.position[t[1]], block.position[t[2]]) > sharp_above_;
    });
    const std::vector<std::uint64_t> seams = seam_keys(block);
    MeshBlock rest;
    const bool whole = std::find(near.begin(), near.end(), 0) == near.end();
    const std::size_t faces = block.faces.size();
    if (!whole) {
      std::vector<std::uint8_t> far(near.size());
      for (std::size_t f = 0; f < near.size(); ++f) far[f] = near[f] == 0;
      rest = select_faces(block, far);
      block = select_faces(block, near);
    }
    Json counts = {{"faces_in", faces}, {"faces_out", rest.faces.size()}};
    if (!block.faces.empty()) {
      const std::vector<std::uint64_t> pinned = blocks_.pinned_keys(block, context);
      const MeshBlock reference = load_reference(blocks_[b], block, whole, bytes);
      RemeshOptions kernel = kernel_;
      kernel.max_faces = face_capacity(blocks_[b]);
      kernel.first_key = first_new_key(pass_, b);
      kernel.pause = [&context] { context.check_stop(); };
      const RemeshReport report = remesh(block, reference, kernel, pinned);
      add_counts(counts, remesh_counts(report));
      if (raises()) add_counts(counts, raised_counts(report));
      if (evens()) add_counts(counts, evened_counts(report));
      mark_done(block, seams, report);
    }
    if (!whole) {
      const MeshBlock* const pieces[2] = {&rest, &block};
      block = merge_blocks(pieces, {});
    }
    return counts;
  }

  /// Of what lies along seams only the surroundings, where these are much less than the whole.
  /// \param bytes  what the task may hold
  MeshBlock load_reference(const MeshBlockCut& cut, const MeshBlock& block, bool whole,
                           std::uint64_t bytes) const {
    const std::vector<std::uint8_t> all(block.faces.size(), 1);
    // Lengths that adapt follow from all that is around; to even them asks for none.
    const bool all_around = whole || (options_.adaptive && !evens());
    NearFaceLoader near = all_around ? NearFaceLoader(reference_, reference_box(cut))
                                     : NearFaceLoader(reference_, block, all, halo());
    near.require_fits([&](std::uint64_t reference_bytes,
                          std::uint64_t faces) { return needed(cut, reference_bytes, faces); },
                      bytes, name());
    return near.load();
  }

  /// Of a block, with so much of the reference.
  std::uint64_t needed(const MeshBlockCut& cut, std::uint64_t reference_bytes, std::uint64_t faces) const {
    return remesh_task_bytes(in_.block_bytes(cut.patches) + reference_bytes, face_capacity(cut), faces,
                             blocks_.failed_bytes(), evens());
  }

  std::uint64_t face_capacity(const MeshBlockCut& cut) const {
    std::uint64_t expected = 0;
    for (const std::size_t p : cut.patches) expected += sizing_.expected(in_.patches()[p]);
    return kCapacityFactor * std::max(expected, cut.faces) + kMinCapacity;
  }

  MeshBox reference_box(const MeshBlockCut& cut) const { return grown(in_.box_of(cut.patches), halo()); }
  double halo() const {
    const double graded = options_.adaptive ? (sizing_.edge - sizing_.shortest) / kSizingGrowth : 0.0;
    if (options_.creases == "graded")
      return (2.0 + (1.0 - kShortestOnLine) / kLineGrowth) * sizing_.edge + options_.tolerance;
    return std::max(kHaloEdges * sizing_.edge, 2.0 * sizing_.edge + graded) + options_.tolerance;
  }

  RemeshJobOptions options_;
  SimplifyPass pass_;
  Sizing sizing_;
  RemeshVerdict verdict_;
  RemeshOptions kernel_;
  double sharp_above_ = 1.0;         ///< squared cosine of the angle asked for
  std::uint64_t largest_bytes_ = 0;  ///< of the cap, for one task
  PassBlocks blocks_;
  const MeshStore& in_;
  const MeshStore& reference_;
};

}  // namespace

std::uint64_t remesh_task_bytes(std::uint64_t block_bytes, std::uint64_t max_faces,
                                std::uint64_t reference_faces, std::uint64_t failed_bytes, bool evens) {
  // What is loaded is merged from pieces, so it is there twice for a moment; then the kernel works on it.
  return block_bytes + remesh_bytes(max_faces, reference_faces, true, evens) + failed_bytes +
         DirectFile::kDefaultBuffer + (std::uint64_t{4} << 20);
}

std::uint64_t remesh_pass_bytes(const RemeshJobOptions& options, std::uint64_t faces, std::uint64_t around,
                                int pass) {
  // With a length alone the mesh may become finer: as a rule not much.
  const std::uint64_t expected = std::max(faces, options.faces > 0 ? options.faces : 2 * faces);
  const std::uint64_t block = std::min(expected, options.block_faces);
  const std::uint64_t reference = std::min(faces, around * kRemeshReferenceBlocks * options.block_faces);
  return remesh_task_bytes(surface_block_bytes(block) + surface_block_bytes(reference),
                           kCapacityFactor * block + kMinCapacity, reference, 0, options.evens_in(pass));
}

std::vector<MeshBlockCut> remesh_blocks(const MeshStore& in, const MeshStore& reference,
                                        const RemeshJobOptions& options, const Sizing& sizing, int pass) {
  std::vector<std::uint64_t> weight;
  for (const MeshPatchEntry& e : in.patches()) {
    const std::int64_t there = reference.find(e.key);
    const std::uint64_t full = there < 0 ? 0 : reference.patches()[static_cast<std::size_t>(there)].faces;
    weight.push_back(std::max(sizing.expected(e), full / kRemeshReferenceBlocks));
  }
  return make_blocks(in, {options.block_faces, options.block_faces, pass_shift(pass), true}, weight);
}

std::unique_ptr<Stage> make_remesh_stage(const JobState& state, const RemeshJobOptions& options,
                                         const SimplifyStores& stores, const SimplifyPass& pass) {
  if (pass.round > last_remesh_round(state.work)) return make_idle_stage(pass.stage_name());
  return std::make_unique<RemeshStage>(state, options, stores, pass);
}

}  // namespace tessera
