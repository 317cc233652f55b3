#include <algorithm>
#include <numeric>
#include <tuple>

#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/factor_file.h"
#include "stream/stages/smooth/smooth_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSlackBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kCoarseSortBytes = std::uint64_t{64} << 20;
constexpr std::uint64_t kReadEntries = std::uint64_t{1} << 16;

/// Rings of faces that the sums at a vertex read: rows of its neighbours' stars, and whether ends of lines are free.
constexpr int kSumsRings = 3;

/// What coarse_matrix() and coarse_load() take for a vertex of the patch, and for one of the tile.
constexpr std::uint64_t kSumsPatchBytes = 1800;
constexpr std::uint64_t kSumsVertexBytes = 8 * (16 + 1 + 4 + 56 + 1);

/// Of the first round of a step, for all its cycles.
std::string matrix_folder(std::size_t round) {
  return "matrix-" + std::to_string(round) + "/";
}
std::string matrix_file(std::size_t round) {
  return matrix_folder(round) + "matrix.bin";
}
/// \param part  free or line
std::string factor_file(std::size_t round, const char* part) {
  return matrix_folder(round) + part + ".factor";
}

/// Numbers of a factor for an unknown beyond which holding it in memory is not planned; 270 on a terrain.
constexpr std::uint64_t kCachedFactorBytes = 8 * 600;

class CoarseSumsStage : public Stage {
 public:
  CoarseSumsStage(const JobState& state, const SmoothPlan& plan, std::size_t round)
      : round_(round),
        rule_(plan.rounds[round - 1]),
        options_(coarse_options(state, plan, round)),
        store_(open_smoothed(state, plan, base_round(plan, round))),
        before_(open_smoothed(state, plan, round - 1)),
        laplacians_(laplacians_of(state.work, plan, round)) {
    SmoothTiling tiling;
    tiling.rings = kSumsRings;
    tiling.range = coarse_halo(options_);
    tiling.tile_bricks = state.run.tile_cells / kBrickCells;
    tiling.tile_bytes = state.run.memory_bytes * 13 / 16 / static_cast<std::uint64_t>(state.run.threads);
    std::uint64_t patch_vertices = 0;
    for (const MeshPatchEntry& e : store_.patches())
      patch_vertices = std::max<std::uint64_t>(patch_vertices, e.vertices);
    tiling.bytes = [rule = rule_, patch_vertices](std::uint64_t vertices, std::uint64_t faces) {
      return coarse_sums_bytes(rule, vertices, faces, patch_vertices);
    };
    tasks_ = make_smooth_tasks(store_, load_range(state.work, base_round(plan, round)), tiling);
  }

  std::string name() const override { return coarse_sums_folder(round_); }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override { return tessera::task_bytes(tasks_[task]); }

  Json run(std::size_t task, TaskContext& context) const override {
    PatchSumsWriter writer(context.create(coarse_sums_folder(round_) + "/" + task_file_stem(task) + ".bin"));
    for (const SmoothTile& tile : tasks_[task]) {
      context.check_stop();
      const MeshHaloBlock near = store_.load_near(tile.patches, tile.margin);
      const TileState state = tile_state(store_, before_, laplacians_, near, tile);
      const FaceCorners corners(near.block);
      const SurfaceRows rows = make_surface_rows(near.block, corners, rule_.rows);
      context.check_stop();
      const CoarseBasis basis = make_coarse_basis(near.block, rows, options_);
      std::vector<std::vector<CoarseUnknown>> unknowns(tile.patches.size());
      for (std::size_t i = 0; i < basis.name.size(); ++i) {
        const auto owner =
            std::lower_bound(tile.patches.begin(), tile.patches.end(), near.first_patch[basis.seed[i]]);
        if (owner == tile.patches.end() || *owner != near.first_patch[basis.seed[i]]) continue;
        unknowns[static_cast<std::size_t>(owner - tile.patches.begin())].push_back(
            {basis.name[i], near.block.position[basis.seed[i]], basis.on_line[i]});
      }
      for (std::size_t k = 0; k < tile.patches.size(); ++k) {
        context.check_stop();
        std::vector<std::uint32_t> own;
        for (const std::uint32_t v : near.core_vertices[k])
          if (near.first_patch[v] == tile.patches[k]) own.push_back(v);
        PatchSums sums;
        sums.patch = tile.patches[k];
        sums.unknowns = std::move(unknowns[k]);
        if (rule_.cycle == 0) sums.entries = coarse_matrix(rows, basis, own, options_);
        sums.loads =
            coarse_load(rows, basis, {near.block.position, state.now, state.laplacian}, own, options_);
        writer.add(sums);
        context.advance(store_.patches()[tile.patches[k]].faces);
      }
    }
    context.count_written(writer.finish());
    return Json::object();
  }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return {{"tasks", summaries.size()}, {"cell", options_.cell}, {"degree", options_.degree}};
  }
  std::uint64_t finish_bytes() const override { return kSlackBytes; }

 private:
  std::size_t round_;
  SmoothRound rule_;
  CoarseOptions options_;
  MeshStore store_;             ///< where the step began
  MeshStore before_;            ///< where the round begins
  PatchLaplacians laplacians_;  ///< there
  std::vector<SmoothTask> tasks_;
};

