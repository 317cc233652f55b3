/// Stage "lines" of solids: the global summary of every mesh.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/packed_file.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/patch_runs.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTaskFaces = 200'000;
constexpr std::size_t kMaxLeaves = 1u << 15;  ///< held by a task before they go to its file
constexpr std::uint64_t kSortBytes = std::uint64_t{16} << 20;
constexpr std::size_t kLinePage = 1u << 12;
/// Triangles are crossed with the lattice in cubes of so many cells, so that large ones do not fill the memory.
constexpr int kChunk = 256;
constexpr std::int32_t kEndNode = 1 << kMaxCellBits;
constexpr PackedKind kWindingsKind = {"TSTURNS1", "a file of turns"};
constexpr PackedKind kBorderKind = {"TSRIBBN1", "a file of border edges"};
constexpr const char* kSummary = "lines/summary.json";

/// Patches of one input.
struct LinesTask {
  std::size_t operand = 0, input = 0;
  std::size_t first = 0, end = 0;
};

bool same_ends(const BorderEdge& l, const BorderEdge& r) {
  return l.a == r.a && l.b == r.b;
}
struct ByEnds {
  bool operator()(const BorderEdge& l, const BorderEdge& r) const {
    return l.a != r.a ? l.a < r.a : l.b < r.b;
  }
};

std::string part(std::size_t task, const char* extension) {
  return "lines/" + task_file_stem(task) + extension;
}
std::string windings_file(std::size_t operand) {
  return "lines/turns-" + std::to_string(operand) + ".bin";
}
std::string border_file(std::size_t operand) {
  return "lines/border-" + std::to_string(operand) + ".bin";
}

/// The edges of a patch that do not cancel within it.
std::vector<BorderEdge> open_edges(const std::vector<Long3>& corner,
                                   const std::vector<std::array<std::uint32_t, 3>>& faces) {
  std::vector<BorderEdge> edges;
  edges.reserve(3 * faces.size());
  for (const auto& f : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Long3 &a = corner[f[k]], &b = corner[f[(k + 1) % 3]];
      if (a == b) continue;
      edges.push_back(a < b ? BorderEdge{a, b, 1} : BorderEdge{b, a, -1});
    }
  std::sort(edges.begin(), edges.end(), ByEnds{});
  std::vector<BorderEdge> open;
  for (std::size_t i = 0; i < edges.size();) {
    BorderEdge sum = edges[i];
    for (++i; i < edges.size() && same_ends(edges[i], sum); ++i) sum.count += edges[i].count;
    if (sum.count != 0) open.push_back(sum);
  }
  return open;
}

class LinesStage : public Stage {
 public:
  LinesStage(const JobState& state, const SolidModel& model)
      : state_(state), operands_(model.meshes.size()), plan_(Plan::of_work(state.work)) {
    for (std::size_t o = 0; o < model.meshes.size(); ++o)
      for (const std::size_t input : model.meshes[o].inputs) {
        stores_.push_back(open_imported_mesh(state.work, solid_import(input)));
        placements_.push_back(model.meshes[o].placement);
        for (const PatchRun& run : patch_runs(stores_.back(), kTaskFaces))
          tasks_.push_back({o, stores_.size() - 1, run.first, run.end});
      }
  }

  std::string name() const override { return "lines"; }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override {
    std::uint64_t sum = 0;
    for (const MeshStore& s : stores_) sum += s.face_count();
    return sum;
  }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const LinesTask& t = tasks_[task];
    std::uint64_t maximum = 0;
    for (std::size_t p = t.first; p < t.end; ++p) {
      const MeshPatchEntry& e = stores_[t.input].patches()[p];
      maximum = std::max(maximum, solid_lines_task_bytes(e.vertices, e.faces));
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const LinesTask& t = tasks_[task];
    DirectFile windings(context.create(part(task, ".tur")));
    DirectFile borders(context.create(part(task, ".edg")));
    Leaves leaves(windings);
    std::int64_t volume = 0;
    std::vector<LatticeCrossing> found;
    for (std::size_t p = t.first; p < t.end; ++p) {
      context.check_stop();
      MeshBlock block = stores_[t.input].load({&p, 1});
      transform_block(placements_[t.input], block);
      const std::vector<Long3> corner = quantise_block(plan_.lattice, block);
      for (const auto& f : block.faces)
        cross({corner[f[0]], corner[f[1]], corner[f[2]]}, leaves, found, volume);
      const std::vector<BorderEdge> open = open_edges(corner, block.faces);
      borders.write(open.data(), open.size() * sizeof(BorderEdge));
      context.advance(block.faces.size());
    }
    leaves.flush();
    context.count_written(windings.finish() + borders.finish());
    return {{"operand", t.operand}, {"volume", volume}, {"crossings", leaves.crossings()}};
  }

