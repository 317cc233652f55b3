#include "stream/stages/weld/weld_stage.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <stdexcept>

#include "octree/error.h"
#include "octree/union_find.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/cell_ladder.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/plan/planned_scan.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSeamCacheBytes = 16u << 20;

/// Seams of the patches around the current one; the oldest go first.
class SeamCache {
 public:
  explicit SeamCache(const PatchStore& store) : store_(store) {}

  const PatchSeam& get(std::size_t patch) {
    const auto found = cache_.find(patch);
    if (found != cache_.end()) return found->second.seam;
    while (bytes_ > kSeamCacheBytes && !cache_.empty()) {
      const auto oldest = std::min_element(cache_.begin(), cache_.end(), [](const auto& a, const auto& b) {
        return a.second.born < b.second.born;
      });
      bytes_ -= size_of(oldest->second.seam);
      cache_.erase(oldest);
    }
    Slot& slot = cache_[patch];
    slot.seam = store_.load_seam(patch);
    slot.born = clock_++;
    bytes_ += size_of(slot.seam);
    return slot.seam;
  }

 private:
  struct Slot {
    PatchSeam seam;
    std::uint64_t born = 0;
  };
  static std::uint64_t size_of(const PatchSeam& s) {
    return 8 * s.foreign.size() + 12 * s.exported_key.size() + 4 * s.components.of_vertex.size() +
           12 * s.components.faces.size() + sizeof(Slot);
  }
  const PatchStore& store_;
  std::map<std::size_t, Slot> cache_;
  std::uint64_t bytes_ = 0;
  std::uint64_t clock_ = 0;
};

/// So many islands, none of them three cells wide, are no solids but noise of the lattice between two sheets.
constexpr std::uint64_t kManyCrumbs = 100;
/// An island may be a shred if the largest is so many times larger.
constexpr std::uint64_t kShredShare = 4;
/// Least faces per border edge, which is the width of a strip and the radius of a disc in cells: leaves have 3 to 4,
/// a strip as wide as the support of its samples 6.
constexpr std::uint64_t kShredDepth = 5;
/// Hands and chairs in the frame of a depth camera are smooth and have two faces per border edge and more, foil folds everywhere:
/// at most one vertex in twenty may, of half as many as faces.
constexpr std::uint64_t kSmoothDepth = 2;
constexpr std::uint64_t kFoldedPart = 40;
/// A disc of a hundred faces is eight cells wide; leaves and spray that size fold, strips have a face per border edge.
constexpr std::uint64_t kPieceFaces = 100, kPieceDepth = 2;

constexpr PackedKind kWeldKind = {"TSWELDS4", "a weld file"};
constexpr PackedKind kNumberingKind = {"TSNUMBR2", "a numbering"};

/// Two components of different patches that share a vertex; indices over all patches.
struct Link {
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  auto operator<=>(const Link&) const = default;
};
struct ComponentSize {
  std::uint32_t vertices = 0;
  std::uint32_t faces = 0;
  std::uint32_t border = 0;  ///< vertices at which the surface ends
  std::uint32_t folded = 0;  ///< vertices at which it folds
};

class WeldStage : public Stage {
 public:
  WeldStage(const JobState& state, WeldRules rules)
      : rules_(std::move(rules)),
        work_(state.work),
        store_(open_patches(state.work)),
        first_component_(store_.patches().size() + 1, 0) {
    for (std::size_t p = 0; p < store_.patches().size(); ++p)
      first_component_[p + 1] = first_component_[p] + store_.patches()[p].components;
  }

