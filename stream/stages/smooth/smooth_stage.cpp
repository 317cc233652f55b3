#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "kernels/smooth/flipped_faces.h"
#include "octree/error.h"
#include "octree/rounding.h"
#include "octree/vector.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/contact_regions.h"
#include "stream/stages/smooth/smooth_stages.h"
#include "stream/stages/smooth/smooth_tiles.h"
#include "stream/stages/smooth/smoothed_patch.h"

namespace tessera {
namespace {

constexpr std::uint64_t kLeastRingBytes = std::uint64_t{64} << 20;

/// Of a length that was computed: a bound of the true one.
constexpr double kRounding = 1.0 + 1e-12;

bool ends_step(const SmoothPlan& plan, std::size_t round) {
  const int cycle = plan.rounds[round - 1].cycle;
  return cycle < 0 || cycle + 1 == kCoarseCycles;
}

/// What moved, each vertex counted once over all patches and tiles.
struct Movement {
  std::uint64_t vertices = 0, line = 0, fixed = 0, limited = 0;
  double largest = 0.0;     ///< squared
  double square_sum = 0.0;  ///< over the patches of a task, in their order
};

struct TileCounts {
  std::uint64_t read = 0, degenerate = 0, systems = 0, as_one = 0;  ///< faces, systems solved
};

class SmoothStage : public Stage {
 public:
  SmoothStage(const JobState& state, const SmoothPlan& plan, std::size_t round)
      : round_(round),
        rule_(plan.rounds[round - 1]),
        base_round_(base_round(plan, round)),
        tolerance_(ends_step(plan, round) ? plan.tolerance : 0.0),
        store_(open_smoothed(state, plan, base_round_)),
        before_(open_smoothed(state, plan, round - 1)),
        laplacians_(laplacians_of(state.work, plan, round)),
        mesh_folder_(plan.mesh_folder),
        bounds_(plan.bounds && tolerance_ > 0.0 && round == plan.rounds.size()),
        last_(round == plan.rounds.size()),
        keep_crossings_(plan.keep_crossings),
        fits_(plan.rounds[0].by_fits),
        ends_step_(ends_step(plan, round)),
        original_(open_smoothed(state, plan, from_original() ? 0 : base_round_)) {
    if (rule_.cycle >= 0) {
      coarse_ = coarse_options(state, plan, round);
      rule_.filter.degree = coarse_.degree;
      solution_ = state.work / coarse_solution_file(round);
    }
    tiling_.rings = round_rings(rule_);
    if (rule_.cycle >= 0) {
      ++tiling_.rings;
      tiling_.range = coarse_halo(coarse_);
    }
    tiling_.tile_bricks = state.run.tile_cells / kBrickCells;
    // The rest of the cap is for what the process itself holds.
    tiling_.tile_bytes = state.run.memory_bytes * 13 / 16 / static_cast<std::uint64_t>(state.run.threads);
    const std::uint64_t patch = store_.largest_patch_bytes();
    const std::uint64_t shared = rule_.cycle >= 0 ? coarse_solution_bytes(solution_) : 0;
    tiling_.bytes = [this, patch, shared](std::uint64_t vertices, std::uint64_t faces) {
      return smooth_tile_bytes(rule_, vertices, faces, patch) + shared;
    };
    if (rule_.by_flow) {
      SmoothTile whole;
      whole.patches.resize(store_.patches().size());
      std::iota(whole.patches.begin(), whole.patches.end(), std::size_t{0});
      std::uint64_t vertices = 0;
      for (const MeshPatchEntry& e : store_.patches()) vertices += e.vertices;
      whole.bytes = tiling_.bytes(vertices, store_.face_count());
      tasks_ = {{std::move(whole)}};
      return;
    }
    if (rule_.cycle < 0) {
      std::uint64_t vertices = 0;
      for (const MeshPatchEntry& e : store_.patches()) vertices += e.vertices;
      // Of many threads fewer run at once rather than that rings of some vertex do not fit the share of one.
      const std::uint64_t least = std::min(kLeastRingBytes, largest_guess_bytes(state.run.memory_bytes));
      tiling_.ring_bytes = std::min(std::max(tiling_.tile_bytes, least),
                                    smooth_by_rings_bytes(rule_, vertices, store_.face_count(), patch));
      if (round_edges(rule_) > 0.0) tiling_.few_rings = few_rings(rule_);
    }
    tasks_ = make_smooth_tasks(store_, load_range(state.work, base_round_), tiling_);
  }