  std::uint64_t finish_bytes() const override { return solid_lines_finish_bytes(); }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    Json operands = Json::array();
    std::uint64_t crossings = 0, borders = 0;
    for (std::size_t o = 0; o < operands_; ++o) {
      std::int64_t volume = 0;
      for (const Json& s : summaries) {
        if (s.at("operand") != o) continue;
        volume += s.at("volume").get<std::int64_t>();
        crossings += s.at("crossings").get<std::uint64_t>();
      }
      const std::uint64_t leaves = merge<LeafWindings>(
          o, ".tur", summaries, windings_file(o), kWindingsKind, std::less<LeafWindings>{},
          [](LeafWindings& sum, const LeafWindings& next) {
            if (sum.key != next.key) return false;
            sum.add(next);
            return true;
          },
          [](const LeafWindings&) { return true; }, context);
      const std::uint64_t edges = merge<BorderEdge>(
          o, ".edg", summaries, border_file(o), kBorderKind, ByEnds{},
          [](BorderEdge& sum, const BorderEdge& next) {
            if (!same_ends(sum, next)) return false;
            sum.count += next.count;
            return true;
          },
          [](const BorderEdge& e) { return e.count != 0; }, context);
      borders += edges;
      operands.push_back({{"leaves", leaves}, {"border_edges", edges}, {"inside_out", volume < 0}});
    }
    write_text(context.create(kSummary), dump_json(operands));
    return {{"operands", operands}, {"crossings", crossings}, {"border_edges", borders}};
  }

  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names;
    for (std::size_t t = 0; t < tasks_.size(); ++t)
      names.push_back(part(t, ".tur")), names.push_back(part(t, ".edg"));
    return names;
  }

 private:
  /// Leaves by row, so many at a time.
  class Leaves {
   public:
    explicit Leaves(DirectFile& file) : file_(file) {}
    LeafWindings& of_node(const Int3& node) {
      const std::uint64_t key =
          leaf_row_key({node[0] >> kLeafBits, node[1] >> kLeafBits, node[2] >> kLeafBits});
      if (last_ < leaves_.size() && leaves_[last_].key == key) return leaves_[last_];
      if (leaves_.size() == kMaxLeaves) flush();
      const auto [it, fresh] = index_.try_emplace(key, static_cast<std::uint32_t>(leaves_.size()));
      if (fresh) leaves_.emplace_back().key = key;
      last_ = it->second;
      return leaves_[last_];
    }
    void count() { ++crossings_; }
    std::uint64_t crossings() const { return crossings_; }
    void flush() {
      std::sort(leaves_.begin(), leaves_.end());
      file_.write(leaves_.data(), leaves_.size() * sizeof(LeafWindings));
      leaves_.clear();
      index_.clear();
    }

   private:
    DirectFile& file_;
    std::vector<LeafWindings> leaves_;
    std::unordered_map<std::uint64_t, std::uint32_t> index_;
    std::size_t last_ = 0;
    std::uint64_t crossings_ = 0;
  };

  void cross(const QuantisedTriangle& triangle, Leaves& leaves, std::vector<LatticeCrossing>& found,
             std::int64_t& volume) const {
    Int3 low, high;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [minimum, maximum] = std::minmax({triangle[0][k], triangle[1][k], triangle[2][k]});
      low[k] = static_cast<std::int32_t>((minimum >> kSolidQuantumBits) - 1);
      high[k] = static_cast<std::int32_t>((maximum >> kSolidQuantumBits) + 1);
    }
    Int3 at;
    for (at[2] = low[2]; at[2] <= high[2]; at[2] += kChunk)
      for (at[1] = low[1]; at[1] <= high[1]; at[1] += kChunk)
        for (at[0] = low[0]; at[0] <= high[0]; at[0] += kChunk) {
          found.clear();
          find_crossings(triangle,
                         {at,
                          {std::min(at[0] + kChunk, kEndNode), std::min(at[1] + kChunk, kEndNode),
                           std::min(at[2] + kChunk, kEndNode)}},
                         7, found);
          for (const LatticeCrossing& c : found) {
            LeafWindings& leaf = leaves.of_node(c.node);
            ++leaf.crossings;
            leaves.count();
            if (c.axis != 0) continue;
            std::int16_t& winding =
                leaf.winding[static_cast<std::size_t>((c.node[1] & 7) + 8 * (c.node[2] & 7))];
            winding = static_cast<std::int16_t>(winding + c.winding);
            volume -= c.winding * std::int64_t{c.node[0] - middle()};
          }
        }
  }
  /// An open mesh has a volume only about a middle.
  std::int32_t middle() const { return (plan_.brick_min[0] + plan_.brick_max[0] + 1) * kBrickCells / 2; }

  /// Sorts what the tasks left of an operand, sums up what has the same key. Returns how many records stay.
  template <class Record, class Less, class Join, class Keep>
  std::uint64_t merge(std::size_t operand, const char* extension, const std::vector<Json>& summaries,
                      const std::string& to, const PackedKind& kind, Less less, const Join& join,
                      const Keep& keep, TaskContext& context) const {
    ExternalSort<Record, Less> sort(state_.work, kSortBytes, less);
    for (std::size_t t = 0; t < tasks_.size(); ++t) {
      if (summaries[t].at("operand") != operand) continue;
      for_each_page<Record>(state_.work / part(t, extension), kLinePage, [&](auto page) {
        context.check_stop();
        for (const Record& record : page) sort.add(record);
      });
    }
    PackedWriter out(context.create(to), kind);
    std::vector<Section> sections;
    std::vector<Record> ready;
    bool any = false;
    Record sum{};
    std::uint64_t count = 0;
    const auto put = [&] {
      if (any && keep(sum)) ready.push_back(sum), ++count;
    };
    const auto save = [&] {
      if (!ready.empty()) sections.push_back(out.append(bytes_of(ready)));
      ready.clear();
    };
    sort.drain([&](std::span<const Record> batch) {
      for (const Record& r : batch) {
        if (any && join(sum, r)) continue;
        put();
        sum = r;
        any = true;
        if (ready.size() >= 4 * kLinePage) save();
      }
    });
    put();
    save();
    context.count_written(out.finish(sections));
    return count;
  }

  JobState state_;
  std::size_t operands_;
  Plan plan_;
  std::vector<MeshStore> stores_;
  std::vector<Placement> placements_;  ///< per store
  std::vector<LinesTask> tasks_;
};

