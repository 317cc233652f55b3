#include "stream/stages/surface/loops_stage.h"

#include <algorithm>
#include <map>
#include <optional>

#include "kernels/holes/boundary_chain.h"
#include "kernels/holes/boundary_loops.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/points/plan.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/surface/hole_limit.h"
#include "stream/stages/surface/loop_batches.h"
#include "stream/stages/weld/border_strip.h"

namespace tessera {
namespace {

constexpr std::uint64_t kBatchEdges = 20'000;
constexpr std::uint64_t kShortBatchEdges = 4'000;  ///< while the strips around are held
constexpr std::size_t kBorderBuffer = 24 * 2048;
constexpr std::size_t kClassCache = 64;  ///< patches whose vertex classes are held at once
constexpr std::uint64_t kLoopBytes = std::uint64_t{20} << 20;

std::string edge_file_name(std::size_t task) {
  return "loops/" + task_file_stem(task) + ".tse";
}

std::string border_file_name(std::size_t task) {
  return "loops/" + task_file_stem(task) + ".tsb";
}

std::uint64_t table_bytes(const RunOptions& run) {
  return run.memory_bytes / 4;
}

class LoopsStage : public Stage {
 public:
  explicit LoopsStage(const JobState& state)
      : state_(state),
        plan_(Plan::of_work(state.work)),
        limit_(hole_limit(state, plan_)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {}

  std::string name() const override { return "loops"; }
  std::size_t task_count() const override { return limit_.edges == 0 ? 0 : store_.file_count(); }
  std::uint64_t units() const override { return limit_.edges == 0 ? 0 : store_.patches().size(); }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return loops_task_bytes(store_.patches().subspan(first, last - first));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    return is_short() ? find_loops(task, context) : write_edges(task, context);
  }

  std::uint64_t finish_bytes() const override {
    return loops_finish_bytes(state_.run, limit_.edges, limit_.chained, store_.patches());
  }

  Json finish(const std::vector<Json>& tasks, TaskContext& context) const override {
    if (limit_.edges == 0) return {{"max_hole", 0}};
    if (!is_short()) return chain(match(context), context);
    std::uint64_t chosen = 0, torn = 0;
    for (const Json& t : tasks) {
      chosen += t.at("to_fill").get<std::uint64_t>();
      torn += t.at("torn").get<std::uint64_t>();
    }
    Json out = {{"to_fill", chosen}, {"torn_bricks", torn}};
    if (limit_.chained > 0) out.update(chain_bricks(context));
    return out;
  }

  std::vector<std::string> obsolete() const override { return {}; }

 private:
  /// Vertex classes of the patches around the current one.
  class ClassCache {
   public:
    explicit ClassCache(const PatchStore& store) : store_(store) {}
    const std::vector<VertexClass>& get(std::size_t patch) {
      const auto found = cache_.find(patch);
      if (found != cache_.end()) return found->second;
      if (cache_.size() >= kClassCache) cache_.erase(cache_.begin());  // of the smallest brick: it came first
      std::vector<Float3> position;
      std::vector<std::uint32_t> rgba;
      std::vector<VertexClass>& out = cache_[patch];
      store_.load_vertices(patch, position, rgba, &out);
      return out;
    }

   private:
    const PatchStore& store_;
    std::map<std::size_t, std::vector<VertexClass>> cache_;
  };

  bool is_short() const { return limit_.edges <= kMaxShortEdges; }

  LoopBatches make_batches(std::size_t task, TaskContext& context) const {
    return {{state_.work, store_, numbering_, plan_.has_colour},
            task,
            context,
            is_short() ? kShortBatchEdges : kBatchEdges,
            batch_vertices(limit_.edges)};
  }

