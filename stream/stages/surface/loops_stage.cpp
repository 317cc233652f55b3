#include "stream/stages/surface/loops_stage.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/surface/numbered_patches.h"

namespace tessera {
namespace {

using json = nlohmann::json;

/// An edge of a kept face whose ends both lie on the border of the band: an edge of the mesh's border, or a
/// chord.
struct EdgeRecord {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
  std::uint64_t third = 0;  ///< 2 * the face's other vertex + 1 if the face runs from high to low
  auto operator<=>(const EdgeRecord&) const = default;
};
/// A border edge as the filling's face runs: against that of the mesh.
struct BorderEdge {
  std::uint64_t from = 0;
  std::uint64_t to = 0;
  std::uint64_t third = 0;
};
using Chord = std::array<std::uint64_t, 2>;

constexpr std::uint64_t kBatchEdges = 20'000;
/// The triangulation of a loop costs the cube of its edges: a batch ends at about a second of work.
constexpr std::uint64_t kBatchCost = 1'000'000'000;
constexpr std::size_t kClassCache = 64;  ///< patches whose vertex classes are held at once
constexpr std::uint64_t kFixedBytes = std::uint64_t{20} << 20;

std::string edge_file_name(std::size_t task) {
  return "loops/" + task_file_stem(task) + ".tse";
}

std::uint64_t table_bytes(const RunOptions& run) {
  return run.memory_bytes / 4;
}

class LoopsStage : public Stage {
 public:
  explicit LoopsStage(const JobState& state)
      : state_(state),
        most_edges_(reconstruct_options(state).max_hole),
        plan_(Plan::of_work(state.work)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {}

  std::string name() const override { return "loops"; }
  std::size_t task_count() const override { return most_edges_ == 0 ? 0 : store_.file_count(); }
  std::uint64_t units() const override { return most_edges_ == 0 ? 0 : store_.patches().size(); }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return loops_task_bytes(store_.patches().subspan(first, last - first));
  }

  json run(std::size_t task, TaskContext& context) const override {
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
      for (const VertexPlace& v : patch.foreign)
        at_border.push_back(classes.get(v.patch)[v.vertex] == VertexClass::kBorder);
      for (const PatchFace& f : patch.faces) {
        if (!patch.kept(f)) continue;
        for (std::size_t e = 0; e < 3; ++e) {
          if (!at_border[f[e]] || !at_border[f[(e + 1) % 3]]) continue;
          const std::uint64_t a = patch.index[f[e]], b = patch.index[f[(e + 1) % 3]],
                              c = patch.index[f[(e + 2) % 3]];
          const EdgeRecord record = {std::min(a, b), std::max(a, b), 2 * c + (a > b)};
          file.write(&record, sizeof record);
          ++records;
        }
      }
    }
    file.finish();
    context.count_written(records * sizeof(EdgeRecord));
    return {{"edges", records}};
  }

  std::uint64_t finish_bytes() const override {
    return most_edges_ == 0 ? std::uint64_t{1} << 20 : loops_finish_bytes(state_.run, store_.patches());
  }

