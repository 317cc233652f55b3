/// Stages "distances" of a full field, and "cells" and "octree" of an adaptive one: the whole box of the solids, cube by
/// cube, from exact distances.
#include <algorithm>
#include <bit>
#include <cmath>

#include "kernels/solid/distance_octree.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/formats/octree_file.h"
#include "stream/formats/vdb_file.h"
#include "stream/points/plan.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/serial_stage.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/solid/solid_stages.h"
#include "stream/stages/solid/surface_distance.h"

namespace tessera {
namespace {

constexpr int kCube = kBrickCells;  ///< edge of an octree, nodes
constexpr std::size_t kMaxTasks = 400;
constexpr std::uint64_t kFixedTaskBytes = std::uint64_t{12} << 20;  ///< write buffers, values kept of a brick
/// Of an octree: where it is measured, at most; fewer in small ones.
constexpr std::uint64_t kSamples = 4000;
constexpr std::size_t kOctreePage = std::size_t{1} << 20;
constexpr const char* kLeaves = ".lvl";
constexpr const char* kOctrees = ".oct";

/// A random number of a point, the same in every run.
double chance(std::uint64_t cube, std::uint64_t sample, std::uint64_t axis) {
  std::uint64_t x = cube * 0x9e3779b97f4a7c15ULL + sample * 3 + axis + 1;
  for (int round = 0; round < 3; ++round) x = (x ^ x >> 29) * 0xbf58476d1ce4e5b9ULL;
  return static_cast<double>((x ^ x >> 32) >> 11) * 0x1p-53;
}

/// The box of the solids in cubes, and who knows distances.
class BoxOfSolids {
 public:
  explicit BoxOfSolids(const JobState& state)
      : plan_(Plan::of_work(state.work)),
        mesh_(open_solid_mesh(state.work)),
        signs_(load_solid_signs(state.work)),
        tree_(mesh_, plan_.lattice),
        mesh_files_(list_task_files(state.work / "solid", ".tmm").size()) {
    if (mesh_.patches().empty())
      throw EmptyError("no node of the lattice lies near a surface; try a smaller --resolution");
    for (std::size_t a = 0; a < 3; ++a) {
      low_[a] = plan_.brick_min[a] * kBrickCells;
      high_[a] = (plan_.brick_max[a] + 1) * kBrickCells;
    }
    const std::uint64_t share = state.run.memory_bytes / 2 / static_cast<std::uint64_t>(state.run.threads);
    kept_bytes_ = std::min(std::max(2 * tree_.largest_patch_bytes(), share), tree_.all_bytes());
  }

  const Plan& plan() const { return plan_; }
  const Int3& low() const { return low_; }
  const Int3& high() const { return high_; }  ///< nodes [low, high), bricks
  /// Bricks of the box, x fastest, as many to a task as to any other.
  std::uint64_t cubes() const { return along(0) * along(1) * along(2); }
  std::size_t tasks() const { return std::min<std::uint64_t>(kMaxTasks, cubes()); }
  std::uint64_t first_cube(std::size_t task) const { return cubes() * task / tasks(); }
  Int3 corner(std::uint64_t cube) const {
    return {low_[0] + static_cast<int>(cube % along(0)) * kCube,
            low_[1] + static_cast<int>(cube / along(0) % along(1)) * kCube,
            low_[2] + static_cast<int>(cube / along(0) / along(1)) * kCube};
  }
  SurfaceDistance distance() const { return {tree_, signs_, kept_bytes_}; }
  std::uint64_t task_bytes() const {
    return kept_bytes_ + tree_.largest_patch_bytes() + tree_.bytes() + signs_.bytes() + kFixedTaskBytes;
  }
  /// The signs stay: what lies beyond all leaves is known from them.
  std::vector<std::string> surface_files() const {
    std::vector<std::string> names;
    for (std::size_t f = 0; f < mesh_files_; ++f) names.push_back("solid/" + task_file_stem(f) + ".tmm");
    return names;
  }

 private:
  Plan plan_;
  MeshStore mesh_;
  RowSigns signs_;
  PatchTree tree_;
  std::size_t mesh_files_;
  std::uint64_t along(std::size_t axis) const {
    return static_cast<std::uint64_t>(high_[axis] - low_[axis]) / kCube;
  }
  Int3 low_{}, high_{};
  std::uint64_t kept_bytes_ = 0;
};

class FarStage : public Stage {
 public:
  explicit FarStage(const JobState& state) : box_(state) {}
  std::size_t task_count() const override { return box_.tasks(); }
  std::uint64_t units() const override { return box_.cubes(); }
  std::string unit_name() const override { return "cubes"; }
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  std::vector<std::string> obsolete() const override { return box_.surface_files(); }