/// Sums of several patches, in the order of the patches.
struct PlacedEntry {
  CoarseEntry entry;
  std::uint64_t patch = 0;
  bool operator<(const PlacedEntry& o) const {
    return std::tie(entry.row, entry.column, patch) < std::tie(o.entry.row, o.entry.column, o.patch);
  }
};
struct PlacedLoad {
  CoarseLoad load;
  std::uint64_t patch = 0;
  bool operator<(const PlacedLoad& o) const {
    return std::tie(load.row, patch) < std::tie(o.load.row, o.patch);
  }
};

class CoarseStage : public Stage {
 public:
  CoarseStage(const JobState& state, const SmoothPlan& plan, std::size_t round)
      : work_(state.work),
        round_(round),
        first_(base_round(plan, round) + 1),
        last_(plan.rounds[round - 1].cycle + 1 == kCoarseCycles),
        options_(coarse_options(state, plan, round)),
        files_(list_task_files(work_ / coarse_sums_folder(round), ".bin")),
        count_(count_patch_sums(files_)) {
    entries_ = round_ == first_ ? count_.entries
                                : ReadFile(work_ / matrix_file(first_)).size() / sizeof(CoarseEntry);
    const std::uint64_t maximum = state.run.memory_bytes * 13 / 16, need = needed_bytes();
    factor_bytes_ = std::min(kCachedFactorBytes * count_.unknowns, maximum > need ? maximum - need : 0);
  }

  std::string name() const override { return coarse_folder(round_); }
  std::size_t task_count() const override { return 1; }
  std::uint64_t units() const override { return count_.unknowns; }
  std::string unit_name() const override { return "unknowns"; }
  std::uint64_t task_bytes(std::size_t) const override { return needed_bytes() + factor_bytes_; }

