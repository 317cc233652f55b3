/// Stages "distances" and "grid" of a field: nodes near the surface of the solids get their distance, leaf by leaf, and the
/// leaves become one level set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/formats/vdb_file.h"
#include "stream/runtime/serial_stage.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/solid/distance_tiles.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr double kHaloCells = 6.0;  ///< cells beyond the band from which faces matter: a leaf's halo
constexpr const char* kLeafSuffix = ".lvl";
constexpr std::size_t kPage = 256;  ///< leaves read at once

class DistancesStage : public Stage {
 public:
  DistancesStage(const JobState& state, const SolidModel& model)
      : band_(model.band), tiles_(state, model.band + kHaloCells, sizeof(Int3)) {}

  std::string name() const override { return "distances"; }
  std::size_t task_count() const override { return tiles_.groups().size(); }
  std::uint64_t units() const override { return tiles_.cubes(); }
  std::string unit_name() const override { return "cubes"; }
  std::uint64_t task_bytes(std::size_t task) const override { return tiles_.task_bytes(task); }

  Json run(std::size_t task, TaskContext& context) const override {
    DirectFile out(context.create("distances/" + task_file_stem(task) + kLeafSuffix));
    std::uint64_t leaves = 0, nodes = 0;
    for (const std::uint64_t cube : tiles_.groups()[task]) {
      for (const Tile& tile : tiles_.tiles_of(cube)) {
        context.check_stop();
        MeshBlock block = tiles_.load(tile);
        if (block.faces.empty()) continue;
        const OffsetSampler sampler(std::move(block), tile.corner(), tiles_.signs(), {}, band_);
        for (const Int3& leaf : sampler.leaves(tile.edges())) {
          bool core = true;
          for (std::size_t a = 0; a < 3; ++a)
            core = core && leaf[a] >= 0 && leaf[a] < tile.edges()[a] / kLeafCells;
          if (!core) continue;
          context.check_stop();
          LevelSetLeaf made;
          for (std::size_t a = 0; a < 3; ++a) made.origin[a] = tile.corner()[a] + kLeafCells * leaf[a];
          const std::uint64_t found = fill(sampler, made);
          if (found == 0) continue;
          out.write(&made, sizeof made);
          ++leaves;
          nodes += found;
        }
      }
      context.advance(1);
    }
    context.count_written(out.finish());
    return {{"leaves", leaves}, {"nodes", nodes}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"band", band_}});
  }
  std::vector<std::string> obsolete() const override {
    // The signs stay: what lies beyond all leaves is known from them.
    std::vector<std::string> names;
    for (std::size_t f = 0; f < tiles_.mesh_files(); ++f)
      names.push_back("solid/" + task_file_stem(f) + ".tmm");
    return names;
  }

 private:
  /// \returns how many nodes are in the band
  std::uint64_t fill(const OffsetSampler& sampler, LevelSetLeaf& leaf) const {
    const auto h = static_cast<float>(tiles_.plan().lattice.h);
    std::uint64_t found = 0;
    for (int x = 0; x < 8; ++x)
      for (int y = 0; y < 8; ++y)
        for (int z = 0; z < 8; ++z) {
          const Int3 node = {leaf.origin[0] + x, leaf.origin[1] + y, leaf.origin[2] + z};
          const auto word = static_cast<std::size_t>(x), bit = static_cast<std::size_t>(8 * y + z);
          if (!sampler.inside(node)) leaf.outside[word] |= std::uint64_t{1} << bit;
          const FieldSampler::Sample s = sampler.at(node, 0, 0.0);
          if (!s.there || std::fabs(s.value) > band_) continue;
          leaf.active[word] |= std::uint64_t{1} << bit;
          leaf.value[64 * word + bit] = static_cast<float>(s.value) * h;
          ++found;
        }
    return found;
  }

  double band_;
  DistanceTiles tiles_;
};