  Json find_loops(std::size_t task, TaskContext& context) const {
    StripReader reader(state_, store_, numbering_);
    LoopBatches batches = make_batches(task, context);
    std::vector<StripFace> faces;
    std::vector<EdgeRecord> records;
    std::optional<DirectFile> border;
    if (limit_.chained > 0) border.emplace(context.create(border_file_name(task)), kBorderBuffer);
    std::uint64_t torn = 0, edges = 0;
    const int halo = short_halo(limit_.edges);
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      context.advance(1);
      if (!reader.has_border(p)) continue;
      if (!reader.gather(p, halo, faces)) {
        ++torn;
        continue;
      }
      records.clear();
      for (const StripFace& f : faces) add_records(reader, reader.brick(p), halo, f, records);
      std::sort(records.begin(), records.end());
      BoundaryMatcher boundaries;
      for (const EdgeRecord& r : records) boundaries.add(r);
      boundaries.finish();
      const PatchSpan& range = numbering_.patches[p];
      const std::uint64_t first_vertex = range.first_vertex, end = first_vertex + range.kept_vertices;
      for (HoleBoundary& boundary : short_boundary_loops(boundaries, first_vertex, end, limit_.edges))
        batches.add(std::move(boundary));
      if (!border) continue;
      for (const BoundaryEdge& e : boundaries.border)
        if (e.from >= first_vertex && e.from < end) border->write(&e, sizeof e), ++edges;
    }
    batches.flush();
    if (border) border->finish();
    context.count_written(edges * sizeof(BoundaryEdge));
    return {{"to_fill", batches.loops()}, {"torn", torn}};
  }

  /// Of the edges whose faces are all there: an end lies within the reach.
  static void add_records(const StripReader& reader, const Int3& brick, int halo, const StripFace& f,
                          std::vector<EdgeRecord>& records) {
    std::array<bool, 3> near{};
    for (std::size_t i = 0; i < 3; ++i) near[i] = reader.is_near(f, i, brick, halo);
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      if ((f.border >> i & 1u) == 0 || (f.border >> j & 1u) == 0 || (!near[i] && !near[j])) continue;
      records.push_back(edge_record(f.number[i], f.number[j], f.number[k]));
    }
  }

  /// Loops of more edges than a brick sees, from the border edges that each brick told of its own vertices.
  Json chain_bricks(TaskContext& context) const {
    LoopBatches batches = make_batches(task_count(), context);
    BoundaryChain chain(limit_.chained, kMaxOpenEdges);
    std::vector<BoundaryEdge> buffer(kBorderBuffer / sizeof(BoundaryEdge));
    std::uint64_t edges = 0, loops = 0;
    for (std::size_t k = 0; k < task_count(); ++k) {
      const ReadFile file(state_.work / border_file_name(k));
      for (std::uint64_t at = 0; at < file.size();) {
        context.check_stop();
        const std::uint64_t bytes =
            std::min<std::uint64_t>(file.size() - at, buffer.size() * sizeof(BoundaryEdge));
        file.read_at(at, buffer.data(), bytes);
        for (std::size_t i = 0; i < bytes / sizeof(BoundaryEdge); ++i, ++edges)
          chain.add(buffer[i], [&](HoleBoundary&& boundary) {
            ++loops;
            if (boundary.vertex.size() > limit_.edges) batches.add(std::move(boundary));
          });
        at += bytes;
      }
    }
    batches.flush();
    return {{"border_edges", edges},
            {"chained", batches.loops()},
            {"given_up", chain.given_up()},
            {"left_open_edges", chain.open_edges()}};
  }

