/// Stages "noise-look", "noise" and "noise-left" (smooth_before.h): how noisy a mesh is, at a sample of its vertices that its
/// bricks and keys decide.
#include <algorithm>
#include <filesystem>
#include <span>
#include <vector>

#include "kernels/decimate/auto_tolerance.h"
#include "kernels/smooth/surface_noise.h"
#include "octree/portable_math.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/import/import_plan.h"
#include "stream/stages/smooth/smooth_before.h"
#include "stream/stages/smooth/smooth_plan.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxVertices = std::uint64_t{1} << 16;  ///< of all patches that are looked at
constexpr std::uint64_t kLookVertices =
    kMaxVertices * 3 / 16;  ///< of those of "noise-look", the first of them
constexpr std::uint64_t kJoinedFaces = 2 * ImportPlan::kBrickVertices;  ///< what noise_needs() allows for
constexpr std::uint64_t kShare = 4;  ///< one vertex of so many is measured there

Json to_json(const std::map<int, std::uint64_t>& counts) {
  Json out = Json::array();
  for (const auto& [number, count] : counts) out.push_back({number, count});
  return out;
}
std::map<int, std::uint64_t> counts_of(const Json& list) {
  std::map<int, std::uint64_t> out;
  for (const Json& entry : list) out[entry.at(0).get<int>()] = entry.at(1).get<std::uint64_t>();
  return out;
}

Json to_json(const NoiseCounts& counts) {
  return {{"residual", to_json(counts.residual)},
          {"between", to_json(counts.between)},
          {"vertices", counts.vertices}};
}
NoiseCounts noise_counts_of(const Json& counts) {
  return {counts_of(counts.at("residual")), counts_of(counts.at("between")),
          counts.at("vertices").get<std::uint64_t>()};
}

class NoiseStage : public Stage {
 public:
  NoiseStage(const JobState& state, const std::string& name, MeshStore mesh)
      : name_(name), store_(std::move(mesh)), edge_(load_range(state.work, 0).edge(store_.face_count())) {
    const bool looked = name_ == kNoise && std::filesystem::exists(state.work / kLookFile);
    bool enough = false;
    if (looked) {
      const Json look = parse_json(read_text(state.work / kLookFile));
      before_ = noise_counts_of(look.at("counts"));
      enough = look.at("enough").get<bool>();
    }
    std::vector<std::size_t> order(store_.patches().size());
    for (std::size_t p = 0; p < order.size(); ++p) order[p] = p;
    const auto order_key = [&](std::size_t p) { return mix(store_.patches()[p].key); };
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return order_key(a) < order_key(b); });
    const std::uint64_t maximum = name_ == kNoiseLook ? kLookVertices : kMaxVertices;
    std::uint64_t vertices = 0;
    for (std::size_t i = 0; i < order.size() && vertices < maximum && !enough; ++i) {
      if (!looked || vertices >= kLookVertices) patches_.push_back(order[i]);
      vertices += store_.patches()[order[i]].vertices;
    }
    std::sort(patches_.begin(), patches_.end());
    join_patches();
  }

  std::string name() const override { return name_; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return patches_.size(); }
  std::string unit_name() const override { return "patches"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const Size size = size_around(of_task(task));
    return noise_task_bytes(size.vertices, size.faces);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    context.check_stop();
    const std::span<const std::size_t> core = of_task(task);
    const MeshHaloBlock near = store_.load_near(core, margin());
    std::vector<std::uint8_t> wanted(near.block.key.size(), 0);
    for (std::size_t i = 0; i < core.size(); ++i)
      for (const std::uint32_t v : near.core_vertices[i])
        if (near.first_patch[v] == core[i] && mix(near.block.key[v]) % kShare == 0) wanted[v] = 1;
    const NoiseCounts counts = count_noise(near.block, FaceCorners(near.block), wanted);
    context.advance(core.size());
    return to_json(counts);
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{16} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    NoiseCounts sum = before_;
    for (const Json& s : summaries) sum.add(noise_counts_of(s));
    const Json found = {{"noise", sum.noise()}, {"edge", edge_}};
    if (name_ == kNoise) write_text(context.create(kNoiseFile), dump_json(found));
    if (name_ == kNoiseLook)
      write_text(
          context.create(kLookFile),
          dump_json({{"counts", to_json(sum)}, {"enough", sum.surely_below(auto_tolerance(edge_, 0.0))}}));
    Json out = found;
    out["vertices"] = sum.vertices;
    return out;
  }

 private:
  struct Size {
    std::uint64_t vertices = 0, faces = 0;
  };

  Size size_around(std::span<const std::size_t> patches) const {
    Size size;
    for (const std::size_t p : store_.select(grown(store_.box_of(patches), margin()))) {
      size.vertices += store_.patches()[p].vertices;
      size.faces += store_.patches()[p].faces;
    }
    return size;
  }

  /// Tasks of patches that follow each other: one block serves them where it has fewer faces than theirs apart, as when
  /// bricks are far smaller than edges are long. None gets many, or more than the largest patch has alone.
  void join_patches() {
    std::vector<std::uint64_t> alone;
    for (const std::size_t& p : patches_) alone.push_back(size_around({&p, 1}).faces);
    std::uint64_t maximum = kJoinedFaces;
    for (const std::uint64_t faces : alone) maximum = std::max(maximum, faces);
    std::uint64_t faces = 0;
    for (std::size_t i = 0; i < patches_.size(); ++i) {
      const std::size_t from = first_.empty() ? i : first_.back();
      const std::uint64_t joined =
          i == from ? maximum + 1 : size_around({&patches_[from], i + 1 - from}).faces;
      if (joined > maximum || joined >= faces + alone[i]) {
        first_.push_back(i);
        faces = alone[i];
      } else {
        faces = joined;
      }
    }
    first_.push_back(patches_.size());
  }

  std::span<const std::size_t> of_task(std::size_t task) const {
    return std::span(patches_).subspan(first_[task], first_[task + 1] - first_[task]);
  }
  double margin() const { return kNoiseEdges * edge_; }

  std::string name_;
  MeshStore store_;
  double edge_;                       ///< root mean square of the given mesh
  NoiseCounts before_;                ///< of "noise-look"
  std::vector<std::size_t> patches_;  ///< looked at, ascending
  std::vector<std::size_t> first_;    ///< of each task, in patches_; and their end
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
