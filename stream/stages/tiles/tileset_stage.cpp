#include "stream/stages/tiles/tileset_stage.h"

#include <set>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/import/crs_sidecar.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/tiles/site_frame.h"
#include "stream/stages/tiles/tile_levels.h"
#include "stream/stages/tiles/tileset.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kTilesPerFile = 1000;

class TilesetStage : public SerialStage {
 public:
  explicit TilesetStage(const JobState& state) : state_(state), level0_(open_level(state.work, 0)) {
    for (int level = 0; level <= levels_above(state.work); ++level) {
      levels_.push_back(read_tile_level(state.work, level));
      faces_of_.push_back(open_level(state.work, level).face_count());
      tiles_ += levels_.back().tiles.size();
    }
  }
  std::string name() const override { return "tileset"; }
  std::uint64_t units() const override { return tiles_; }
  std::string unit_name() const override { return "tiles"; }
  std::uint64_t finish_bytes() const override { return tileset_bytes(tiles_); }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const TileTree tree = make_tile_tree(levels_, kTilesPerFile);
    const Double3& origin = levels_[0].grid.origin;
    const Double3& shift = level0_.info().shift;
    Double3 half;
    for (std::size_t k = 0; k < 3; ++k) half[k] = 0.5 * (level0_.box().high[k] - level0_.box().low[k]);
    const SiteFrame frame = site_frame(crs_of_mesh(state_.inputs.at(0)), origin + shift, half);
    const std::vector<double> transform(frame.transform.begin(), frame.transform.end());

    std::uint64_t json_bytes = 0, json_files = 0;
    std::set<std::string> names;
    for (std::size_t l = 0; l < levels_.size(); ++l)
      for (std::size_t t = 0; t < levels_[l].tiles.size(); ++t)
        names.insert(tile_file(static_cast<int>(l), t));
    write_tilesets(tree, transform, level0_.diagonal(),
                   [&](const std::string& name, const std::string& text) {
                     context.check_stop();
                     const fs::path aside = context.create(name.empty() ? kOutputName : kSidecarName + name);
                     write_durably(aside, text);
                     json_bytes += text.size();
                     names.insert(name);
                     names.insert(aside.lexically_relative(state_.output.parent_path()).string());
                     ++json_files;
                   });
    remove_others(names);
    context.count_written(json_bytes);
    context.advance(tiles_);
    return report(tree, frame, json_bytes, json_files);
  }

 private:
  /// Tiles of an older site, and what killed tasks left.
  void remove_others(const std::set<std::string>& names) const {
    const fs::path site = state_.output.parent_path();
    std::vector<fs::path> others;
    for (const auto& entry : fs::recursive_directory_iterator(site / "tiles"))
      if (entry.is_regular_file() && names.count(entry.path().lexically_relative(site).string()) == 0)
        others.push_back(entry.path());
    std::error_code ignored;  // what cannot be deleted only takes space
    for (const fs::path& path : others) fs::remove(path, ignored);
  }

  Json report(const TileTree& tree, const SiteFrame& frame, std::uint64_t json_bytes,
              std::uint64_t json_files) const {
    Json levels = Json::array();
    std::uint64_t bytes = json_bytes, faces = 0, vertices = 0;
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      Json level = {{"tiles", levels_[l].tiles.size()},
                    {"geometric_error", tree.error[l]},
                    {"method", level_method_name(state_.work, static_cast<int>(l))},
                    {"faces_of_level", faces_of_[l]},
                    {"step_bound", levels_[l].step_bound},
                    {"grid_step", levels_[l].grid.step},
                    {"met_by_grid", levels_[l].met_by_grid},
                    {"met_by_first_grid", levels_[l].met_by_first_grid}};
      std::uint64_t level_bytes = 0, level_faces = 0;
      for (const TileRecord& tile : levels_[l].tiles) {
        level_bytes += tile.bytes;
        level_faces += tile.faces;
        vertices += tile.vertices;
      }
      level["faces"] = level_faces;
      level["bytes"] = level_bytes;
      if (!levels_[l].texture.empty()) level["texture"] = levels_[l].texture;
      bytes += level_bytes;
      faces += level_faces;
      levels.push_back(std::move(level));
    }
    Json frame_report = {{"geocentric", frame.geocentric}, {"transform", frame.transform}};
    if (!frame.crs.empty()) frame_report["system"] = json_text(frame.crs);
    if (frame.geocentric) frame_report["misfit_m"] = frame.misfit_m;
    Json warnings = Json::array();
    if (!frame.warning.empty()) warnings.push_back(frame.warning);
    if (const TileLevel& finest = levels_.front(); finest.met_by_grid > 0)
      warnings.push_back(std::to_string(finest.met_by_grid) +
                         " pairs of faces of the finest tiles came to cross, overlap or touch by the grid of "
                         "their positions, steps of " +
                         number_text(finest.grid.step) +
                         ": tiles are for looking at; take the mesh for anything else");
    return {{"path", json_text(state_.output)},
            {"frame", std::move(frame_report)},
            {"warnings", std::move(warnings)},
            {"tiles", tiles_},
            {"tilesets", json_files},
            {"bytes", bytes},
            {"faces", level0_.face_count()},
            {"faces_of_all_levels", faces},
            {"vertices_of_all_levels", vertices},
            {"bytes_per_face", static_cast<double>(bytes) / static_cast<double>(level0_.face_count())},
            {"levels", std::move(levels)}};
  }

  JobState state_;
  MeshStore level0_;
  std::vector<TileLevel> levels_;
  std::vector<std::uint64_t> faces_of_;  ///< per level, each once
  std::uint64_t tiles_ = 0;
};

}  // namespace

std::uint64_t tileset_bytes(std::uint64_t tiles) {
  // Nodes of all, the JSON of one file with the ones that it is made of, PROJ.
  return tiles * sizeof(TileNode) + (std::uint64_t{32} << 20);
}

std::unique_ptr<Stage> make_tileset_stage(const JobState& state) {
  return std::make_unique<TilesetStage>(state);
}

}  // namespace tessera