  std::string name() const override { return "smooth-" + std::to_string(round_); }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override { return tessera::task_bytes(tasks_[task]); }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create(smooth_folder(round_) + "/" + task_file_stem(task) + ".tmm"),
                          store_.info());
    std::optional<PatchLaplacianWriter> laplacians;
    if (rule_.cycle >= 0 && coarse_.order == 2 && !ends_step_)
      laplacians.emplace(context.create(laplacian_folder(round_) + "/" + task_file_stem(task) + ".bin"));
    Movement moved;
    Json edges = Json::array();
    std::uint64_t core = 0, flipped = 0;
    TileCounts counts;
    const bool searches = last_ && !keep_crossings_;
    std::vector<SearchedTile> searched;
    const auto finish_patch = [&](std::size_t p, const SmoothedPatch& smoothed) {
      core += store_.patches()[p].faces;
      std::vector<Double3> positions = limited_moves(p, smoothed, moved);
      write(p, positions, writer);
      if (laplacians) laplacians->add(p, smoothed.laplacian);
      if (!last_) {
        const PatchEdges found = edges_of(with_positions(p, positions));
        edges.push_back({p, found.longest, found.squares});
      }
      if (fits_ && (round_ == 1 || last_))
        flipped += count_flipped_faces(last_ ? with_positions(p, positions) : store_.load({&p, 1}));
      context.advance(store_.patches()[p].faces);
      return positions;
    };
    for (const SmoothTile& tile : tasks_[task]) {
      if (tile.by_rings) {
        counts.read += smooth_by_rings(
            store_, rule_, tile.patches, tile.bytes, [&] { context.check_stop(); },
            [&](std::size_t p, const SmoothedPatch& smoothed) {
              searched.push_back(unsearched_tile(finish_patch(p, smoothed)));
            });
      } else {
        std::vector<MeshBox> boxes;
        const MeshHaloBlock own =
            each_patch(tile, context, counts, [&](std::size_t p, const SmoothedPatch& smoothed) {
              std::vector<Double3> at_rest = finish_patch(p, smoothed);
              if (searches) boxes.push_back(box_around(at_rest));
              return at_rest;
            });
        if (searches) searched.push_back(search_tile(own.block, own.core, std::move(boxes)));
      }
    }
    if (searches)
      context.count_written(save_searched(
          context.create(smooth_folder(round_) + "/" + task_file_stem(task) + ".met"), searched));
    context.count_written(writer.finish() + (laplacians ? laplacians->finish() : 0));
    return {{"vertices", moved.vertices},
            {"on_lines", moved.line},
            {"fixed", moved.fixed},
            {"limited", moved.limited},
            {"largest_move", std::sqrt(moved.largest)},
            {"square_sum", moved.square_sum},
            {"core_faces", core},
            {"read_faces", counts.read},
            {"degenerate_faces", counts.degenerate},
            {"systems", counts.systems},
            {"faces_as_one", counts.as_one},
            {last_ ? "turned_faces" : "turned_faces_before", flipped},
            {"edges", std::move(edges)}};
  }

