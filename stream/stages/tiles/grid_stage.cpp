#include "stream/stages/tiles/grid_stage.h"

#include <algorithm>
#include <cmath>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/tiles/grid_contacts.h"
#include "stream/stages/tiles/level_stage.h"
#include "stream/stages/tiles/tile_levels.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// A tile has fewer steps (quantise_tile).
constexpr std::int64_t kMaxSteps = std::int64_t{1} << 24;

/// What meets by the first grid.
class GridStage : public LevelStage {
 public:
  using LevelStage::LevelStage;
  std::string name() const override { return "grid"; }

  Json run(std::size_t task, TaskContext& context) const override {
    std::uint64_t met = 0;
    std::int64_t widest = 0;
    for (std::size_t c = first(task); c < first(task + 1); ++c) {
      context.check_stop();
      const MeshBlock block = load(cells_[c]);
      const TileMesh tile = quantise_tile(block, grid_, {});
      met += pairs_met_by_grid(block, tile);
      for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, tile.high[k] - tile.low[k]);
      context.count_read(loaded_bytes(cells_[c]));
      context.advance(1);
    }
    return {{"met_by_grid", met}, {"widest", widest}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::int64_t widest = 0;
    std::uint64_t met = 0;
    for (const Json& s : summaries) {
      met += s.at("met_by_grid").get<std::uint64_t>();
      widest = std::max(widest, s.at("widest").get<std::int64_t>());
    }
    write_text(
        context.create(kGrid),
        dump_json(
            Json{{"step", grid_.step}, {"origin", grid_.origin}, {"met_by_grid", met}, {"widest", widest}}));
    return {{"level", level_}, {"grid_step", grid_.step}, {"met_by_grid", met}};
  }
};

/// Counts what meets on every grid that is finer by a power of two, and chooses one.
class FinerGridStage : public LevelStage {
 public:
  FinerGridStage(const fs::path& work, const TilesOptions& options, int level)
      : LevelStage(work, options, level) {
    const Json first = parse_json(read_text(work / level_folder(level) / kGrid));
    met_ = first.at("met_by_grid").get<std::uint64_t>();
    // A vertex lies up to half a step of the first grid outside of where it has the tile.
    const auto widest = first.at("widest").get<std::int64_t>() + 1;
    const double finest = finest_step(level0_.box());
    while ((widest << (halvings_ + 1)) < kMaxSteps && step(halvings_ + 1) >= finest) ++halvings_;
  }
  std::string name() const override { return "finer-grid"; }

  Json run(std::size_t task, TaskContext& context) const override {
    std::vector<std::uint64_t> met(halvings_, 0);
    for (std::size_t c = first(task); c < first(task + 1); ++c) {
      const MeshBlock block = load(cells_[c]);
      for (std::size_t h = 0; h < halvings_; ++h) {
        context.check_stop();
        met[h] += pairs_met_by_grid(block, quantise_tile(block, {grid_.origin, step(h + 1)}, {}));
      }
      context.count_read(loaded_bytes(cells_[c]));
      context.advance(1);
    }
    return {{"met", met}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::vector<std::uint64_t> met(halvings_ + 1, 0);
    met[0] = met_;
    for (const Json& s : summaries)
      for (std::size_t h = 1; h < met.size(); ++h) met[h] += s.at("met").at(h - 1).get<std::uint64_t>();
    // The coarsest of the best: finer ones make larger files.
    const auto best = static_cast<std::size_t>(std::min_element(met.begin(), met.end()) - met.begin());
    write_text(context.create(kFinerGrid), dump_json(Json{{"step", step(best)}, {"met_by_grid", met[best]}}));
    return {{"level", level_}, {"grid_step", step(best)}, {"met_by_grid", met}};
  }

 private:
  double step(std::size_t halvings) const { return std::ldexp(grid_.step, -static_cast<int>(halvings)); }

  std::uint64_t met_ = 0;
  std::size_t halvings_ = 0;
};

}  // namespace

std::unique_ptr<Stage> make_grid_stage(const JobState& state, const TilesOptions& options, int level) {
  return std::make_unique<GridStage>(state.work.parent_path(), options, level);
}

std::unique_ptr<Stage> make_finer_grid_stage(const JobState& state, const TilesOptions& options, int level) {
  if (parse_json(read_text(state.work / kGrid)).at("met_by_grid") == 0) return make_idle_stage("finer-grid");
  return std::make_unique<FinerGridStage>(state.work.parent_path(), options, level);
}

}  // namespace tessera