template <class Record>
std::vector<Record> load_all(const std::filesystem::path& path, const PackedKind& kind, std::uint64_t count) {
  const PackedFile file(path, kind, sizeof(Section));
  std::vector<Record> all;
  all.reserve(count);
  for (const Section& section : file.table<Section>()) {
    const std::vector<Record> part = file.load<Record>(section);
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace

std::vector<SolidLines> load_solid_lines(const std::filesystem::path& work, bool told) {
  std::vector<SolidLines> out;
  for (const Json& o : parse_json(read_text(work / kSummary)))
    out.push_back({o.at("leaves").get<std::uint64_t>(), o.at("border_edges").get<std::uint64_t>(),
                   o.at("inside_out").get<bool>()});
  if (!told) return out;
  const Json inside_out = parse_json(read_text(work / kInsideSummary));
  for (std::size_t o = 0; o < out.size(); ++o) out[o].inside_out = inside_out.at(o).get<bool>();
  return out;
}

MeshSolid load_mesh_solid(const std::filesystem::path& work, std::size_t operand, const SolidLines& lines) {
  auto windings = load_all<LeafWindings>(work / windings_file(operand), kWindingsKind, lines.leaves);
  auto border = load_all<BorderEdge>(work / border_file(operand), kBorderKind, lines.borders);
  if (lines.inside_out) {
    for (LeafWindings& leaf : windings)
      for (std::int16_t& t : leaf.winding) t = static_cast<std::int16_t>(-t);
    for (BorderEdge& e : border) e.count = -e.count;
  }
  return MeshSolid(LineWindings(std::move(windings)), BorderWinding(std::move(border)));
}

std::uint64_t solid_lines_task_bytes(std::uint64_t vertices, std::uint64_t faces) {
  // Crossings of one triangle in one cube; leaves with their index; output buffers.
  return MeshStore::block_bytes(vertices, faces) + 24 * vertices + 6 * sizeof(BorderEdge) * faces +
         std::uint64_t{12} * kChunk * kChunk * sizeof(LatticeCrossing) / 4 +
         kMaxLeaves * (2 * sizeof(LeafWindings) + 64) + 2 * DirectFile::kDefaultBuffer +
         (std::uint64_t{4} << 20);
}

std::uint64_t solid_lines_finish_bytes() {
  return 3 * kSortBytes + (std::uint64_t{16} << 20);
}

std::unique_ptr<Stage> make_solid_lines_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<LinesStage>(state, model);
}

}  // namespace tessera