  json finish(const std::vector<json>&, TaskContext& context) const override {
    if (most_edges_ == 0) return {{"max_hole", 0}};
    std::vector<BorderEdge> border;
    std::vector<Chord> chords;
    match(border, chords, context);
    return chain(border, chords, context);
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

  /// Edges with one face are the border, those with two are chords.
  void match(std::vector<BorderEdge>& border, std::vector<Chord>& chords, TaskContext& context) const {
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
    EdgeRecord open;
    std::uint64_t faces = 0;
    const auto close = [&] {
      if (faces == 1) {
        const bool down = open.third & 1;
        border.push_back({down ? open.low : open.high, down ? open.high : open.low, open.third >> 1});
      } else if (faces > 1) {
        chords.push_back({open.low, open.high});
      }
      if (border.size() * sizeof(BorderEdge) + chords.size() * sizeof(Chord) > table_bytes(state_.run) / 2)
        throw ResourceError(
            "the border of this mesh has more than " + std::to_string(border.size()) +
            " edges, too many to chain its loops in a quarter of --memory; raise --memory or drop "
            "--max-hole");
    };
    sort.drain([&](std::span<const EdgeRecord> batch) {
      for (const EdgeRecord& r : batch) {
        if (faces != 0 && r.low == open.low && r.high == open.high) {
          ++faces;
          continue;
        }
        close();
        open = r;
        faces = 1;
      }
    });
    close();
  }

  json chain(std::vector<BorderEdge>& border, const std::vector<Chord>& chords, TaskContext& context) const {
    std::sort(border.begin(), border.end(),
              [](const BorderEdge& a, const BorderEdge& b) { return a.from < b.from; });
    std::vector<std::uint8_t> seen(border.size(), 0);
    std::uint64_t loops = 0, chosen = 0, longest = 0, broken = 0, batches = 0, batch_edges = 0,
                  batch_cost = 0, batch_vertices = 0;
    std::vector<std::vector<BorderEdge>> batch;
    const auto flush = [&] {
      if (batch.empty()) return;
      save_loops(context.create(loop_file_name(batches++)), gather(batch, chords, context));
      batch.clear();
      batch_edges = batch_cost = batch_vertices = 0;
    };
    std::vector<BorderEdge> loop;
    for (std::size_t first = 0; first < border.size(); ++first) {
      if (seen[first]) continue;
      loop.clear();
      std::uint64_t length = 0;
      std::size_t at = first;
      bool closed = true;
      do {  // a vertex of a manifold has one border edge out, so this comes back
        seen[at] = 1;
        ++length;
        if (length <= most_edges_) loop.push_back(border[at]);
        const std::uint64_t to = border[at].to;
        const auto next = std::lower_bound(border.begin(), border.end(), to,
                                           [](const BorderEdge& e, std::uint64_t v) { return e.from < v; });
        closed = next != border.end() && next->from == to;
        at = static_cast<std::size_t>(next - border.begin());
      } while (closed && !seen[at]);
      ++loops;
      longest = std::max(longest, length);
      if (!closed || at != first) ++broken;
      if (!closed || at != first || length > most_edges_ || length < 3) continue;
      ++chosen;
      batch.push_back(loop);
      batch_edges += length;
      batch_vertices += most_hole_vertices(length);
      batch_cost += length * length * length / 6;
      if (batch_edges >= kBatchEdges || batch_cost >= kBatchCost || batch_vertices >= kBatchVertices) flush();
    }
    flush();
    return {{"border_edges", border.size()},
            {"loops", loops},
            {"longest", longest},
            {"broken", broken},
            {"to_fill", chosen}};
  }

  /// Positions of a batch's loops and of the faces beyond, patch by patch.
  std::vector<NamedLoop> gather(const std::vector<std::vector<BorderEdge>>& batch,
                                const std::vector<Chord>& chords, TaskContext& context) const {
    std::vector<std::uint64_t> need;
    for (const auto& loop : batch)
      for (const BorderEdge& e : loop) {
        need.push_back(e.from);
        need.push_back(e.third);
      }
    std::sort(need.begin(), need.end());
    need.erase(std::unique(need.begin(), need.end()), need.end());
    std::vector<Double3> position(need.size());
    std::vector<std::uint32_t> rgba(plan_.has_colour ? need.size() : 0);
    load_positions(need, position, rgba, context);
    const auto slot = [&](std::uint64_t v) {
      return static_cast<std::size_t>(std::lower_bound(need.begin(), need.end(), v) - need.begin());
    };
    std::vector<NamedLoop> out(batch.size());
    for (std::size_t l = 0; l < batch.size(); ++l) {
      NamedLoop& named = out[l];
      std::vector<std::array<std::uint64_t, 2>> order;  // vertex, position in the loop
      for (const BorderEdge& e : batch[l]) {
        order.push_back({e.from, order.size()});
        named.vertex.push_back(e.from);
        named.loop.position.push_back(position[slot(e.from)]);
        named.loop.opposite.push_back(position[slot(e.third)]);
        if (!rgba.empty()) named.loop.rgba.push_back(rgba[slot(e.from)]);
      }
      std::sort(order.begin(), order.end());
      const auto place = [&](std::uint64_t v) -> std::uint32_t {
        const auto it = std::lower_bound(order.begin(), order.end(), std::array<std::uint64_t, 2>{v, 0});
        return it == order.end() || (*it)[0] != v ? kMostHoleEdges : static_cast<std::uint32_t>((*it)[1]);
      };
      for (const auto& [v, i] : order) {
        auto c = std::lower_bound(chords.begin(), chords.end(), Chord{v, 0});
        for (; c != chords.end() && (*c)[0] == v; ++c) {
          const std::uint32_t j = place((*c)[1]), k = static_cast<std::uint32_t>(i);
          if (j != kMostHoleEdges) named.loop.taken.push_back({std::min(j, k), std::max(j, k)});
        }
      }
      std::sort(named.loop.taken.begin(), named.loop.taken.end());
    }
    return out;
  }

  void load_positions(const std::vector<std::uint64_t>& need, std::vector<Double3>& position,
                      std::vector<std::uint32_t>& colour, TaskContext& context) const {
    NumberedPatches numbered(state_.work, store_, numbering_);
    std::vector<Float3> local;
    std::vector<std::uint32_t> rgba;
    const auto& patches = numbering_.patches;
    for (std::size_t i = 0; i < need.size();) {
      context.check_stop();
      // The last patch that begins at or before the vertex; those without vertices begin where the next does.
      const auto after =
          std::upper_bound(patches.begin(), patches.end(), need[i],
                           [](std::uint64_t v, const PatchPlace& p) { return v < p.first_vertex; });
      const auto p = static_cast<std::size_t>(after - patches.begin()) - 1;
      numbered.load_kept_vertices(p, local, rgba);
      const Int3 brick = brick_of_key(store_.patches()[p].key);
      for (; i < need.size() && need[i] < patches[p].first_vertex + patches[p].kept_vertices; ++i) {
        const std::size_t v = need[i] - patches[p].first_vertex;
        for (std::size_t a = 0; a < 3; ++a)
          position[i][a] = brick[a] * double{kBrickCells} + double{local[v][a]};
        if (!colour.empty()) colour[i] = rgba.empty() ? 0 : rgba[v];
      }
    }
  }

  JobState state_;
  std::uint32_t most_edges_;
  Plan plan_;
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::uint64_t loops_task_bytes(std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches)
    largest = std::max<std::uint64_t>(largest, 48ull * e.vertices + 28ull * e.faces + 24ull * e.foreign);
  return 2 * largest + NumberedPatches::kCacheBytes + kFixedBytes;
}

std::uint64_t loops_finish_bytes(const RunOptions& run, std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches) largest = std::max<std::uint64_t>(largest, 40ull * e.vertices);
  const std::uint64_t batch = kBatchEdges + kMostHoleEdges;
  return sort_bytes(run) + table_bytes(run) + 2 * largest + batch * (2 * loop_bytes(1) + 100) + kFixedBytes;
}

std::unique_ptr<Stage> make_loops_stage(const JobState& state) {
  return std::make_unique<LoopsStage>(state);
}

}  // namespace tessera