  Json write_edges(std::size_t task, TaskContext& context) const {
    NumberedPatches numbered(state_.work, store_, numbering_);
    ClassCache classes(store_);
    PatchFaces patch;
    std::vector<std::uint8_t> at_border;
    std::uint64_t records = 0;
    DirectFile file(context.create(edge_file_name(task)), std::size_t{1} << 20);
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      context.advance(1);
      if (numbering_.patches[p].kept_faces == 0) continue;
      numbered.load_faces(p, patch);
      at_border.clear();
      for (const VertexClass c : classes.get(p)) at_border.push_back(c == VertexClass::kBorder);
      for (const VertexSlot& v : patch.foreign)
        at_border.push_back(classes.get(v.patch)[v.vertex] == VertexClass::kBorder);
      for (const PatchFace& f : patch.faces) {
        if (!patch.kept(f)) continue;
        for (std::size_t e = 0; e < 3; ++e) {
          if (!at_border[f[e]] || !at_border[f[(e + 1) % 3]]) continue;
          const EdgeRecord record =
              edge_record(patch.index[f[e]], patch.index[f[(e + 1) % 3]], patch.index[f[(e + 2) % 3]]);
          file.write(&record, sizeof record);
          ++records;
        }
      }
    }
    file.finish();
    context.count_written(records * sizeof(EdgeRecord));
    return {{"edges", records}};
  }

  BoundaryMatcher match(TaskContext& context) const {
    ExternalSort<EdgeRecord> sort(state_.work, sort_bytes(state_.run));
    std::vector<EdgeRecord> buffer(4096);
    for (std::size_t k = 0; k < task_count(); ++k) {
      const ReadFile file(state_.work / edge_file_name(k));
      for (std::uint64_t at = 0; at < file.size();) {
        context.check_stop();
        const std::uint64_t bytes =
            std::min<std::uint64_t>(file.size() - at, buffer.size() * sizeof(EdgeRecord));
        file.read_at(at, buffer.data(), bytes);
        for (std::size_t i = 0; i < bytes / sizeof(EdgeRecord); ++i) sort.add(buffer[i]);
        at += bytes;
      }
    }
    BoundaryMatcher boundaries;
    sort.drain([&](std::span<const EdgeRecord> batch) {
      context.check_stop();
      for (const EdgeRecord& r : batch) boundaries.add(r);
      if (boundaries.border.size() * sizeof(BoundaryEdge) + boundaries.chords.size() * sizeof(Chord) >
          table_bytes(state_.run) / 2)
        throw ResourceError(
            "the border of this mesh has more than " + std::to_string(boundaries.border.size()) +
            " edges, too many to chain its loops in a quarter of --memory; raise --memory or ask for holes "
            "of at most --max-hole " +
            std::to_string(kMaxShortEdges));
    });
    boundaries.finish();
    return boundaries;
  }

  Json chain(const BoundaryMatcher& boundaries, TaskContext& context) const {
    LoopBatches batches = make_batches(0, context);
    const LoopCounts counts = for_each_boundary_loop(boundaries, limit_.edges, [&](HoleBoundary&& boundary) {
      context.check_stop();
      batches.add(std::move(boundary));
    });
    batches.flush();
    return {{"border_edges", boundaries.border.size()},
            {"loops", counts.loops},
            {"longest", counts.longest},
            {"broken", counts.broken},
            {"to_fill", batches.loops()}};
  }

  JobState state_;
  Plan plan_;
  HoleLimit limit_;
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::uint64_t loops_task_bytes(std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches)
    largest = std::max<std::uint64_t>(largest, 48ull * e.vertices + 28ull * e.faces + 24ull * e.foreign);
  const std::uint64_t edges = 2 * largest + NumberedPatches::kCacheBytes + kLoopBytes;
  // Short ones: three records of a face and what is made of them, a batch, tables of what the stage "border" moved.
  const std::uint64_t loops = StripReader::bytes(patches) + kMaxStripFaces * 6 * sizeof(EdgeRecord) +
                              2 * largest + kShortBatchEdges * (2 * loop_bytes(1) + 100) + kLoopBytes / 4;
  return std::max(edges, loops);
}

std::uint64_t loops_finish_bytes(const RunOptions& run, std::uint32_t max_edges, std::uint32_t chained,
                                 std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches) largest = std::max<std::uint64_t>(largest, 40ull * e.vertices);
  if (max_edges <= kMaxShortEdges) {
    const std::uint64_t fixed = std::uint64_t{1} << 20;
    if (chained == 0) return fixed;
    return fixed + BoundaryChain::bytes(kMaxOpenEdges) + 2 * largest + NumberedPatches::kCacheBytes +
           (kShortBatchEdges + chained) * (2 * loop_bytes(1) + 100);
  }
  const std::uint64_t batch = kBatchEdges + kMaxHoleEdges;
  return sort_bytes(run) + table_bytes(run) + 2 * largest + batch * (2 * loop_bytes(1) + 100) + kLoopBytes;
}

std::unique_ptr<Stage> make_loops_stage(const JobState& state) {
  return std::make_unique<LoopsStage>(state);
}

}  // namespace tessera
