/// Stage "cover" of a merge: decides of every face whether it stays, is made anew in the band, or goes because a better mesh
/// covers it.
#include <algorithm>
#include <cmath>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/edge_faces.h"
#include "stream/files/direct_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kPage = 1u << 15;
constexpr double kMarginEdges = 8.0;  ///< halo, in mean edge lengths: what lies farther away decides nothing
constexpr int kCutRings = 4;          ///< faces around a cut that "zip" may take away

enum class Disposition : std::uint8_t { kStays, kBand, kCovered };

std::string leaves_part(std::size_t task) {
  return "leaves/" + task_file_stem(task) + ".key";
}

std::uint64_t cover_task_bytes(const MeshSize& patch, std::uint64_t near_bytes, bool alone) {
  // The meshes around, the halo of its own twice, leaves of the band.
  return 2 * MeshStore::block_bytes(patch.vertices, patch.faces) +
         (alone ? 0 : 2 * near_bytes + 64 * patch.faces + (std::uint64_t{8} << 20)) +
         3 * DirectFile::kDefaultBuffer + (std::uint64_t{2} << 20);
}

std::uint64_t cover_finish_bytes(const RunOptions& run) {
  return sort_bytes(run) + 2 * kPage * sizeof(std::uint64_t) + DirectFile::kDefaultBuffer +
         (std::uint64_t{4} << 20);
}

class CoverStage : public MergeFacesStage {
 public:
  explicit CoverStage(const JobState& state) : MergeFacesStage(state, true) {}

  std::string name() const override { return "cover"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const MergeTask& t = tasks_[task];
    const MeshStore& store = meshes_.store(t.rank);
    std::uint64_t maximum = 0;
    for (std::size_t p = t.first; p < t.end; ++p) {
      const MeshPatchEntry& e = store.patches()[p];
      const bool alone = meshes_.is_alone(t.rank, e.box);
      maximum = std::max(
          maximum,
          cover_task_bytes({e.vertices, e.faces},
                           alone ? 0 : meshes_.near_bytes(e.box, halo(t.rank) + meshes_.plan().range.apart),
                           alone));
    }
    return maximum + meshes_.shared_bytes();
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const MergeTask& t = tasks_[task];
    const MeshStore& store = meshes_.store(t.rank);
    const std::string file = task_file_stem(task) + ".tmm";
    MeshFileWriter kept(context.create("kept/" + file), meshes_.plan().info);
    MeshFileWriter near_cut(context.create("rims/" + file), meshes_.plan().info);
    DirectFile leaves(context.create(leaves_part(task)));
    std::uint64_t stay = 0, band = 0, covered = 0;
    for (std::size_t p = t.first; p < t.end; ++p) {
      context.check_stop();
      const MeshPatchEntry& e = store.patches()[p];
      context.advance(e.faces);
      const std::uint64_t brick = merged_brick(t.rank, e.key);
      if (meshes_.is_alone(t.rank, grown(e.box, halo(t.rank)))) {
        MeshBlock block = store.load({&p, 1});
        dress(t.rank, block);
        kept.add(brick, block);
        stay += e.faces;
        continue;
      }
      const MeshHaloBlock near = store.load_near({&p, 1}, halo(t.rank));
      const std::vector<Disposition> disposition = judge(t.rank, near.block, context);
      std::vector<std::uint8_t> stays(disposition.size(), 0);
      std::vector<std::uint64_t> keys;
      for (std::size_t f = 0; f < disposition.size(); ++f) {
        if (!near.core[f]) continue;
        stays[f] = disposition[f] == Disposition::kStays;
        (disposition[f] == Disposition::kStays  ? stay
         : disposition[f] == Disposition::kBand ? band
                                                : covered) += 1;
        if (disposition[f] == Disposition::kBand) add_leaves(near.block, near.block.faces[f], keys);
      }
      std::sort(keys.begin(), keys.end());
      keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
      leaves.write(keys.data(), keys.size() * sizeof(std::uint64_t));
      MeshBlock rest = select_faces(near.block, stays);
      dress(t.rank, rest);
      kept.add(brick, rest);
      MeshBlock around = select_near_cut(near, disposition);
      dress(t.rank, around);
      near_cut.add(brick, around);
    }
    context.count_written(kept.finish() + near_cut.finish() + leaves.finish());
    return {{"rank", t.rank}, {"stay", stay}, {"band", band}, {"covered", covered}};
  }