 protected:
  BoxOfSolids box_;
};

class FarDistancesStage : public FarStage {
 public:
  using FarStage::FarStage;
  std::string name() const override { return "distances"; }
  std::uint64_t task_bytes(std::size_t) const override { return box_.task_bytes(); }

  Json run(std::size_t task, TaskContext& context) const override {
    DirectFile out(context.create("distances/" + task_file_stem(task) + kLeaves));
    SurfaceDistance distance = box_.distance();
    std::uint64_t leaves = 0;
    for (std::uint64_t cube = box_.first_cube(task); cube < box_.first_cube(task + 1); ++cube) {
      const Int3 first = box_.corner(cube);
      LevelSetLeaf leaf;
      Int3& at = leaf.origin;
      for (at[2] = first[2]; at[2] < first[2] + kCube; at[2] += kLeafCells)
        for (at[1] = first[1]; at[1] < first[1] + kCube; at[1] += kLeafCells)
          for (at[0] = first[0]; at[0] < first[0] + kCube; at[0] += kLeafCells) {
            context.check_stop();
            fill(distance, leaf);
            out.write(&leaf, sizeof leaf);
            ++leaves;
          }
      context.advance(1);
    }
    context.count_written(out.finish());
    return {{"leaves", leaves}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries);
  }

 private:
  void fill(SurfaceDistance& distance, LevelSetLeaf& leaf) const {
    const double h = box_.plan().lattice.h;
    for (int x = 0; x < 8; ++x) {
      const auto word = static_cast<std::size_t>(x);
      leaf.active[word] = ~std::uint64_t{0};
      leaf.outside[word] = 0;
      for (int y = 0; y < 8; ++y)
        for (int z = 0; z < 8; ++z) {
          const Int3 node = {leaf.origin[0] + x, leaf.origin[1] + y, leaf.origin[2] + z};
          const auto bit = static_cast<std::size_t>(8 * y + z);
          leaf.outside[word] |= static_cast<std::uint64_t>(!distance.inside(node)) << bit;
          leaf.value[64 * word + bit] = static_cast<float>(distance.at(node) * h);
        }
    }
  }
};

class CellsStage : public FarStage {
 public:
  CellsStage(const JobState& state, const SolidModel& model)
      : FarStage(state), tolerance_(model.tolerance / box_.plan().lattice.h) {
    if (tolerance_ < kMinTolerance)
      throw UsageError("--tolerance " + number_text(model.tolerance) +
                       ": cells are no smaller than those of the lattice, " +
                       number_text(box_.plan().lattice.h) +
                       " wide, which do not keep it: give a --resolution of at most " +
                       number_text(model.tolerance / kMinTolerance));
  }
  std::string name() const override { return "cells"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return box_.task_bytes() + distance_octree_bytes(std::uint64_t{kCube} * kCube * kCube);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    DirectFile out(context.create("distances/" + task_file_stem(task) + kOctrees));
    SurfaceDistance distance = box_.distance();
    const std::function<double(const Int3&)> at = [&](const Int3& node) { return distance.at(node); };
    const std::function<void()> pause = [&] { context.check_stop(); };
    Json sum = {{"cells", 0}, {"nodes", 0}, {"samples", 0}};
    std::vector<std::uint64_t> sizes;
    double worst = 0.0, squares = 0.0;
    for (std::uint64_t cube = box_.first_cube(task); cube < box_.first_cube(task + 1); ++cube) {
      const DistanceOctree tree = build_distance_octree(box_.corner(cube), kCube, tolerance_, at, pause);
      const OctreeRecord record = {tree.corner(), tree.edge(), tree.nodes(), tree.cells().size()};
      out.write(&record, sizeof record);
      out.write(tree.halved().data(), tree.halved().size() * sizeof(std::uint64_t));
      out.write(tree.cells().data(), tree.cells().size() * sizeof tree.cells()[0]);
      sum["cells"] = sum["cells"].get<std::uint64_t>() + tree.cells().size();
      sum["nodes"] = sum["nodes"].get<std::uint64_t>() + tree.nodes();
      const std::vector<std::uint64_t> of_tree = tree.sizes();
      sizes.resize(std::max(sizes.size(), of_tree.size()), 0);
      for (std::size_t k = 0; k < of_tree.size(); ++k) sizes[k] += of_tree[k];
      measure(tree, cube, distance, sum, worst, squares);
      context.advance(1);
    }
    context.count_written(out.finish());
    sum["sizes"] = sizes;
    sum["worst"] = worst;
    sum["squares"] = squares;
    return sum;
  }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    const double h = box_.plan().lattice.h;
    std::uint64_t cells = 0, nodes = 0, samples = 0;
    std::vector<std::uint64_t> sizes;
    double worst = 0.0, squares = 0.0;
    for (const Json& s : summaries) {
      cells += s.at("cells").get<std::uint64_t>();
      nodes += s.at("nodes").get<std::uint64_t>();
      samples += s.at("samples").get<std::uint64_t>();
      worst = std::max(worst, s.at("worst").get<double>());
      squares += s.at("squares").get<double>();
      const auto of_task = s.at("sizes").get<std::vector<std::uint64_t>>();
      sizes.resize(std::max(sizes.size(), of_task.size()), 0);
      for (std::size_t k = 0; k < of_task.size(); ++k) sizes[k] += of_task[k];
    }
    std::uint64_t grid = sizeof(float);
    for (std::size_t a = 0; a < 3; ++a)
      grid *= static_cast<std::uint64_t>(box_.high()[a] - box_.low()[a]) + 1;
    return {{"cells", cells},
            {"nodes", nodes},
            {"cells_by_size", sizes},
            {"full_grid_bytes", grid},
            {"samples", samples},
            {"worst_error", worst * h},
            {"rms_error", samples > 0 ? std::sqrt(squares / static_cast<double>(samples)) * h : 0.0}};
  }

