#include "stream/stages/surface/holes_stage.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"
#include "stream/files/json.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/surface/hole_limit.h"
#include "stream/stages/surface/loops_stage.h"
#include "stream/stages/weld/mesh_around.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kFixedBytes = std::uint64_t{8} << 20;

class HolesStage : public Stage {
 public:
  explicit HolesStage(const JobState& state)
      : work_(state.work),
        plan_(Plan::of_work(state.work)),
        limit_(hole_limit(state, plan_)),
        files_(list_loop_files(state.work)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {}

  std::string name() const override { return "holes"; }
  std::size_t task_count() const override { return files_.size(); }
  std::uint64_t units() const override { return files_.size(); }
  std::string unit_name() const override { return "batches"; }

  std::uint64_t task_bytes(std::size_t) const override {
    return hole_task_bytes(limit_.edges) + MeshAround::bytes(store_.patches());
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const std::vector<NamedLoop> loops = load_loops(files_[task]);
    HoleFillings out;
    std::array<std::uint64_t, kHoleOutcomes> outcomes{};
    std::uint64_t stiff = 0, crossing = 0;
    MeshAround around(work_, store_, numbering_);
    for (const NamedLoop& named : loops) {
      context.check_stop();
      // Near the origin the kernel's arithmetic is the same wherever the loop lies.
      HoleLoop loop = named.loop;
      Double3 corner = loop.position[0];
      for (double& c : corner) c = std::floor(c);
      for (auto* list : {&loop.position, &loop.opposite})
        for (Double3& p : *list)
          for (std::size_t a = 0; a < 3; ++a) p[a] -= corner[a];
      const HoleFilling filling = fill_hole(loop, limit_.width, limit_.min_cosine);
      ++outcomes[static_cast<std::size_t>(filling.outcome)];
      if (filling.outcome != HoleOutcome::kFilled) continue;
      if (is_risky(filling) && crosses(named, loop, filling, corner, around)) {
        ++crossing;
        continue;
      }
      stiff += !filling.fair;
      const std::uint64_t base = out.position.size();
      for (Double3 p : filling.position) {
        for (std::size_t a = 0; a < 3; ++a) p[a] += corner[a];
        out.position.push_back(p);
      }
      out.rgba.insert(out.rgba.end(), filling.rgba.begin(), filling.rgba.end());
      const std::size_t n = named.vertex.size();
      for (const auto& f : filling.faces) {
        std::array<std::uint64_t, 3> face;
        for (std::size_t k = 0; k < 3; ++k)
          face[k] = f[k] < n ? named.vertex[f[k]] : HoleFillings::kNew | (base + f[k] - n);
        out.faces.push_back(face);
      }
    }
    out.save(context.create(filling_file_name(task)));
    context.advance(1);
    const auto count = [&](HoleOutcome o) { return outcomes[static_cast<std::size_t>(o)]; };
    return {{"loops", loops.size()},
            {"filled", count(HoleOutcome::kFilled) - crossing},
            {"refused_taken", count(HoleOutcome::kTaken)},
            {"refused_outer", count(HoleOutcome::kOuter)},
            {"left_wide", count(HoleOutcome::kWide)},
            {"left_sharp", count(HoleOutcome::kSharp)},
            {"left_crossing", crossing},
            {"not_fair", stiff},
            {"vertices", out.position.size()},
            {"faces", out.faces.size()}};
  }

  std::uint64_t finish_bytes() const override { return kFixedBytes; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    Json total = Json::object();
    for (const char* key : {"loops", "filled", "refused_taken", "refused_outer", "left_wide", "left_sharp",
                            "left_crossing", "not_fair", "vertices", "faces"}) {
      std::uint64_t sum = 0;
      for (const Json& s : summaries) sum += s.at(key).get<std::uint64_t>();
      total[key] = sum;
    }
    return total;
  }

  std::vector<std::string> obsolete() const override {
    return limit_.edges == 0 ? std::vector<std::string>{} : std::vector<std::string>{"loops/"};
  }

 private:
  /// Narrow fillings that fold no farther than a right angle stay clear of all but the rim.
  bool is_risky(const HoleFilling& filling) const {
    return filling.width > plan_.radius_cells || filling.min_cosine < 0.0;
  }

  /// Whether faces of a filling would meet each other, or the mesh, beyond what they share.
  static bool crosses(const NamedLoop& named, const HoleLoop& loop, const HoleFilling& filling,
                      const Double3& origin, MeshAround& around) {
    const std::size_t n = named.vertex.size();
    const auto at = [&](std::uint32_t v) { return v < n ? loop.position[v] : filling.position[v - n]; };
    const auto number = [&](std::uint32_t v) {
      return v < n ? named.vertex[v] : HoleFillings::kNew | (v - n);
    };
    Double3 low = loop.position[0], high = low;
    std::vector<ContactFace> faces;
    for (const auto& f : filling.faces) {
      const ContactFace face = {{at(f[0]), at(f[1]), at(f[2])}, {number(f[0]), number(f[1]), number(f[2])}};
      if (!collinear(face.corner[0], face.corner[1], face.corner[2])) faces.push_back(face);
      for (const Double3& p : face.corner)
        for (std::size_t a = 0; a < 3; ++a)
          low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
    }
    const std::size_t own = faces.size();
    around.gather(origin, low, high, faces);
    bool found = false;
    block_contacts(faces, kAllSpace,
                   [&](std::uint32_t i, std::uint32_t, FaceContact) { found = found || i < own; });
    return found;
  }

  std::filesystem::path work_;
  Plan plan_;
  HoleLimit limit_;
  std::vector<std::filesystem::path> files_;
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::unique_ptr<Stage> make_holes_stage(const JobState& state) {
  return std::make_unique<HolesStage>(state);
}

StageForecast forecast_loops(const PlannedScan& scan) {
  if (scan.max_hole_edges == 0) return idle_forecast();
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(loops_task_bytes),
          .finish_bytes = loops_finish_bytes(scan.run, scan.max_hole_edges, scan.patches.entries),
          .sure_bytes = loops_finish_bytes(scan.run, scan.max_hole_edges, {}),
          .files = scan.groups.size(),
          .moved_bytes = static_cast<double>(scan.surface_bytes)};
}
StageForecast forecast_holes(const PlannedScan& scan) {
  if (scan.max_hole_edges == 0) return idle_forecast();
  const std::uint64_t filling = hole_task_bytes(scan.max_hole_edges);
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(MeshAround::bytes) + filling,
          .sure_bytes = MeshAround::bytes({}) + filling,
          .files = scan.groups.size()};
}

}  // namespace tessera