  std::uint64_t finish_bytes() const override { return cover_finish_bytes(state_.run); }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    ExternalSort<std::uint64_t> sort(state_.work, sort_bytes(state_.run));
    std::uint64_t stay = 0, band = 0, covered = 0;
    std::vector<std::uint8_t> touched(meshes_.count(), 0);
    for (std::size_t t = 0; t < tasks_.size(); ++t) {
      const auto count = [&](const char* key) { return summaries[t].at(key).get<std::uint64_t>(); };
      stay += count("stay");
      band += count("band");
      covered += count("covered");
      if (count("band") + count("covered") > 0) touched[tasks_[t].rank] = 1;
      for_each_page<std::uint64_t>(state_.work / leaves_part(t), kPage, [&](auto page) {
        for (const std::uint64_t key : page) sort.add(key);
      });
    }
    PackedWriter out(context.create(kLeavesFile), kLeavesKind);
    std::vector<Section> sections;
    std::vector<std::uint64_t> unique;
    std::uint64_t leaves = 0, last = ~std::uint64_t{0};
    sort.drain([&](std::span<const std::uint64_t> batch) {
      unique.clear();
      for (const std::uint64_t key : batch)
        if (key != last) unique.push_back(last = key);
      leaves += unique.size();
      if (!unique.empty()) sections.push_back(out.append(bytes_of(unique)));
    });
    context.count_written(out.finish(sections));
    Json result = {{"stay", stay}, {"band", band}, {"covered", covered}, {"leaves", leaves}};
    Json warnings = Json::array();
    for (std::size_t r = 0; r < touched.size(); ++r)
      if (!touched[r])
        warnings.push_back(
            state_.inputs[meshes_.plan().order[r]].string() +
            ": no other mesh overlaps it, it stays a piece of its own; if one should, try a larger "
            "--distance");
    if (!warnings.empty()) result["warnings"] = warnings;
    return result;
  }

  std::vector<std::string> obsolete() const override { return {"leaves/"}; }

 private:
  double halo(std::size_t rank) const { return kMarginEdges * meshes_.plan().edge[rank]; }

  /// Gives a block the keys and the colours of the merged mesh.
  void dress(std::size_t rank, MeshBlock& block) const {
    for (std::uint64_t& key : block.key) key = merged_vertex(rank, key);
    if (meshes_.plan().info.colour && block.rgba.empty()) block.rgba.assign(block.key.size(), 0);
  }

  std::vector<Disposition> judge(std::size_t rank, const MeshBlock& block, TaskContext& context) const {
    MeshBox box{block.position[0], block.position[0]};
    for (const Double3& p : block.position)
      for (std::size_t a = 0; a < 3; ++a)
        box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
    const MergePlan& plan = meshes_.plan();
    const MergeMeshes::Near near = meshes_.load(box, plan.range.apart, rank, &block);
    const MergeBlend blend(near.pointers(), plan.range);
    const SignedDistance& own = near.sheets[rank]->surface();
    std::vector<int> owner(block.position.size());
    for (std::size_t v = 0; v < owner.size(); ++v) {
      if (v % 1024 == 0) context.check_stop();
      owner[v] = blend.owner(block.position[v] - plan.origin, static_cast<int>(rank),
                             unit_or_zero(own.vertex_normal(static_cast<std::uint32_t>(v))));
    }
    std::vector<Disposition> disposition;
    disposition.reserve(block.faces.size());
    for (const auto& f : block.faces) {
      const int o = owner[f[0]];
      const bool one = o != MergeBlend::kMixed && owner[f[1]] == o && owner[f[2]] == o;
      disposition.push_back(!one                          ? Disposition::kBand
                            : o == static_cast<int>(rank) ? Disposition::kStays
                                                          : Disposition::kCovered);
    }
    return disposition;
  }

  void add_leaves(const MeshBlock& block, const std::array<std::uint32_t, 3>& f,
                  std::vector<std::uint64_t>& keys) const {
    const MergePlan& plan = meshes_.plan();
    const double around = kStripCells + 0.5 * plan.range.apart / plan.lattice.h;
    Int3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [minimum, maximum] =
          std::minmax({block.position[f[0]][a], block.position[f[1]][a], block.position[f[2]][a]});
      const auto leaf = [&](double world, double by) {
        return static_cast<std::int32_t>(std::floor((world - plan.origin[a]) / plan.lattice.h + by)) >>
               kLeafBits;
      };
      low[a] = leaf(minimum, -around);
      high[a] = leaf(maximum, around);
    }
    for (int z = low[2]; z <= high[2]; ++z)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int x = low[0]; x <= high[0]; ++x) {
          const std::uint64_t key = merge_leaf_key({x, y, z});
          if (keys.empty() || keys.back() != key) keys.push_back(key);
        }
    if (keys.size() > (1u << 19)) {
      std::sort(keys.begin(), keys.end());
      keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    }
  }

  /// Faces of the core that stay, within some rings of a cut; edges at a cut are marked as creases.
  static MeshBlock select_near_cut(const MeshHaloBlock& near, const std::vector<Disposition>& disposition) {
    MeshBlock block = near.block;
    constexpr int kFar = kCutRings + 1;
    std::vector<int> ring(block.position.size(), kFar);
    for (std::uint8_t& flags : block.face_flags)
      flags =
          static_cast<std::uint8_t>(flags & (kFaceBorder01 | kFaceBorder12 | kFaceBorder20 | kFaceSynthetic));
    const auto stays = [&](std::uint32_t half) { return disposition[half / 3] == Disposition::kStays; };
    EdgeFaces(block.position.size(), std::span(block.faces).first(disposition.size()))
        .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
          if (half.size() != 2 || stays(half[0]) == stays(half[1])) return;
          const std::uint32_t h = stays(half[0]) ? half[0] : half[1];
          std::uint8_t& flags = block.face_flags[h / 3];
          flags = static_cast<std::uint8_t>(flags | kFaceCrease01 << h % 3);
          ring[low] = ring[high] = 0;
        });
    for (int r = 1; r <= kCutRings; ++r)
      for (std::size_t f = 0; f < disposition.size(); ++f) {
        if (disposition[f] != Disposition::kStays) continue;
        bool next = false;
        for (const std::uint32_t v : block.faces[f]) next = next || ring[v] == r - 1;
        for (const std::uint32_t v : block.faces[f])
          if (next && ring[v] == kFar) ring[v] = r;
      }
    std::vector<std::uint8_t> keep(disposition.size(), 0);
    for (std::size_t f = 0; f < disposition.size(); ++f) {
      if (!near.core[f] || disposition[f] != Disposition::kStays) continue;
      for (const std::uint32_t v : block.faces[f]) keep[f] = keep[f] || ring[v] < kCutRings;
    }
    return select_faces(block, keep);
  }
};

}  // namespace

std::uint64_t merge_cover_bytes(const RunOptions& run, const MeshSize& patch, std::uint64_t near_bytes) {
  return std::max(cover_task_bytes(patch, near_bytes, false), cover_finish_bytes(run));
}

std::unique_ptr<Stage> make_merge_cover_stage(const JobState& state) {
  return std::make_unique<CoverStage>(state);
}

}  // namespace tessera
