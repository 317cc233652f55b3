// The line in which a noisy scan ends, by patches: each moves the vertices that belong to it.
#include <algorithm>

#include "kernels/smooth/border_fairing.h"
#include "stream/files/json.h"
#include "stream/points/plan.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/levels/level_ends.h"
#include "stream/stages/levels/moved_patches.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxFaces =
    80'000;  ///< around one patch: beyond, it is torn to shreds that no line bounds
constexpr std::uint64_t kStripCache = std::uint64_t{12} << 20;
constexpr std::uint64_t kKernelBytes = 360;  ///< of a face, in the kernel and before
constexpr std::uint64_t kBorderEndBytes = std::uint64_t{4} << 20;
/// Cells beside a brick are at most twice as large as its own.
constexpr double kMargin = 2.0 * kBorderHalo;

/// A face with a vertex at the border.
struct EndFace {
  std::array<std::uint64_t, 3> key;
  std::array<Double3, 3> at;
  std::uint32_t patch = 0;
  std::uint32_t border = 0;  ///< bit i: corner i lies at the border
};
struct Strip {
  std::vector<EndFace> faces;
  std::uint64_t bytes() const { return faces.size() * sizeof(EndFace) + 64; }
};

Strip strip_of(const MeshBlock& block, std::size_t patch) {
  std::vector<std::uint8_t> border(block.key.size(), 0);
  for (std::size_t v = 0; v < border.size(); ++v) border[v] = block.vertex_class[v] == VertexClass::kBorder;
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i)
      if (block.face_flags[f] >> i & 1u) border[block.faces[f][i]] = border[block.faces[f][(i + 1) % 3]] = 1;
  Strip strip;
  for (const auto& f : block.faces) {
    if (!border[f[0]] && !border[f[1]] && !border[f[2]]) continue;
    EndFace& face = strip.faces.emplace_back();
    face.patch = static_cast<std::uint32_t>(patch);
    for (std::size_t i = 0; i < 3; ++i) {
      face.key[i] = block.key[f[i]];
      face.at[i] = block.position[f[i]];
      face.border |= static_cast<std::uint32_t>(border[f[i]]) << i;
    }
  }
  return strip;
}

class LevelBorderStage : public Stage {
 public:
  explicit LevelBorderStage(const JobState& state)
      : lift_(level_ends(state).lift),
        store_(open_level_surface(state)),
        cell_(patch_cells(store_, state)),
        first_(patch_runs_of(store_)) {}

  std::string name() const override { return "border"; }
  std::size_t task_count() const override { return lift_ > 0.0 ? first_.size() - 1 : 0; }
  std::uint64_t units() const override { return lift_ > 0.0 ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return level_border_task_bytes(store_.largest_patch_bytes());
  }

  Json run(std::size_t task, TaskContext& context) const override {
    VertexMovesWriter writer(context.create(vertex_moves_file(task)));
    PatchCache<Strip> strips(kStripCache);
    const auto strip = [&](std::size_t p) -> const Strip& {
      return strips.get(p, [&](Strip& out) { out = strip_of(store_.load({&p, 1}), p); });
    };
    std::vector<EndFace> faces;
    std::uint64_t moved = 0, torn = 0;
    for (std::size_t p = first_[task]; p < first_[task + 1]; ++p) {
      context.check_stop();
      context.advance(1);
      if (strip(p).faces.empty()) continue;
      faces.clear();
      const MeshBox near = grown(store_.patches()[p].box, kMargin * cell_[p]);
      for (const std::size_t q : store_.select(near)) {
        for (const EndFace& f : strip(q).faces)
          if (faces.size() <= kMaxFaces && touches(f, near)) faces.push_back(f);
        if (faces.size() > kMaxFaces) break;
      }
      if (faces.size() > kMaxFaces) {
        ++torn;
        continue;
      }
      const std::vector<VertexMove> moves = fair(p, faces);
      writer.add(store_.patches()[p].key, moves);
      moved += moves.size();
    }
    context.count_written(writer.finish());
    return {{"moved_vertices", moved}, {"torn_bricks", torn}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"moved_vertices", 0}, {"torn_bricks", 0}});
  }

 private:
  static bool touches(const EndFace& f, const MeshBox& box) {
    return std::any_of(f.at.begin(), f.at.end(), [&](const Double3& p) { return overlap({p, p}, box); });
  }

  /// Of the vertices of which the patch is the first.
  std::vector<VertexMove> fair(std::size_t patch, const std::vector<EndFace>& faces) const {
    std::vector<std::uint64_t> keys;
    keys.reserve(3 * faces.size());
    for (const EndFace& f : faces) keys.insert(keys.end(), f.key.begin(), f.key.end());
    std::sort(keys.begin(), keys.end());
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    const Double3 corner = store_.patches()[patch].box.low;
    BorderStrip strip;
    strip.position.resize(keys.size());
    strip.at_border.assign(keys.size(), 0);
    strip.cell.assign(keys.size(), 0.0);
    std::vector<std::uint32_t> owner(keys.size(), ~std::uint32_t{0});
    strip.faces.reserve(faces.size());
    for (const EndFace& f : faces) {
      auto& face = strip.faces.emplace_back();
      for (std::size_t i = 0; i < 3; ++i) {
        const auto v =
            static_cast<std::size_t>(std::lower_bound(keys.begin(), keys.end(), f.key[i]) - keys.begin());
        face[i] = static_cast<std::uint32_t>(v);
        strip.position[v] = f.at[i] - corner;
        if (f.border >> i & 1u) strip.at_border[v] = 1;
        const double cell = cell_[f.patch];
        strip.cell[v] = strip.cell[v] == 0.0 ? cell : std::min(strip.cell[v], cell);
        owner[v] = std::min(owner[v], f.patch);
      }
    }
    const std::vector<Double3> before = strip.position;
    fair_border(strip, lift_);
    std::vector<VertexMove> moves;
    for (std::size_t v = 0; v < keys.size(); ++v) {
      if (owner[v] != patch || strip.position[v] == before[v]) continue;
      Double3 to = strip.position[v] + corner;
      if (!store_.info().double_positions)
        for (double& c : to) c = double{static_cast<float>(c)};
      moves.push_back({keys[v], to});
    }
    return moves;
  }

  double lift_;
  MeshStore store_;
  std::vector<double> cell_;
  std::vector<std::size_t> first_;
};

}  // namespace

std::uint64_t level_border_task_bytes(std::uint64_t patch_bytes) {
  return kStripCache + 2 * patch_bytes + kMaxFaces * (sizeof(EndFace) + kKernelBytes) + kBorderEndBytes;
}

std::unique_ptr<Stage> make_level_border_stage(const JobState& state) {
  return std::make_unique<LevelBorderStage>(state);
}

}  // namespace tessera