 private:
  static constexpr double kMinTolerance = 2.0 * kBetweenNodes;  ///< cells

  /// At places that have nothing to do with nodes. Sides are those of the nearest node, where the surface does not pass
  /// between; else both sides are taken for right.
  void measure(const DistanceOctree& tree, std::uint64_t cube, SurfaceDistance& distance, Json& sum,
               double& worst, double& squares) const {
    std::uint64_t taken = 0;
    for (std::uint64_t s = 0; s < std::min<std::uint64_t>(kSamples, 4 * tree.cells().size()); ++s) {
      Double3 p;
      Int3 node;
      for (std::size_t a = 0; a < 3; ++a) {
        p[a] = tree.corner()[a] + tree.edge() * chance(cube, s, a);
        node[a] = static_cast<int>(std::floor(p[a] + 0.5));
      }
      const double away = distance.away(p);
      double between = 0.0;
      for (std::size_t a = 0; a < 3; ++a) between += (p[a] - node[a]) * (p[a] - node[a]);
      const double found = tree.at(p);
      const double error = away * away > between ? std::fabs(found - (distance.inside(node) ? -away : away))
                                                 : std::fabs(std::fabs(found) - away);
      worst = std::max(worst, error);
      squares += error * error;
      ++taken;
    }
    sum["samples"] = sum["samples"].get<std::uint64_t>() + taken;
  }

  double tolerance_;
};

class OctreeStage : public SerialStage {
 public:
  OctreeStage(const JobState& state, const SolidModel& model)
      : state_(state),
        tolerance_(model.tolerance),
        plan_(Plan::of_work(state.work)),
        files_(list_task_files(state.work / "distances", kOctrees)) {
    for (const auto& path : files_) bytes_ += std::filesystem::file_size(path);
  }
  std::string name() const override { return "octree"; }
  std::uint64_t units() const override { return bytes_; }
  std::string unit_name() const override { return "bytes"; }
  std::uint64_t finish_bytes() const override { return octree_bytes(); }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    OutputFile out(state_.output);
    OctreeFileHeader header;
    header.h = plan_.lattice.h;
    header.tolerance = tolerance_;
    for (int a = 0; a < 3; ++a) header.origin[static_cast<std::size_t>(a)] = plan_.lattice.world(a, 0.0);
    out.append(&header, sizeof header);
    for (const auto& path : files_)
      for_each_page<char>(path, kOctreePage, [&](auto page) {
        context.check_stop();
        out.append(page.data(), page.size());
        context.advance(page.size());
      });
    const std::uint64_t bytes = out.size();
    out.finish();
    context.count_written(bytes);
    return {{"bytes", bytes}, {"h", plan_.lattice.h}, {"tolerance", tolerance_}};
  }

  std::vector<std::string> obsolete() const override { return {"solid/", "distances/"}; }

 private:
  JobState state_;
  double tolerance_;
  Plan plan_;
  std::vector<std::filesystem::path> files_;
  std::uint64_t bytes_ = 0;
};

}  // namespace

std::uint64_t far_distances_bytes(std::uint64_t brick_faces) {
  return 3 * PatchTree::patch_bytes(brick_faces / 2, brick_faces) + kFixedTaskBytes;
}
std::uint64_t cells_bytes(std::uint64_t brick_faces) {
  return far_distances_bytes(brick_faces) + distance_octree_bytes(std::uint64_t{kCube} * kCube * kCube);
}
std::uint64_t octree_bytes() {
  return OutputFile::kBufferBytes + 2 * kOctreePage;
}

std::unique_ptr<Stage> make_far_distances_stage(const JobState& state, const SolidModel&) {
  return std::make_unique<FarDistancesStage>(state);
}
std::unique_ptr<Stage> make_cells_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<CellsStage>(state, model);
}
std::unique_ptr<Stage> make_octree_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<OctreeStage>(state, model);
}

}  // namespace tessera