  std::uint64_t finish_bytes() const override { return kTileSlackBytes + 500 * store_.patches().size(); }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (!last_) range_of(summaries, store_.patches().size()).save(context.create(range_file(round_)));
    Json out = {{"tasks", summaries.size()}, {"rings", round_rings(rule_)}};
    std::vector<const char*> counts = {"vertices", "on_lines",   "fixed",
                                       "limited",  "core_faces", "read_faces"};
    if (fits_ && (round_ == 1 || last_)) counts.push_back(last_ ? "turned_faces" : "turned_faces_before");
    for (const char* name : counts) {
      std::uint64_t sum = 0;
      for (const Json& s : summaries) sum += s.at(name).get<std::uint64_t>();
      out[name] = sum;
    }
    if (rule_.by_flow)
      for (const char* name : {"systems", "faces_as_one"}) out[name] = summaries.at(0).at(name);
    double largest = 0.0, squares = 0.0;
    for (const Json& s : summaries) {
      largest = std::max(largest, s.at("largest_move").get<double>());
      squares += s.at("square_sum").get<double>();
    }
    out["largest_move"] = largest;
    if (last_) save_longest_move(context.create(moved_file(round_)), largest);
    const auto vertices = out.at("vertices").get<std::uint64_t>();
    out["rms_move"] = vertices > 0 ? std::sqrt(squares / static_cast<double>(vertices)) : 0.0;
    return out;
  }

  std::vector<std::string> obsolete() const override {
    // The step's own start stays to its end; the original to the last round, which tells moves from it, or until vertices have
    // gone back to it.
    const auto stays = [&](std::size_t round) {
      return (round == base_round_ && !ends_step_) || (round == 0 && !(last_ && keep_crossings_));
    };
    std::vector<std::string> names;
    for (const std::size_t round : {round_ - 1, base_round_, std::size_t{0}})
      if (!stays(round)) {
        if (round > 0) names.push_back(smooth_folder(round) + "/");
        if (round == 0 && !mesh_folder_.empty()) names.push_back(mesh_folder_);
      }
    if (rule_.cycle >= 0) names.push_back(coarse_folder(round_) + "/");
    if (!laplacians_.empty()) names.push_back(laplacian_folder(round_ - 1) + "/");
    return names;
  }

 private:
  /// Whether moves are measured, and limited, from the mesh as it is given; else from where the step began.
  bool from_original() const { return tolerance_ > 0.0 || last_; }

  /// Hands out the patches of a tile that its margin holds the rings of.
  /// \param use  tells where the vertices of a patch come to rest   \returns what was loaded, with these at rest
  MeshHaloBlock each_patch(
      const SmoothTile& tile, const TaskContext& context, TileCounts& counts,
      const std::function<std::vector<Double3>(std::size_t, const SmoothedPatch&)>& use) const {
    context.check_stop();
    MeshHaloBlock near = store_.load_near(tile.patches, tile.margin);
    context.check_stop();
    std::vector<std::uint8_t> wanted(near.block.key.size(), 0);
    for (const auto& patch : near.core_vertices)
      for (const std::uint32_t v : patch) wanted[v] = 1;
    const SmoothedBlock smoothed = smooth(near, tile, wanted);
    counts.read += near.core.size();
    counts.degenerate += smoothed.counts.degenerate_faces;
    counts.systems += smoothed.counts.flow_systems;
    counts.as_one += smoothed.counts.faces_as_one;
    std::vector<std::vector<Double3>> at_rest;
    for (std::size_t k = 0; k < tile.patches.size(); ++k) {
      context.check_stop();
      const std::size_t p = tile.patches[k];
      at_rest.push_back(use(p, SmoothedPatch::of(near, k, p, smoothed)));
    }
    for (std::size_t k = 0; k < at_rest.size(); ++k)
      for (std::size_t v = 0; v < at_rest[k].size(); ++v)
        near.block.position[near.core_vertices[k][v]] = at_rest[k][v];
    return near;
  }

  MeshBlock with_positions(std::size_t p, const std::vector<Double3>& positions) const {
    MeshBlock patch = store_.load({&p, 1});
    patch.position = positions;
    return patch;
  }

  void write(std::size_t p, const std::vector<Double3>& positions, MeshFileWriter& writer) const {
    const MeshPatchEntry& entry = store_.patches()[p];
    // A compact patch holds places on the lattice, which its vertices leave.
    if (!bounds_ && (entry.content & kPatchCompact) == 0) return writer.add_moved(store_, p, positions);
    MeshBlock patch = with_positions(p, positions);
    if (bounds_) {
      const MeshBlock given = original_.load({&p, 1});
      patch.face_bound.clear();
      for (const auto& face : patch.faces) {
        double move = 0.0;
        for (const std::uint32_t v : face) move = std::max(move, norm(patch.position[v] - given.position[v]));
        patch.face_bound.push_back(rounded_up(move * kRounding));
      }
    }
    writer.add(entry.key, patch);
  }

  SmoothedBlock smooth(const MeshHaloBlock& near, const SmoothTile& tile,
                       std::span<const std::uint8_t> wanted) const {
    if (rule_.cycle < 0) return smooth_block(near.block, rule_, wanted);
    const TileState state = tile_state(store_, before_, laplacians_, near, tile);
    const CoarseSolution coarse = load_coarse_solution(solution_);
    return smooth_cycle(near.block, state.now, state.laplacian, rule_, coarse_, coarse, wanted);
  }

  /// Where the vertices of a patch come to rest; each is counted once over all patches.
  std::vector<Double3> limited_moves(std::size_t p, const SmoothedPatch& smoothed, Movement& moved) const {
    std::vector<Double3> original;
    if (from_original() && base_round_ > 0) original = original_.load({&p, 1}).position;
    const bool floats = !store_.info().double_positions;
    std::vector<Double3> out(smoothed.key.size());
    for (std::size_t v = 0; v < out.size(); ++v) {
      if (smoothed.complete[v] == 0)
        throw std::logic_error("smooth: vertex " + std::to_string(smoothed.key[v]) +
                               " misses rings in its tile");
      const Double3 &from = original.empty() ? smoothed.from[v] : original[v], &wish = smoothed.position[v];
      const Double3 to = limit_move(from, wish, tolerance_, floats);
      if (!std::isfinite(squared_distance(to, from)))
        throw ValidationError("the vertex at (" + number_text(from[0]) + ", " + number_text(from[1]) + ", " +
                              number_text(from[2]) +
                              ") would move to where no number is: it or a neighbour lies too far away; "
                              "remove or scale what does");
      out[v] = to;
      if (smoothed.first[v] == 0) continue;
      const double x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
      const double square = x * x + y * y + z * z;
      ++moved.vertices;
      moved.line += smoothed.role[v] == VertexRole::kLine;
      moved.fixed += smoothed.role[v] == VertexRole::kFixed;
      moved.largest = std::max(moved.largest, square);
      moved.square_sum += square;
      if (!(tolerance_ > 0.0)) continue;
      const double u = wish[0] - from[0], w = wish[1] - from[1], t = wish[2] - from[2];
      moved.limited += std::sqrt(u * u + w * w + t * t) > tolerance_;
    }
    return out;
  }

  std::size_t round_;
  SmoothRound rule_;
  std::size_t base_round_;
  double tolerance_;          ///< 0 inside a step
  MeshStore store_, before_;  ///< where the step began, where the round begins
  PatchLaplacians laplacians_;
  std::string mesh_folder_;
  bool bounds_, last_, keep_crossings_, fits_,
      ends_step_;       ///< bounds_: in the last round; fits_: turned faces are counted
  MeshStore original_;  ///< of the patches that moves are measured from
  CoarseOptions coarse_;
  std::filesystem::path solution_;
  SmoothTiling tiling_;
  std::vector<SmoothTask> tasks_;
};

}  // namespace

std::unique_ptr<Stage> make_smooth_stage(const JobState& state, const SmoothPlan& plan, std::size_t round) {
  return std::make_unique<SmoothStage>(state, plan, round);
}

}  // namespace tessera
