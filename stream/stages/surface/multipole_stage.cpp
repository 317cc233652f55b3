#include <algorithm>

#include "kernels/closing/area_weights.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/multipole_store.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/surface/closing_stages.h"

namespace tessera {
namespace {

// Block of one brick: 40 bytes a point while loading, weight and dipole.
constexpr std::uint64_t kMultipoleBytesPerPoint = 40 + 4 + sizeof(Dipole);
constexpr std::uint64_t kMultipoleTaskBytes = 12u << 20;

class MultipoleStage : public Stage {
 public:
  explicit MultipoleStage(const JobState& state)
      : store_(PointStore::of_surface(state.work)),
        needed_(HolesMode(reconstruct_options(state).holes).close) {}

  std::string name() const override { return "multipole"; }
  std::size_t task_count() const override { return needed_ ? store_.file_count() : 0; }
  std::uint64_t units() const override { return needed_ ? store_.point_count() : 0; }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t b = first; b < last; ++b) maximum = std::max(maximum, store_.bricks()[b].points);
    return multipole_task_bytes(maximum);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MultipoleFileWriter writer(context.create(std::string(MultipoleStore::kFolder) + "/" +
                                              task_file_stem(task) + MultipoleStore::kExtension));
    std::uint64_t bricks = 0;
    std::uint64_t leaves = 0;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t b = first; b < last; ++b) {
      context.check_stop();
      const BrickEntry& brick = store_.bricks()[b];
      const Int3 at = brick_of_key(brick.key);
      const PointBlock block = store_.load({at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells},
                                           {kBrickCells, kBrickCells, kBrickCells}, 0);
      const MultipoleTree tree(make_dipoles(block), kLeafBits, kLeafBits);
      const auto& cells = tree.level(kLeafBits).cells;
      if (!cells.empty()) {
        writer.brick(cells);
        ++bricks;
        leaves += cells.size();
      }
      context.count_read(brick.points * sizeof(PointRecord));
      context.advance(brick.points);
    }
    context.count_written(writer.finish());
    return {{"bricks", bricks}, {"leaves", leaves}};
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    if (!needed_) return {{"needed", false}};
    std::uint64_t bricks = 0;
    std::uint64_t leaves = 0;
    for (const Json& s : summaries) {
      bricks += s.at("bricks").get<std::uint64_t>();
      leaves += s.at("leaves").get<std::uint64_t>();
    }
    return {{"needed", true}, {"bricks", bricks}, {"leaves", leaves}};
  }

 private:
  PointStore store_;
  bool needed_;
};

}  // namespace

std::uint64_t multipole_task_bytes(std::uint64_t brick_points) {
  return brick_points * kMultipoleBytesPerPoint + kMultipoleTaskBytes;
}

std::unique_ptr<Stage> make_multipole_stage(const JobState& state) {
  return std::make_unique<MultipoleStage>(state);
}

}  // namespace tessera
