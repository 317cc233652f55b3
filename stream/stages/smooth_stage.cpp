#include "stream/stages/smooth_stage.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "octree/error.h"
#include "stream/mesh_store.h"
#include "stream/stages/import_stages.h"
#include "stream/stages/smooth_tiles.h"
#include "stream/task_files.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kSlackBytes = std::uint64_t{16}
                                      << 20;  ///< buffers of the file that is written, tables
constexpr std::uint64_t kReachPatches = 64;   ///< patches of one task of "reach"

// Key, position, class, colour; corners, flags, bound and core flag.
constexpr std::uint64_t kLoadedVertexBytes = 8 + 24 + 1 + 4;
constexpr std::uint64_t kLoadedFaceBytes = 12 + 1 + 4 + 1;

std::string reach_file(std::size_t round) {
  return smooth_folder(round) + "/reach.bin";
}

MeshStore open_smoothed(const std::filesystem::path& work, std::size_t round) {
  if (round == 0) return open_imported_mesh(work, kSmoothImport);
  return MeshStore(list_task_files(work / smooth_folder(round), ".tmm"));
}

double longest_edge(const MeshBlock& block) {
  double longest = 0.0;
  for (const auto& face : block.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 &p = block.position[face[k]], &q = block.position[face[(k + 1) % 3]];
      const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      longest = std::max(longest, x * x + y * y + z * z);
    }
  // A last bit more, so that the bound holds however it was rounded.
  return std::sqrt(longest) * (1.0 + 1e-12);
}

std::uint64_t largest_patch_bytes(const MeshStore& store) {
  std::uint64_t largest = 0;
  for (std::size_t p = 0; p < store.patches().size(); ++p)
    largest = std::max(largest, store.block_bytes({&p, 1}));
  return largest;
}

/// From [patch, longest edge] of all tasks.
void save_reach(const std::vector<json>& summaries, std::size_t patches, const std::filesystem::path& path) {
  PatchReach reach;
  reach.longest_edge.resize(patches);
  for (const json& s : summaries)
    for (const json& entry : s.at("longest_edge"))
      reach.longest_edge.at(entry.at(0).get<std::size_t>()) = entry.at(1).get<double>();
  reach.save(path);
}

class ReachStage : public Stage {
 public:
  explicit ReachStage(const JobState& state) : store_(open_smoothed(state.work, 0)) {}

  std::string name() const override { return "reach"; }
  std::size_t task_count() const override {
    return (store_.patches().size() + kReachPatches - 1) / kReachPatches;
  }
  std::uint64_t task_bytes(std::size_t) const override {
    return 2 * largest_patch_bytes(store_) + kSlackBytes;
  }
  std::uint64_t units() const override { return store_.patches().size(); }
  std::string unit_name() const override { return "patches"; }

  json run(std::size_t task, TaskContext& context) const override {
    json longest = json::array();
    const std::size_t last = std::min(store_.patches().size(), (task + 1) * kReachPatches);
    for (std::size_t p = task * kReachPatches; p < last; ++p) {
      context.check_stop();
      longest.push_back({p, longest_edge(store_.load({&p, 1}))});
      context.advance(1);
    }
    return {{"longest_edge", std::move(longest)}};
  }
  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    if (store_.face_count() == 0) throw EmptyError("the mesh has no face to smooth");
    save_reach(summaries, store_.patches().size(), context.create(reach_file(0)));
    return {{"patches", store_.patches().size()}, {"faces", store_.face_count()}};
  }
  std::uint64_t finish_bytes() const override { return kSlackBytes + 500 * store_.patches().size(); }

 private:
  MeshStore store_;
};

/// As std::lower_bound; fast where the answer is near `from`, as for keys that ascend along.
template <class Iterator>
Iterator first_not_below(Iterator from, Iterator end, std::uint64_t key) {
  std::ptrdiff_t step = 1;
  while (end - from > step && *(from + step) < key) {
    from += step;
    step *= 2;
  }
  return std::lower_bound(from, end - from > step ? from + step + 1 : end, key);
}