  Json run(std::size_t, TaskContext& context) const override {
    std::vector<CoarseUnknown> unknowns;
    unknowns.reserve(count_.unknowns);
    std::vector<PlacedLoad> placed;
    placed.reserve(count_.loads);
    ExternalSort<PlacedEntry> sort(work_, kCoarseSortBytes);
    read_patch_sums(files_, [&](const PatchSums& sums) {
      context.check_stop();
      unknowns.insert(unknowns.end(), sums.unknowns.begin(), sums.unknowns.end());
      for (const CoarseLoad& l : sums.loads) placed.push_back({l, sums.patch});
      for (const CoarseEntry& e : sums.entries) sort.add({e, sums.patch});
    });
    std::sort(unknowns.begin(), unknowns.end(),
              [](const CoarseUnknown& a, const CoarseUnknown& b) { return a.name < b.name; });
    std::sort(placed.begin(), placed.end());
    std::vector<CoarseLoad> loads;
    for (const PlacedLoad& p : placed) {
      if (loads.empty() || loads.back().row != p.load.row) loads.push_back({p.load.row, {}, {}});
      for (std::size_t a = 0; a < 3; ++a) {
        loads.back().moved[a] += p.load.moved[a];
        loads.back().laplacian[a] += p.load.laplacian[a];
      }
    }
    CoarseSystem system(unknowns, options_);
    if (round_ == first_) {
      DirectFile file(context.create(matrix_file(first_)));
      CoarseEntry sum;
      bool any = false;
      const auto put = [&] {
        if (!any) return;
        system.add(sum);
        file.write(&sum, sizeof sum);
      };
      sort.drain([&](std::span<const PlacedEntry> batch) {
        context.check_stop();
        for (const PlacedEntry& p : batch) {
          if (any && p.entry.row == sum.row && p.entry.column == sum.column) {
            sum.mass += p.entry.mass;
            sum.stiffness += p.entry.stiffness;
            continue;
          }
          put();
          sum = p.entry;
          any = true;
        }
      });
      put();
      context.count_written(file.finish());
    } else {
      const ReadFile file(work_ / matrix_file(first_));
      std::vector<CoarseEntry> batch;
      for (std::uint64_t at = 0; at < entries_; at += batch.size()) {
        context.check_stop();
        batch.resize(std::min(kReadEntries, entries_ - at));
        file.read_at(at * sizeof(CoarseEntry), batch.data(), batch.size() * sizeof(CoarseEntry));
        for (const CoarseEntry& e : batch) system.add(e);
      }
    }
    FactorFile line = factor(context, "line", factor_bytes_ / 8);
    FactorFile free = factor(context, "free", factor_bytes_ - factor_bytes_ / 8);
    const std::vector<CoarseValue> values = system.solve(loads, {line, free});
    if (round_ == first_) context.count_written(line.finish() + free.finish());
    save_coarse_solution(context.create(coarse_solution_file(round_)), unknowns, values);
    context.advance(count_.unknowns);
    return {{"unknowns", count_.unknowns},
            {"entries", system.entries()},
            {"systems", system.systems()},
            {"cycles", system.cycles()},
            {"factor_entries", line.size() + free.size()}};
  }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override { return summaries.at(0); }
  std::uint64_t finish_bytes() const override { return kSlackBytes; }

  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names = {coarse_sums_folder(round_) + "/"};
    if (last_) names.push_back(matrix_folder(first_));
    return names;
  }

 private:
  /// Without what a factor may be held in beyond its fronts. The sort is empty when the system is solved.
  std::uint64_t needed_bytes() const {
    return coarse_stage_bytes(options_.order, count_.unknowns, entries_, count_.loads,
                              count_.largest_patch_bytes);
  }
  FactorFile factor(TaskContext& context, const char* part, std::uint64_t memory_bytes) const {
    const std::string name = factor_file(first_, part);
    return round_ == first_ ? FactorFile::create(context.create(name), memory_bytes)
                            : FactorFile::open(work_ / name, memory_bytes);
  }

  std::filesystem::path work_;
  std::size_t round_, first_;
  bool last_;
  CoarseOptions options_;
  std::vector<std::filesystem::path> files_;
  PatchSumsCount count_;
  std::uint64_t entries_ = 0;
  std::uint64_t factor_bytes_ = 0;  ///< for factors in memory
};

}  // namespace

std::uint64_t coarse_sums_bytes(const SmoothRound& rule, std::uint64_t vertices, std::uint64_t faces,
                                std::uint64_t patch_vertices) {
  SmoothRound rows = rule;
  rows.filter.degree = 1;
  const std::uint64_t loaded = tile_loaded_bytes(vertices, faces) + TileState::bytes(vertices);
  return std::max(tile_loading_bytes(vertices, faces),
                  loaded + smooth_bytes(vertices, faces, rows) + kSumsVertexBytes * vertices) +
         kSumsPatchBytes * patch_vertices + kSlackBytes;
}

std::uint64_t coarse_stage_bytes(int order, std::uint64_t unknowns, std::uint64_t entries,
                                 std::uint64_t loads, std::uint64_t patch_bytes) {
  return CoarseSystem::bytes(unknowns, entries, order) +
         std::max(kCoarseSortBytes + patch_bytes,
                  CoarseSystem::solve_bytes(unknowns, order) + 2 * DirectFile::kDefaultBuffer) +
         (sizeof(CoarseUnknown) + sizeof(CoarseValue)) * unknowns +
         (sizeof(PlacedLoad) + sizeof(CoarseLoad)) * loads + kSlackBytes;
}

std::unique_ptr<Stage> make_coarse_sums_stage(const JobState& state, const SmoothPlan& plan,
                                              std::size_t round) {
  return std::make_unique<CoarseSumsStage>(state, plan, round);
}

std::unique_ptr<Stage> make_coarse_stage(const JobState& state, const SmoothPlan& plan, std::size_t round) {
  return std::make_unique<CoarseStage>(state, plan, round);
}

}  // namespace tessera
