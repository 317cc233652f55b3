#include "stream/stages/weld/border_stage.h"

#include <algorithm>

#include "kernels/smooth/border_fairing.h"
#include "stream/files/json.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/orient_sight.h"
#include "stream/stages/weld/border_moves.h"
#include "stream/stages/weld/border_strip.h"

namespace tessera {
namespace {

constexpr std::uint64_t kBorderFixedBytes = std::uint64_t{4} << 20;
/// Of one face in the kernel: itself, half a vertex, what scales and beads hold.
constexpr std::uint64_t kKernelBytes = 280;

class BorderStage : public Stage {
 public:
  explicit BorderStage(const JobState& state)
      : state_(state),
        lift_(reconstruct_options(state).smooths_border() ? Plan::of_work(state.work).noise_cells : 0.0),
        fairing_(std::filesystem::exists(state.work / kRoomFile) ? kShadowFairing : BorderFairing()),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {}

  std::string name() const override { return "border"; }
  std::size_t task_count() const override { return lift_ > 0.0 ? store_.file_count() : 0; }
  std::uint64_t units() const override { return lift_ > 0.0 ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return border_task_bytes(store_.patches().subspan(first, last - first));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    StripReader reader(state_, store_, numbering_);
    BorderMovesWriter writer(context.create(border_moves_file_name(task)));
    std::vector<StripFace> faces;
    std::vector<MovedVertex> moves;
    std::uint64_t moved = 0, torn = 0;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      context.advance(1);
      if (!reader.has_border(p)) continue;
      if (!reader.gather(p, kBorderHalo, faces)) {
        ++torn;
        continue;
      }
      fair(p, reader, faces, moves);
      writer.add(store_.patches()[p].key, moves);
      moved += moves.size();
    }
    context.count_written(writer.finish());
    return {{"moved_vertices", moved}, {"torn_bricks", torn}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"moved_vertices", 0}, {"torn_bricks", 0}});
  }

 private:
  /// The patch's own vertices that move.
  void fair(std::size_t patch, const StripReader& reader, const std::vector<StripFace>& faces,
            std::vector<MovedVertex>& moves) const {
    const auto rank = [](const VertexSlot& v) { return std::uint64_t{v.patch} << 32 | v.vertex; };
    std::vector<std::uint64_t> names;
    names.reserve(3 * faces.size());
    for (const StripFace& f : faces)
      for (const VertexSlot& v : f.slot) names.push_back(rank(v));
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    const Int3 brick = reader.brick(patch);
    BorderStrip strip;
    strip.position.resize(names.size());
    strip.at_border.resize(names.size());
    strip.faces.reserve(faces.size());
    for (const StripFace& f : faces) {
      auto& face = strip.faces.emplace_back();
      for (std::size_t i = 0; i < 3; ++i) {
        const auto v = std::lower_bound(names.begin(), names.end(), rank(f.slot[i])) - names.begin();
        face[i] = static_cast<std::uint32_t>(v);
        strip.position[face[i]] = reader.corner(f, i, brick);
        strip.at_border[face[i]] = f.border >> i & 1u;
      }
    }
    const auto own = std::lower_bound(names.begin(), names.end(), std::uint64_t{patch} << 32);
    const auto end = std::lower_bound(own, names.end(), std::uint64_t{patch + 1} << 32);
    const std::vector<Double3> before(strip.position.begin() + (own - names.begin()),
                                      strip.position.begin() + (end - names.begin()));
    fair_border(strip, lift_, fairing_);
    moves.clear();
    for (auto v = own; v != end; ++v) {
      const Double3& at = strip.position[static_cast<std::size_t>(v - names.begin())];
      if (at != before[static_cast<std::size_t>(v - own)])
        moves.push_back({static_cast<std::uint32_t>(*v), narrow(at)});
    }
  }

  JobState state_;
  double lift_;  ///< cells; 0 = nothing moves
  BorderFairing fairing_;
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::uint64_t border_task_bytes(std::span<const PatchEntry> patches) {
  return StripReader::bytes(patches) + kMaxStripFaces * kKernelBytes + kBorderFixedBytes;
}

std::unique_ptr<Stage> make_border_stage(const JobState& state) {
  return std::make_unique<BorderStage>(state);
}

namespace {

constexpr double kBorderTime = 0.15;  ///< microseconds a face, of scans that are mostly borders

}  // namespace

StageForecast forecast_border(const PlannedScan& scan) {
  if (!scan.options.smooths_border() || !(scan.plan.noise_cells > 0.0)) return idle_forecast();
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(border_task_bytes),
          .sure_bytes = border_task_bytes({}),
          .files = scan.groups.size(),
          .processor_us = scan.faces * kBorderTime};
}

}  // namespace tessera