/// What moved, each vertex counted once over all patches and tiles.
struct Movement {
  std::uint64_t vertices = 0, line = 0, fixed = 0, limited = 0;
  double largest = 0.0;
  double square_sum = 0.0;  ///< over the patches of a task, in their order
};

class SmoothStage : public Stage {
 public:
  SmoothStage(const JobState& state, const SmoothPlan& plan, std::size_t round)
      : round_(round),
        rule_(plan.rounds[round - 1]),
        tolerance_(plan.tolerance),
        store_(open_smoothed(state.work, round - 1)),
        original_(open_smoothed(state.work, tolerance_ > 0.0 || round == 1 ? 0 : round - 1)),
        last_(round == plan.rounds.size()) {
    SmoothTiling tiling;
    tiling.rings = round_rings(rule_);
    tiling.tile_bricks = state.run.tile_cells / kBrickCells;
    // The rest of the cap is for what the process itself holds.
    tiling.tile_bytes = state.run.memory_bytes * 13 / 16 / static_cast<std::uint64_t>(state.run.threads);
    const std::uint64_t patch = largest_patch_bytes(store_);
    tiling.bytes = [this, patch](std::uint64_t vertices, std::uint64_t faces) {
      const std::uint64_t loading =
          vertices * MeshStore::kBlockBytesPerVertex + faces * MeshStore::kBlockBytesPerFace;
      const std::uint64_t loaded = vertices * kLoadedVertexBytes + faces * kLoadedFaceBytes;
      return std::max(loading, loaded + smooth_bytes(vertices, faces, rule_) + 4 * vertices) + 3 * patch +
             kSlackBytes;
    };
    tasks_ = make_smooth_tasks(store_, PatchReach::load(state.work / reach_file(round - 1)), tiling);
  }

