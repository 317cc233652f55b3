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
#include "stream/stages/surface/hole_rounding.h"
#include "stream/stages/surface/loops_stage.h"
#include "stream/stages/weld/mesh_around.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kFixedBytes = std::uint64_t{8} << 20;
constexpr std::uint64_t kRimSortBytes = std::uint64_t{8} << 20;

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
    return hole_task_bytes(limit_.edges, limit_.chained) + MeshAround::bytes(store_.patches());
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const std::vector<NamedLoop> loops = load_loops(files_[task]);
    HoleFillings out;
    std::array<std::uint64_t, kHoleOutcomes> outcomes{};
    std::uint64_t stiff = 0, crossing = 0, folded = 0, rounded = 0;
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
      if (is_chained(loop)) find_chords(named, loop, corner, around);
      HoleFiller filler(loop);
      Try found = try_shape(named, loop, filler, corner, smooth_limits(loop), around);
      const HoleOutcome smooth = found.filling.outcome;
      const bool crossed = found.crosses;
      if (!found.fits() && limit_.membranes && smooth != HoleOutcome::kWide)
        for (const HoleLimits& limits : further_limits(loop)) {
          found = try_shape(named, loop, filler, corner, limits, around);
          if (found.fits()) break;
        }
      if (!found.fits()) {
        if (crossed)
          ++crossing;
        else
          ++outcomes[static_cast<std::size_t>(smooth)];
        continue;
      }
      HoleFilling& filling = found.filling;
      if (limit_.membranes)
        rounded +=
            round_rim(named, loop, corner, store_, numbering_, around, found.touching, filling, out.moved);
      ++outcomes[static_cast<std::size_t>(HoleOutcome::kFilled)];
      folded += smooth != HoleOutcome::kFilled || crossed;
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
      if (limit_.membranes) add_span(named, loop, corner, filling, out);
    }
    out.save(context.create(filling_file_name(task)));
    context.advance(1);
    const auto count = [&](HoleOutcome o) { return outcomes[static_cast<std::size_t>(o)]; };
    return {{"loops", loops.size()},
            {"filled", count(HoleOutcome::kFilled)},
            {"folded", folded},
            {"rounded", rounded},
            {"refused_taken", count(HoleOutcome::kTaken)},
            {"refused_outer", count(HoleOutcome::kOuter)},
            {"left_wide", count(HoleOutcome::kWide)},
            {"left_sharp", count(HoleOutcome::kSharp)},
            {"left_crossing", crossing},
            {"not_fair", stiff},
            {"vertices", out.position.size()},
            {"faces", out.faces.size()}};
  }

  std::uint64_t finish_bytes() const override { return kFixedBytes + finish_sort_bytes(); }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    Json total = Json::object();
    for (const char* key : {"loops", "filled", "folded", "rounded", "refused_taken", "refused_outer",
                            "left_wide", "left_sharp", "left_crossing", "not_fair", "vertices", "faces"}) {
      std::uint64_t sum = 0;
      for (const Json& s : summaries) sum += s.at(key).get<std::uint64_t>();
      total[key] = sum;
    }
    if (limit_.membranes && !files_.empty())
      total["moved_vertices"] = save_rim_moves(work_, store_, numbering_, finish_sort_bytes(), context);
    return total;
  }

  std::vector<std::string> obsolete() const override {
    return limit_.edges == 0 ? std::vector<std::string>{} : std::vector<std::string>{"loops/"};
  }

 private:
  std::uint64_t finish_sort_bytes() const { return limit_.membranes ? kRimSortBytes : 0; }

  /// What "uncross-holes" needs to know of a filling. \pre its vertices and faces are in `out`
  static void add_span(const NamedLoop& named, const HoleLoop& loop, const Double3& corner,
                       const HoleFilling& filling, HoleFillings& out) {
    FillingSpan span;
    span.vertices = static_cast<std::uint32_t>(filling.position.size());
    span.faces = static_cast<std::uint32_t>(filling.faces.size());
    span.rim = static_cast<std::uint32_t>(named.vertex.size());
    span.low = span.high = loop.position[0] + corner;
    const auto add = [&](const Double3& p) {
      for (std::size_t a = 0; a < 3; ++a)
        span.low[a] = std::min(span.low[a], p[a]), span.high[a] = std::max(span.high[a], p[a]);
    };
    for (std::size_t i = 0; i < named.vertex.size(); ++i) {
      out.rim.push_back({named.vertex[i], loop.position[i] + corner});
      add(out.rim.back().position);
    }
    for (std::size_t v = out.position.size() - filling.position.size(); v < out.position.size(); ++v)
      add(out.position[v]);
    out.spans.push_back(span);
  }

  struct Try {
    HoleFilling filling;
    bool crosses = false;               ///< the mesh
    std::vector<ContactFace> touching;  ///< faces of the mesh that may meet it
    bool fits() const { return filling.outcome == HoleOutcome::kFilled && !crosses; }
  };

  bool is_chained(const HoleLoop& loop) const { return loop.position.size() > limit_.edges; }

  HoleLimits smooth_limits(const HoleLoop& loop) const {
    HoleLimits out = {.width = limit_.width, .min_cosine = limit_.min_cosine};
    if (is_chained(loop)) out.vertices = kChainedVertices;
    return out;
  }
  /// Where no smooth patch fits without a fold: membranes, then patches that fold, then no new vertex at all.
  std::array<HoleLimits, 3> further_limits(const HoleLoop& loop) const {
    HoleLimits smooth = smooth_limits(loop);
    smooth.min_cosine = -1.0;
    // A rim that a brick sees whole is too short to be the outer border of a piece that was kept.
    smooth.outer = !is_chained(loop);
    HoleLimits membrane = smooth;
    membrane.shape = HoleShape::kMembrane;
    HoleLimits flat = membrane;
    flat.vertices = 0;
    return {membrane, smooth, flat};
  }

  Try try_shape(const NamedLoop& named, const HoleLoop& loop, HoleFiller& filler, const Double3& corner,
                const HoleLimits& limits, MeshAround& around) const {
    Try out = {filler.fill(limits), false, {}};
    if (out.filling.outcome == HoleOutcome::kFilled)
      out.crosses = (limit_.membranes && is_dense(loop, out.filling)) ||
                    crosses(named, loop, out.filling, corner, around, out.touching);
    return out;
  }

  /// Whether a new vertex lies so near to another that they change sides when they are rounded to be written.
  static bool is_dense(const HoleLoop& loop, const HoleFilling& filling) {
    constexpr double kNearest = 1.0 / 256;  // cells
    const std::size_t n = loop.position.size();
    const auto at = [&](std::uint32_t v) { return v < n ? loop.position[v] : filling.position[v - n]; };
    for (const auto& f : filling.faces)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = f[k], b = f[(k + 1) % 3];
        if (std::max(a, b) >= n && norm(at(a) - at(b)) < kNearest) return true;
      }
    return false;
  }

  /// Edges of the mesh across a loop that was chained from border edges alone.
  static void find_chords(const NamedLoop& named, HoleLoop& loop, const Double3& origin, MeshAround& around) {
    const std::size_t n = named.vertex.size();
    Double3 low = loop.position[0], high = low;
    for (const Double3& p : loop.position)
      for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
    std::vector<std::array<std::uint64_t, 2>> order;  // number, position in the loop
    std::vector<std::uint64_t> sorted = named.vertex;
    for (std::size_t i = 0; i < n; ++i) order.push_back({named.vertex[i], i});
    std::sort(order.begin(), order.end());
    std::sort(sorted.begin(), sorted.end());
    const auto position = [&](std::uint64_t v) {
      return static_cast<std::uint32_t>(
          (*std::lower_bound(order.begin(), order.end(), std::array{v, std::uint64_t{0}}))[1]);
    };
    for (const auto& [a, b] : around.edges_between(origin, low, high, sorted)) {
      const auto [i, j] = std::minmax({position(a), position(b)});
      if (j != i + 1 && !(i == 0 && j + 1 == n)) loop.taken.push_back({i, j});
    }
    std::sort(loop.taken.begin(), loop.taken.end());
  }

  /// Whether faces of a filling would meet each other, or the mesh, beyond what they share.
  /// \param mesh  gets the faces there
  static bool crosses(const NamedLoop& named, const HoleLoop& loop, const HoleFilling& filling,
                      const Double3& origin, MeshAround& around, std::vector<ContactFace>& mesh) {
    const std::size_t n = named.vertex.size();
    const auto at = [&](std::uint32_t v) { return v < n ? loop.position[v] : filling.position[v - n]; };
    const auto number = [&](std::uint32_t v) {
      return v < n ? named.vertex[v] : HoleFillings::kNew | (v - n);
    };
    std::vector<ContactFace> faces;
    for (const auto& f : filling.faces)
      faces.push_back({{at(f[0]), at(f[1]), at(f[2])}, {number(f[0]), number(f[1]), number(f[2])}});
    around.gather_near(origin, faces, 0.0, mesh);
    std::erase_if(faces,
                  [](const ContactFace& f) { return collinear(f.corner[0], f.corner[1], f.corner[2]); });
    const std::size_t own = faces.size();
    faces.insert(faces.end(), mesh.begin(), mesh.end());
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

namespace {

// Microseconds a face: of noisy scans, whose holes nobody knows yet; those of two field scans took 0.5 and 0.9, of two rooms
// 1.0 and 1.2.
constexpr double kLoopsTime = 0.14, kHolesTime = 0.6, kRoomHolesTime = 1.0;

}  // namespace

StageForecast forecast_loops(const PlannedScan& scan) {
  if (scan.max_hole_edges == 0) return idle_forecast();
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(loops_task_bytes),
          .finish_bytes =
              loops_finish_bytes(scan.run, scan.max_hole_edges, scan.max_chained_edges, scan.patches.entries),
          .sure_bytes = loops_finish_bytes(scan.run, scan.max_hole_edges, scan.max_chained_edges, {}),
          .files = scan.groups.size(),
          .processor_us = scan.faces * kLoopsTime,
          .moved_bytes = static_cast<double>(scan.surface_bytes)};
}
StageForecast forecast_holes(const PlannedScan& scan) {
  if (scan.max_hole_edges == 0) return idle_forecast();
  const std::uint64_t filling = hole_task_bytes(scan.max_hole_edges, scan.max_chained_edges);
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(MeshAround::bytes) + filling,
          .sure_bytes = MeshAround::bytes({}) + filling,
          .files = scan.groups.size(),
          .processor_us = scan.faces * (scan.is_room() ? kRoomHolesTime : kHolesTime)};
}

}  // namespace tessera
