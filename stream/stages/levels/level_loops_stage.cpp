// Boundary loops of a surface with levels: faces say at which edges it ends, and the edges are chained in the order of patches.
#include <algorithm>

#include "kernels/holes/boundary_chain.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/levels/level_ends.h"
#include "stream/stages/levels/moved_patches.h"

namespace tessera {
namespace {

constexpr std::size_t kEdgeBuffer = 24 * 2048;
constexpr std::uint64_t kKeyCache = std::uint64_t{8} << 20;
constexpr std::uint64_t kLoopEndBytes = std::uint64_t{4} << 20;
/// Edges of open paths at once, at most: rims go round between patches that follow each other along a curve.
constexpr std::uint64_t kMaxOpen = 4 * kMaxOpenEdges;
constexpr std::uint64_t kBatchEdges = 4'000;
constexpr std::uint64_t kBatchCost =
    1'000'000'000;  ///< the triangulation takes the cube of its edges: about a second
constexpr PackedKind kLoopsKind = {"TSLLOOP1", "a file of loops"};

std::string edges_file(std::size_t task) {
  return kLevelLoopFolder + task_file_stem(task) + ".tse";
}
std::string loops_file(std::size_t batch) {
  return kLevelLoopFolder + task_file_stem(batch) + ".tsl";
}

class LevelLoopsStage : public Stage {
 public:
  explicit LevelLoopsStage(const JobState& state)
      : work_(state.work),
        limit_(level_ends(state).holes),
        store_(open_level_surface(state)),
        first_(patch_runs_of(store_)) {}

  std::string name() const override { return "loops"; }
  std::size_t task_count() const override { return limit_.edges > 0 ? first_.size() - 1 : 0; }
  std::uint64_t units() const override { return limit_.edges > 0 ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return level_loops_task_bytes(store_.largest_patch_bytes());
  }

  Json run(std::size_t task, TaskContext& context) const override {
    PatchCache<Keys> cache(kKeyCache);
    DirectFile file(context.create(edges_file(task)), kEdgeBuffer);
    std::uint64_t edges = 0;
    for (std::size_t p = first_[task]; p < first_[task + 1]; ++p) {
      context.check_stop();
      context.advance(1);
      edges += write_edges(p, cache, file);
    }
    file.finish();
    context.count_written(edges * sizeof(BoundaryEdge));
    return {{"border_edges", edges}};
  }

  std::uint64_t finish_bytes() const override {
    return limit_.edges > 0 ? level_loops_finish_bytes() : kLoopEndBytes;
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (limit_.edges == 0) return {{"max_hole", 0}};
    Batches batches(context);
    BoundaryChain chain(limit_.edges, kMaxOpen);
    std::vector<BoundaryEdge> buffer(kEdgeBuffer / sizeof(BoundaryEdge));
    for (std::size_t k = 0; k < task_count(); ++k) {
      const ReadFile file(work_ / edges_file(k));
      for (std::uint64_t at = 0; at < file.size();) {
        context.check_stop();
        const std::uint64_t bytes =
            std::min<std::uint64_t>(file.size() - at, buffer.size() * sizeof(BoundaryEdge));
        file.read_at(at, buffer.data(), bytes);
        for (std::size_t i = 0; i < bytes / sizeof(BoundaryEdge); ++i)
          chain.add(buffer[i], [&](HoleBoundary&& loop) { batches.add(loop); });
        at += bytes;
      }
    }
    batches.flush();
    Json out = sum_counts(summaries, {{"border_edges", 0}});
    out["to_fill"] = batches.loops();
    out["given_up"] = chain.given_up();
    return out;
  }

 private:
  struct Keys {
    std::vector<std::uint64_t> key;
    std::uint64_t bytes() const { return 8 * key.size() + 64; }
  };