class GridStage : public SerialStage {
 public:
  GridStage(const JobState& state, const SolidModel& model)
      : state_(state),
        band_(model.full ? 0.0 : model.band),
        plan_(Plan::of_work(state.work)),
        files_(list_task_files(state.work / "distances", kLeafSuffix)) {
    for (const auto& path : files_) leaves_ += std::filesystem::file_size(path) / sizeof(LevelSetLeaf);
    for (const auto& path : list_task_files(state.work / "solid", ".sgn"))
      sign_bytes_ += std::filesystem::file_size(path);
  }

  std::string name() const override { return "grid"; }
  std::uint64_t units() const override { return leaves_; }
  std::string unit_name() const override { return "leaves"; }
  std::uint64_t finish_bytes() const override {
    return grid_bytes() + write_level_set_bytes(leaves_) - write_level_set_bytes(0) +
           leaves_ * sizeof(LeafSlot) + 2 * sign_bytes_;
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    std::vector<ReadFile> open;
    open.reserve(files_.size());
    std::vector<Int3> origins;
    std::vector<LeafSlot> slots;
    origins.reserve(leaves_), slots.reserve(leaves_);
    std::uint64_t nodes = 0;
    float farthest = 0.0f;
    for (const auto& path : files_) {
      open.emplace_back(path);
      std::uint64_t at = 0;
      for_each_page<LevelSetLeaf>(path, kPage, [&](auto page) {
        context.check_stop();
        for (const LevelSetLeaf& leaf : page) {
          origins.push_back(leaf.origin);
          slots.push_back({static_cast<std::uint32_t>(open.size() - 1), at});
          at += sizeof(LevelSetLeaf);
          for (const std::uint64_t word : leaf.active)
            nodes += static_cast<std::uint64_t>(std::popcount(word));
          if (band_ == 0.0)
            for (const float v : leaf.value) farthest = std::max(farthest, std::fabs(v));
        }
      });
    }
    if (origins.empty())
      throw EmptyError("no node of the lattice lies near a surface; try a smaller --resolution");
    const RowSigns signs(load_solid_signs(state_.work));
    LevelSetFile file;
    file.lattice = plan_.lattice;
    // What lies beyond a full field is no nearer than the farthest of it.
    file.background =
        band_ > 0.0 ? static_cast<float>(band_) * static_cast<float>(plan_.lattice.h) : farthest;
    file.origins = origins;
    file.load = [&](std::size_t leaf, LevelSetLeaf& to) {
      open[slots[leaf].file].read_at(slots[leaf].offset, &to, sizeof to);
    };
    file.inside = [&](const Int3& node) {
      const LeafWords words = signs.at({node[0] >> kLeafBits, node[1] >> kLeafBits, node[2] >> kLeafBits});
      return (words[static_cast<std::size_t>(node[2] & 7)] >> DirectedField::bit(node[0], node[1]) & 1) != 0;
    };
    file.pause = [&context] { context.check_stop(); };
    const std::uint64_t bytes = write_level_set(state_.output, file);
    context.count_written(bytes);
    context.advance(leaves_);
    return {{"leaves", leaves_}, {"nodes", nodes},       {"band", band_},
            {"bytes", bytes},    {"h", plan_.lattice.h}, {"background", file.background}};
  }

  std::vector<std::string> obsolete() const override { return {"solid/", "distances/"}; }

 private:
  struct LeafSlot {
    std::uint32_t file;
    std::uint64_t offset;
  };
  JobState state_;
  double band_;  ///< cells; 0: all nodes
  Plan plan_;
  std::vector<std::filesystem::path> files_;
  std::uint64_t leaves_ = 0, sign_bytes_ = 0;
};

}  // namespace

std::uint64_t distances_bytes(std::uint64_t near_faces) {
  return DistanceTiles::brick_task_bytes(near_faces, sizeof(Int3));
}
std::uint64_t grid_bytes() {
  return write_level_set_bytes(0) + kPage * sizeof(LevelSetLeaf);
}

std::unique_ptr<Stage> make_distances_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<DistancesStage>(state, model);
}
std::unique_ptr<Stage> make_grid_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<GridStage>(state, model);
}

}  // namespace tessera