  std::string name() const override { return "weld"; }
  std::size_t task_count() const override { return store_.file_count(); }
  std::uint64_t units() const override { return store_.patches().size(); }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return weld_task_bytes(store_.patches().subspan(first, last - first));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    SeamCache cache(store_);
    std::vector<VertexSlot> slots;
    std::vector<Link> links;
    std::vector<ComponentSize> sizes;
    std::size_t compact_at = 4096;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      const PatchSeam seam = cache.get(p);  // a copy: the cache may drop it while owners are looked up
      for (std::size_t c = 0; c < seam.components.count; ++c)
        sizes.push_back({seam.components.vertices[c], seam.components.faces[c], seam.components.border[c],
                         seam.components.folded[c]});
      const std::size_t own = store_.patches()[p].vertices;
      for (std::size_t f = 0; f < seam.foreign.size(); ++f) {
        const VertexKey key = seam.foreign[f];
        const std::int64_t owner = store_.find(brick_key(vertex_brick(key)));
        const PatchSeam* there = owner < 0 ? nullptr : &cache.get(static_cast<std::size_t>(owner));
        const auto at = there ? std::lower_bound(there->exported_key.begin(), there->exported_key.end(), key)
                              : std::vector<VertexKey>::const_iterator{};
        if (!there || at == there->exported_key.end() || *at != key)
          throw std::logic_error("weld: brick " + std::to_string(store_.patches()[p].key) + " names vertex " +
                                 std::to_string(key) + ", which its owner does not have");
        const auto vertex = there->exported_index[static_cast<std::size_t>(at - there->exported_key.begin())];
        slots.push_back({static_cast<std::uint32_t>(owner), vertex});
        links.push_back(
            {first_component_[p] + seam.components.of_vertex[own + f],
             first_component_[static_cast<std::size_t>(owner)] + there->components.of_vertex[vertex]});
      }
      if (links.size() > compact_at) {
        unique_links(links);
        compact_at = 2 * links.size() + 4096;
      }
      context.advance(1);
    }
    unique_links(links);
    PackedWriter file(context.create(weld_file_name(task)), kWeldKind);
    const std::vector<Section> sections = {file.append(bytes_of(slots)), file.append(bytes_of(links)),
                                           file.append(bytes_of(sizes))};
    context.count_written(file.finish(sections));
    return {{"shared_vertices", slots.size()}};
  }

  std::uint64_t finish_bytes() const override {
    return weld_finish_bytes(store_.patches().size(), first_component_.back());
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    const std::uint64_t count = first_component_.back();
    DisjointSets<std::uint64_t> sets(count);
    std::vector<ComponentSize> sizes;
    sizes.reserve(count);
    for (std::size_t file = 0; file < store_.file_count(); ++file) {
      const WeldFile in(work_ / weld_file_name(file));
      for (const Link& link : in.file.load<Link>(in.links)) sets.unite(link.a, link.b);
      const auto own = in.file.load<ComponentSize>(in.sizes);
      sizes.insert(sizes.end(), own.begin(), own.end());
    }
    return number(sets.roots(), sizes, summaries, context);
  }

 private:
  static void unique_links(std::vector<Link>& links) {
    std::sort(links.begin(), links.end());
    links.erase(std::unique(links.begin(), links.end()), links.end());
  }

  Json number(const std::vector<std::uint64_t>& root, const std::vector<ComponentSize>& sizes,
              const std::vector<Json>& summaries, TaskContext& context) const {
    std::vector<std::uint64_t> faces(root.size(), 0), border(root.size(), 0), folded(root.size(), 0);
    std::uint64_t all_faces = 0, largest = 0;
    for (std::uint64_t c = 0; c < root.size(); ++c) {
      faces[root[c]] += sizes[c].faces;
      border[root[c]] += sizes[c].border;
      folded[root[c]] += sizes[c].folded;
      all_faces += sizes[c].faces;
    }
    for (const std::uint64_t f : faces) largest = std::max(largest, f);
    const std::uint64_t given =
        rules_.min_component != 0 ? rules_.min_component : std::min(rules_.automatic, largest);
    const std::uint64_t limit = given != 0 ? given : automatic_min_component(all_faces);
    Numbering numbering;
    numbering.kept.resize(root.size());
    std::uint64_t components = 0;
    std::uint64_t dropped = 0;
    for (std::uint64_t c = 0; c < root.size(); ++c) {
      const std::uint64_t f = faces[root[c]];
      numbering.kept[c] =
          given != 0 ? f >= limit : island_stays({f, border[root[c]], folded[root[c]]}, limit, f, largest);
      if (root[c] != c || faces[c] == 0) continue;
      (numbering.kept[c] ? components : dropped) += 1;
    }
    numbering.patches.resize(store_.patches().size());
    std::uint64_t shared = 0;
    for (const Json& s : summaries) shared += s.at("shared_vertices").get<std::uint64_t>();
    for (std::size_t file = 0; file < store_.file_count(); ++file) {
      const auto [first, last] = store_.file_range(file);
      std::uint64_t offset = 0;
      for (std::size_t p = first; p < last; ++p) {
        PatchSpan& range = numbering.patches[p];
        range.first_vertex = numbering.vertices;
        range.first_component = first_component_[p];
        range.foreign_offset = offset;
        offset += sizeof(VertexSlot) * store_.patches()[p].foreign;
        for (std::uint64_t c = first_component_[p]; c < first_component_[p + 1]; ++c) {
          if (!numbering.kept[c]) continue;
          range.kept_vertices += sizes[c].vertices;
          range.kept_faces += sizes[c].faces;
        }
        numbering.vertices += range.kept_vertices;
        numbering.faces += range.kept_faces;
      }
    }
    if (numbering.faces == 0) {
      throw EmptyError(all_faces == 0 ? rules_.nothing : too_small(limit, rules_.reason));
    }
    if (largest < rules_.automatic && components + dropped > kManyCrumbs)
      throw EmptyError("the surface falls into " + std::to_string(components + dropped) +
                       " crumbs, the largest of " + std::to_string(largest) +
                       " faces: what the solids enclose is thinner than the lattice spacing; give a smaller "
                       "--resolution, or thicken them (--offset)");
    numbering.save(context.create(kNumberingFile));
    return {{"vertices", numbering.vertices},
            {"faces", numbering.faces},
            {"components", components},
            {"largest_component_faces", largest},
            {"min_component_faces", limit},
            {"islands_dropped", dropped},
            {"island_faces_dropped", all_faces - numbering.faces},
            {"shared_seam_vertices", shared}};
  }

  WeldRules rules_;
  std::filesystem::path work_;
  PatchStore store_;
  std::vector<std::uint64_t> first_component_;
};

}  // namespace