  class Batches {
   public:
    explicit Batches(TaskContext& context) : context_(context) {}
    void add(const HoleBoundary& loop) {
      const std::uint64_t n = loop.vertex.size();
      numbers_.push_back(n);
      numbers_.insert(numbers_.end(), loop.vertex.begin(), loop.vertex.end());
      numbers_.insert(numbers_.end(), loop.third.begin(), loop.third.end());
      ++loops_;
      edges_ += n, cost_ += n * n * n / 6, vertices_ += max_hole_vertices(n);
      if (edges_ >= kBatchEdges || cost_ >= kBatchCost || vertices_ >= batch_vertices(n)) flush();
    }
    void flush() {
      if (numbers_.empty()) return;
      PackedWriter file(context_.create(loops_file(batch_++)), kLoopsKind, std::size_t{1} << 16);
      const std::vector<Section> table = {file.append(bytes_of(numbers_))};
      context_.count_written(file.finish(table));
      numbers_.clear();
      edges_ = cost_ = vertices_ = 0;
    }
    std::uint64_t loops() const { return loops_; }

   private:
    TaskContext& context_;
    std::vector<std::uint64_t> numbers_;
    std::size_t batch_ = 0;
    std::uint64_t loops_ = 0, edges_ = 0, cost_ = 0, vertices_ = 0;
  };

  /// Those of one patch, against the faces; vertices by the first patch that has them.
  std::uint64_t write_edges(std::size_t p, PatchCache<Keys>& cache, DirectFile& file) const {
    const MeshBlock block = store_.load({&p, 1});
    std::vector<BoundaryEdge> edges;
    for (std::size_t f = 0; f < block.faces.size(); ++f)
      for (std::size_t i = 0; i < 3; ++i)
        if (block.face_flags[f] >> i & 1u)
          edges.push_back({block.faces[f][(i + 1) % 3], block.faces[f][i], block.faces[f][(i + 2) % 3]});
    if (edges.empty()) return 0;
    std::vector<std::uint64_t> number(block.key.size());
    for (std::size_t v = 0; v < number.size(); ++v) number[v] = std::uint64_t{p} << 32 | v;
    std::vector<std::uint8_t> known(block.key.size(), 0);
    for (const std::size_t q : patches_near(store_, p, 0.0)) {
      if (q >= p) break;
      const Keys& keys = cache.get(q, [&](Keys& out) { out.key = store_.load({&q, 1}).key; });
      for (const BoundaryEdge& e : edges)
        for (const std::uint64_t v : {e.from, e.to}) {
          if (known[v]) continue;
          const auto at = std::lower_bound(keys.key.begin(), keys.key.end(), block.key[v]);
          if (at == keys.key.end() || *at != block.key[v]) continue;
          number[v] = std::uint64_t{q} << 32 | static_cast<std::uint64_t>(at - keys.key.begin());
          known[v] = 1;
        }
    }
    for (BoundaryEdge& e : edges) {
      e = {number[e.from], number[e.to], std::uint64_t{p} << 32 | e.third};
      file.write(&e, sizeof e);
    }
    return edges.size();
  }

  std::filesystem::path work_;
  HoleLimit limit_;
  MeshStore store_;
  std::vector<std::size_t> first_;
};

}  // namespace

std::vector<std::filesystem::path> list_level_loops(const std::filesystem::path& work) {
  return list_task_files(work / kLevelLoopFolder, ".tsl");
}
std::vector<std::uint64_t> load_level_loops(const std::filesystem::path& file) {
  const PackedFile in(file, kLoopsKind, sizeof(Section));
  return in.load<std::uint64_t>(in.table<Section>().at(0));
}

std::uint64_t level_loops_task_bytes(std::uint64_t patch_bytes) {
  return kKeyCache + 3 * patch_bytes + kLoopEndBytes;
}

std::uint64_t level_loops_finish_bytes() {
  return BoundaryChain::bytes(kMaxOpen) + (kBatchEdges + kMaxHoleEdges) * 64 + kLoopEndBytes;
}

std::unique_ptr<Stage> make_level_loops_stage(const JobState& state) {
  return std::make_unique<LevelLoopsStage>(state);
}

}  // namespace tessera
