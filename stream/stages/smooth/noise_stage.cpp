/// Stages "noise" and "noise-left" (smooth_before.h): how noisy a mesh is, at a sample of its vertices that its bricks and
/// keys decide.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "kernels/smooth/surface_noise.h"
#include "octree/portable_math.h"
#include "stream/files/durable_file.h"
#include "stream/files/json_text.h"
#include "stream/stages/smooth/smooth_before.h"
#include "stream/stages/smooth/smooth_stage.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kMaxVertices = std::uint64_t{1} << 16;  ///< of all patches that are looked at
constexpr std::uint64_t kShare = 4;                             ///< one vertex of so many is measured there
constexpr std::size_t kTaskPatches = 2;

json to_json(const std::map<int, std::uint64_t>& counts) {
  json out = json::array();
  for (const auto& [number, count] : counts) out.push_back({number, count});
  return out;
}
std::map<int, std::uint64_t> counts_of(const json& list) {
  std::map<int, std::uint64_t> out;
  for (const json& entry : list) out[entry.at(0).get<int>()] = entry.at(1).get<std::uint64_t>();
  return out;
}

class NoiseStage : public Stage {
 public:
  NoiseStage(const JobState& state, const std::string& name, MeshStore mesh)
      : name_(name), store_(std::move(mesh)), edge_(load_range(state.work, 0).edge(store_.face_count())) {
    std::vector<std::size_t> order(store_.patches().size());
    for (std::size_t p = 0; p < order.size(); ++p) order[p] = p;
    const auto order_key = [&](std::size_t p) { return mix(store_.patches()[p].key); };
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return order_key(a) < order_key(b); });
    std::uint64_t vertices = 0;
    for (std::size_t i = 0; i < order.size() && vertices < kMaxVertices; ++i) {
      patches_.push_back(order[i]);
      vertices += store_.patches()[order[i]].vertices;
    }
    std::sort(patches_.begin(), patches_.end());
  }

  std::string name() const override { return name_; }
  std::size_t task_count() const override { return (patches_.size() + kTaskPatches - 1) / kTaskPatches; }
  std::uint64_t units() const override { return patches_.size(); }
  std::string unit_name() const override { return "patches"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t i = first(task); i < first(task + 1); ++i) {
      std::uint64_t vertices = 0, faces = 0;
      for (const std::size_t p : store_.select(grown(store_.box_of({&patches_[i], 1}), margin()))) {
        vertices += store_.patches()[p].vertices;
        faces += store_.patches()[p].faces;
      }
      maximum = std::max(maximum, noise_task_bytes(vertices, faces));
    }
    return maximum;
  }

  json run(std::size_t task, TaskContext& context) const override {
    NoiseCounts counts;
    for (std::size_t i = first(task); i < first(task + 1); ++i) {
      context.check_stop();
      const std::size_t p = patches_[i];
      const MeshHaloBlock near = store_.load_near({&p, 1}, margin());
      std::vector<std::uint8_t> wanted(near.block.key.size(), 0);
      for (const std::uint32_t v : near.core_vertices[0])
        wanted[v] = near.first_patch[v] == p && mix(near.block.key[v]) % kShare == 0;
      counts.add(count_noise(near.block, FaceCorners(near.block), wanted));
      context.advance(1);
    }
    return {{"residual", to_json(counts.residual)},
            {"between", to_json(counts.between)},
            {"vertices", counts.vertices}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{16} << 20; }

  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    NoiseCounts sum;
    for (const json& s : summaries)
      sum.add(
          {counts_of(s.at("residual")), counts_of(s.at("between")), s.at("vertices").get<std::uint64_t>()});
    const json found = {{"noise", sum.noise()}, {"edge", edge_}};
    if (name_ + ".json" == kNoiseFile) write_durably(context.create(kNoiseFile), dump_json(found));
    json out = found;
    out["vertices"] = sum.vertices;
    return out;
  }

 private:
  std::size_t first(std::size_t task) const { return std::min(patches_.size(), task * kTaskPatches); }
  double margin() const { return kNoiseEdges * edge_; }

  std::string name_;
  MeshStore store_;
  double edge_;                       ///< root mean square of the given mesh
  std::vector<std::size_t> patches_;  ///< looked at, ascending
};

}  // namespace

std::uint64_t noise_task_bytes(std::uint64_t vertices, std::uint64_t faces) {
  SmoothRound fits;
  fits.by_fits = true;
  return smooth_tile_bytes(fits, vertices, faces, 0);
}

std::unique_ptr<Stage> make_noise_stage(const JobState& state, const std::string& name, MeshStore mesh) {
  return std::make_unique<NoiseStage>(state, name, std::move(mesh));
}

}  // namespace tessera