  std::string name() const override { return "smooth-" + std::to_string(round_); }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t bytes = 0;
    for (const SmoothTile& tile : tasks_[task]) bytes = std::max(bytes, tile.bytes);
    return bytes;
  }

  json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create(smooth_folder(round_) + "/" + task_file_stem(task) + ".tmm"),
                          store_.info());
    Movement moved;
    json longest = json::array();
    std::uint64_t halo = 0, core = 0, degenerate = 0;
    for (const SmoothTile& tile : tasks_[task]) {
      context.check_stop();
      const MeshHaloBlock near = store_.load_near(tile.patches, tile.margin);
      context.check_stop();
      const SmoothedBlock smoothed = smooth_block(near.block, rule_);
      core += static_cast<std::uint64_t>(std::count(near.core.begin(), near.core.end(), 1));
      halo += near.core.size();
      degenerate += smoothed.counts.degenerate_faces;
      const std::vector<std::uint32_t> first_face = first_faces(near.block);
      for (const std::size_t p : tile.patches) {
        context.check_stop();
        const MeshBlock patch = move_patch(p, near.block, smoothed, first_face, moved);
        longest.push_back({p, longest_edge(patch)});
        writer.add(store_.patches()[p].key, patch);
        context.advance(patch.faces.size());
      }
    }
    context.count_written(writer.finish());
    return {{"vertices", moved.vertices},
            {"on_lines", moved.line},
            {"fixed", moved.fixed},
            {"limited", moved.limited},
            {"largest_move", moved.largest},
            {"square_sum", moved.square_sum},
            {"core_faces", core},
            {"read_faces", halo},
            {"degenerate_faces", degenerate},
            {"longest_edge", std::move(longest)}};
  }

  std::uint64_t finish_bytes() const override { return kSlackBytes + 500 * store_.patches().size(); }

  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    save_reach(summaries, store_.patches().size(), context.create(reach_file(round_)));
    json out = {{"tasks", summaries.size()}, {"rings", round_rings(rule_)}};
    for (const char* name : {"vertices", "on_lines", "fixed", "limited", "core_faces", "read_faces"}) {
      std::uint64_t sum = 0;
      for (const json& s : summaries) sum += s.at(name).get<std::uint64_t>();
      out[name] = sum;
    }
    double largest = 0.0, squares = 0.0;
    for (const json& s : summaries) {
      largest = std::max(largest, s.at("largest_move").get<double>());
      squares += s.at("square_sum").get<double>();
    }
    out["largest_move"] = largest;
    const auto vertices = out.at("vertices").get<std::uint64_t>();
    out["rms_move"] = vertices > 0 ? std::sqrt(squares / static_cast<double>(vertices)) : 0.0;
    return out;
  }

  std::vector<std::string> obsolete() const override {
    // The original stays while moves are measured against it.
    if (round_ == 1 && tolerance_ > 0.0 && !last_) return {};
    std::vector<std::string> names = {smooth_folder(round_ - 1) + "/"};
    if (last_ && tolerance_ > 0.0 && round_ > 1) names.push_back(smooth_folder(0) + "/");
    return names;
  }

 private:
  static std::vector<std::uint32_t> first_faces(const MeshBlock& block) {
    std::vector<std::uint32_t> first(block.position.size());
    for (std::size_t f = block.faces.size(); f-- > 0;)
      for (const std::uint32_t v : block.faces[f]) first[v] = static_cast<std::uint32_t>(f);
    return first;
  }

  /// The patch with its vertices where the smoothed block has them.
  MeshBlock move_patch(std::size_t p, const MeshBlock& block, const SmoothedBlock& smoothed,
                       const std::vector<std::uint32_t>& first_face, Movement& moved) const {
    MeshBlock patch = store_.load({&p, 1});
    MeshBlock before;
    if (tolerance_ > 0.0) before = original_.load({&p, 1});
    const std::vector<std::uint32_t> first_here = first_faces(patch);
    const bool floats = !store_.info().double_positions;
    auto at = block.key.begin();
    for (std::size_t v = 0; v < patch.key.size(); ++v) {
      at = first_not_below(at, block.key.end(), patch.key[v]);
      const auto i = static_cast<std::size_t>(at - block.key.begin());
      if (at == block.key.end() || *at != patch.key[v] || smoothed.complete[i] == 0)
        throw std::logic_error("smooth: vertex " + std::to_string(patch.key[v]) +
                               " misses rings in its tile");
      const Double3 from = tolerance_ > 0.0 ? before.position[v] : patch.position[v];
      const Double3 to = settle(from, smoothed.position[i], tolerance_, floats);
      if (same_face(block, first_face[i], patch, first_here[v])) {
        const double x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
        const double square = x * x + y * y + z * z;
        ++moved.vertices;
        moved.line += smoothed.role[i] == VertexRole::kLine;
        moved.fixed += smoothed.role[i] == VertexRole::kFixed;
        moved.largest = std::max(moved.largest, std::sqrt(square));
        moved.square_sum += square;
        const double u = smoothed.position[i][0] - from[0], w = smoothed.position[i][1] - from[1],
                     t = smoothed.position[i][2] - from[2];
        moved.limited += tolerance_ > 0.0 && std::sqrt(u * u + w * w + t * t) > tolerance_;
      }
      patch.position[v] = to;
    }
    return patch;
  }

  /// A vertex is counted where its first face is: once over all patches.
  static bool same_face(const MeshBlock& a, std::uint32_t f, const MeshBlock& b, std::uint32_t g) {
    for (std::size_t k = 0; k < 3; ++k)
      if (a.key[a.faces[f][k]] != b.key[b.faces[g][k]]) return false;
    return true;
  }

  std::size_t round_;
  SmoothRound rule_;
  double tolerance_;
  MeshStore store_;
  MeshStore original_;  ///< of the patches that the tolerance is measured from
  bool last_;
  std::vector<SmoothTask> tasks_;
};

}  // namespace

std::string smooth_folder(std::size_t round) {
  return round == 0 ? kSmoothImport : "smooth-" + std::to_string(round);
}

std::unique_ptr<Stage> make_reach_stage(const JobState& state) {
  return std::make_unique<ReachStage>(state);
}

std::unique_ptr<Stage> make_smooth_stage(const JobState& state, const SmoothPlan& plan, std::size_t round) {
  return std::make_unique<SmoothStage>(state, plan, round);
}

}  // namespace tessera