std::uint64_t weld_task_bytes(std::span<const PatchEntry> patches) {
  std::uint64_t bytes = kSeamCacheBytes + (8u << 20);
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches) {
    bytes += sizeof(VertexSlot) * e.foreign + sizeof(ComponentSize) * e.components +
             2 * sizeof(Link) * e.components;
    largest =
        std::max<std::uint64_t>(largest, 4ull * e.vertices + 28ull * (e.foreign + std::uint64_t{e.exported}));
  }
  return bytes + 2 * largest;
}

std::uint64_t weld_finish_bytes(std::uint64_t patches, std::uint64_t components) {
  // Union-find, sizes and the kept flags; places of the patches; one file's links.
  return components * 53 + patches * sizeof(PatchSpan) + (64u << 20);
}

std::uint64_t automatic_min_component(std::uint64_t faces) {
  return std::clamp<std::uint64_t>(faces / 500, 50, 1000);
}

bool is_shred(const IslandShape& island, std::uint64_t size, std::uint64_t largest) {
  if (size >= largest / kShredShare || island.faces >= kShredDepth * island.border) return false;
  return island.faces < kSmoothDepth * island.border || kFoldedPart * island.folded > island.faces;
}

bool is_piece(const IslandShape& island) {
  return island.faces >= kPieceFaces && island.faces >= kPieceDepth * island.border &&
         kFoldedPart * island.folded <= island.faces;
}

bool island_stays(const IslandShape& island, std::uint64_t limit, std::uint64_t size, std::uint64_t largest) {
  return island.faces >= limit ? !is_shred(island, size, largest) : is_piece(island);
}

std::string too_small(std::uint64_t limit, const std::string& reason) {
  const std::string islands = "every island has fewer than " + std::to_string(limit) + " faces";
  return reason.empty() ? islands + "; lower --min-component (1 keeps all)" : islands + ": " + reason;
}

PatchStore open_patches(const std::filesystem::path& work) {
  return PatchStore(list_task_files(work / "mesh", ".tsm"));
}

std::string weld_file_name(std::size_t file) {
  return "weld/" + task_file_stem(file) + ".tsw";
}

WeldFile::WeldFile(const std::filesystem::path& path) : file(path, kWeldKind, sizeof(Section)) {
  const auto sections = file.table<Section>();
  slots = sections.at(0), links = sections.at(1), sizes = sections.at(2);
}

void Numbering::save(const std::filesystem::path& path) const {
  PackedWriter file(path, kNumberingKind);
  const std::vector<Section> sections = {file.append(bytes_of(patches)), file.append(bytes_of(kept))};
  const std::array<std::uint64_t, 2> totals = {vertices, faces};
  file.finish(sections, bytes_of(totals));
}

Numbering Numbering::load(const std::filesystem::path& path) {
  std::array<std::uint64_t, 2> totals{};
  const PackedFile file(path, kNumberingKind, sizeof(Section), sizeof totals);
  std::memcpy(totals.data(), file.info().data(), sizeof totals);
  const auto sections = file.table<Section>();
  return {file.load<PatchSpan>(sections.at(0)), file.load<std::uint8_t>(sections.at(1)), totals[0],
          totals[1]};
}

std::string no_surface(const std::string& reason) {
  if (!reason.empty()) return "no surface: " + reason;
  return "no surface: no lattice cell has enough points around it; try a larger --resolution or --radius, or "
         "check the "
         "normals";
}

std::unique_ptr<Stage> make_weld_stage(const JobState& state) {
  const std::string reason = clump_sentence(state.work);
  return make_weld_stage_by(state, {reconstruct_options(state).min_component, no_surface(reason), 0, reason});
}
std::unique_ptr<Stage> make_weld_stage_by(const JobState& state, const WeldRules& rules) {
  return std::make_unique<WeldStage>(state, rules);
}

namespace {

constexpr double kWeldTime = 0.03;  ///< microseconds a face

}  // namespace

StageForecast forecast_weld(const PlannedScan& scan) {
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(weld_task_bytes),
          .finish_bytes = weld_finish_bytes(scan.patches.entries.size(), scan.patches.components()),
          .sure_bytes = weld_finish_bytes(0, 0),
          .files = scan.groups.size(),
          .processor_us = scan.faces * kWeldTime};
}

}  // namespace tessera
