#include "stream/stages/surface/levels_stage.h"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "kernels/points/density_levels.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/plan.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_store.h"
#include "stream/stages/surface/level_files.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSplitBytesPerPoint = 40 + 13 + 8;  ///< of a brick: loaded, places, split nodes
constexpr double kMinNoise = 1.5;  ///< cells are no smaller than this many times the noise

class LevelsStage : public Stage {
 public:
  explicit LevelsStage(const JobState& state)
      : work_(state.work),
        levels_(static_cast<int>(reconstruct_options(state).levels)),
        plan_(Plan::of_work(state.work)),
        store_(PointStore::of_surface(state.work)) {
    for (std::size_t a = 0; a < 3; ++a)
      if ((std::int64_t{plan_.brick_max[a]} + 2) * kBrickCells << (levels_ - 1) > 1 << kMaxCellBits)
        throw UsageError("--levels " + std::to_string(levels_) +
                         ": the finest lattice would have more than 2^20 cells along an axis; take fewer "
                         "levels or a coarser --resolution");
    // Noise that cells do not average would become relief.
    double cells = 1.0;
    for (min_ = levels_ - 1; min_ > 0 && 0.5 * cells >= kMinNoise * plan_.noise_cells; --min_) cells *= 0.5;
  }

  std::string name() const override { return "levels"; }
  std::size_t task_count() const override { return store_.file_count(); }
  std::uint64_t units() const override { return store_.point_count(); }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    std::uint64_t maximum = 0;
    for (std::size_t b = first; b < last; ++b) maximum = std::max(maximum, store_.bricks()[b].points);
    return maximum * kSplitBytesPerPoint + (std::uint64_t{2} << 20);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    std::vector<SplitNode> nodes;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t b = first; b < last; ++b) {
      context.check_stop();
      const BrickEntry& entry = store_.bricks()[b];
      const Int3 brick = brick_of_key(entry.key);
      const PointBlock points =
          store_.load({brick[0] * kBrickCells, brick[1] * kBrickCells, brick[2] * kBrickCells},
                      {kBrickCells, kBrickCells, kBrickCells}, 0);
      for (const DensityNode& n : split_by_density(points, brick, levels_, min_))
        nodes.push_back({static_cast<std::uint64_t>(n.level), brick_key(n.at)});
      context.count_read(entry.points * sizeof(PointRecord));
      context.advance(entry.points);
    }
    context.count_written(save_split_nodes(context.create(split_nodes_file(task)), nodes));
    return Json::object();
  }

  std::uint64_t finish_bytes() const override {
    std::uint64_t bytes = std::uint64_t{1} << 20;
    for (const auto& file : list_task_files(work_ / kLevelFolder, ".tsl"))
      bytes += 8 * std::filesystem::file_size(file);
    return bytes;
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    std::vector<SplitNode> nodes;
    for (const auto& file : list_task_files(work_ / kLevelFolder, ".tsl")) {
      const std::vector<SplitNode> part = load_split_nodes(file);
      nodes.insert(nodes.end(), part.begin(), part.end());
    }
    const LevelTree tree = make_level_tree(levels_, nodes);
    nodes.clear();
    Json split = Json::array();
    for (int level = levels_ - 1; level > 0; --level) {
      for (const std::uint64_t key : tree.split()[static_cast<std::size_t>(level)])
        nodes.push_back({static_cast<std::uint64_t>(level), key});
      split.push_back(tree.split()[static_cast<std::size_t>(level)].size());
    }
    context.count_written(save_split_nodes(context.create(kLevelTreeFile), nodes));
    Json result = {{"levels", levels_}, {"noise_levels", levels_ - min_}, {"split", split}};
    if (min_ > 0)
      result["warnings"].push_back(fmt::format(
          "--levels {}: {} used; cells below {:.3g} times the noise ({:.3g} of h) would show it as "
          "relief",
          levels_, levels_ - min_, kMinNoise, plan_.noise_cells));
    return result;
  }

 private:
  std::filesystem::path work_;
  int levels_, min_ = 0;
  Plan plan_;
  PointStore store_;
};

}  // namespace

std::unique_ptr<Stage> make_levels_stage(const JobState& state) {
  return std::make_unique<LevelsStage>(state);
}

}  // namespace tessera
