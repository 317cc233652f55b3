/// Stage "reach" of smoothing, and what its rounds hand on of the same.
#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/stages/smooth/smooth_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kRangePatches = 64;  ///< patches of one task

class RangeStage : public Stage {
 public:
  RangeStage(const JobState& state, const SmoothPlan& plan) : store_(open_smoothed(state, plan, 0)) {}

  std::string name() const override { return "reach"; }
  std::size_t task_count() const override {
    return (store_.patches().size() + kRangePatches - 1) / kRangePatches;
  }
  std::uint64_t task_bytes(std::size_t) const override {
    return 2 * store_.largest_patch_bytes() + kTileSlackBytes;
  }
  std::uint64_t units() const override { return store_.patches().size(); }
  std::string unit_name() const override { return "patches"; }

  Json run(std::size_t task, TaskContext& context) const override {
    Json edges = Json::array();
    const std::size_t last = std::min(store_.patches().size(), (task + 1) * kRangePatches);
    for (std::size_t p = task * kRangePatches; p < last; ++p) {
      context.check_stop();
      const PatchEdges found = edges_of(store_.load({&p, 1}));
      edges.push_back({p, found.longest, found.squares});
      context.advance(1);
    }
    return {{"edges", std::move(edges)}};
  }
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (store_.face_count() == 0) throw EmptyError("the mesh has no face to smooth");
    save_range(summaries, store_.patches().size(), context.create(range_file(0)));
    return {{"patches", store_.patches().size()}, {"faces", store_.face_count()}};
  }
  std::uint64_t finish_bytes() const override { return kTileSlackBytes + 500 * store_.patches().size(); }

 private:
  MeshStore store_;
};

}  // namespace

std::string range_file(std::size_t round) {
  return (round == 0 ? "reach" : smooth_folder(round)) + "/reach.bin";
}

PatchRange load_range(const std::filesystem::path& work, std::size_t round) {
  return PatchRange::load(work / range_file(round));
}

PatchEdges edges_of(const MeshBlock& block) {
  double longest = 0.0, squares = 0.0;
  for (const auto& face : block.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 &p = block.position[face[k]], &q = block.position[face[(k + 1) % 3]];
      const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      const double square = x * x + y * y + z * z;
      longest = std::max(longest, square);
      squares += square;
    }
  // A last bit more, so that the bound holds however it was rounded.
  return {std::sqrt(longest) * (1.0 + 1e-12), squares};
}

void save_range(const std::vector<Json>& summaries, std::size_t patches, const std::filesystem::path& path) {
  PatchRange range;
  range.longest_edge.resize(patches);
  range.edge_squares.resize(patches);
  for (const Json& s : summaries)
    for (const Json& entry : s.at("edges")) {
      const auto p = entry.at(0).get<std::size_t>();
      range.longest_edge.at(p) = entry.at(1).get<double>();
      range.edge_squares.at(p) = entry.at(2).get<double>();
    }
  range.save(path);
}

std::unique_ptr<Stage> make_range_stage(const JobState& state, const SmoothPlan& plan) {
  return std::make_unique<RangeStage>(state, plan);
}

}  // namespace tessera
