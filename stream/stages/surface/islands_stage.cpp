#include "stream/stages/surface/islands_stage.h"

#include <algorithm>
#include <vector>

#include "octree/error.h"
#include "octree/union_find.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/points/cell_ladder.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kPage = 1u << 14;  ///< records read at once

/// Parts that are one piece.
struct Island {
  IslandShape shape;
  /// Faces counted in cells of the coarsest level, as the limit is: a finer level has four for one, and islands of sparse
  /// points must not look small for that.
  double large_faces = 0.0;
};

class IslandsStage : public SerialStage {
 public:
  explicit IslandsStage(const JobState& state)
      : state_(state),
        coarsest_(reconstruct_options(state).levels - 1),
        files_(list_task_files(state.work / kIslandFolder, ".tsi")) {
    for (const auto& path : files_) {
      const PackedFile file(path, kIslandKind, sizeof(IslandEntry));
      const IslandEntry& e = entries_.emplace_back(file.table<IslandEntry>().at(0));
      parts_ += e.parts.bytes / sizeof(IslandPart);
      dropped_ += e.dropped;
      dropped_faces_ += e.dropped_faces;
    }
  }

  std::string name() const override { return "islands"; }
  std::uint64_t units() const override { return parts_; }
  std::string unit_name() const override { return "components"; }
  std::uint64_t finish_bytes() const override { return islands_bytes(state_.run, parts_); }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    DisjointSets<std::uint64_t> sets(parts_);
    std::vector<std::uint64_t> faces(parts_, 0), border(parts_, 0), folded(parts_, 0);
    std::vector<std::uint8_t> level(parts_, 0);
    ExternalSort<IslandSeam> sort(state_.work, sort_bytes(state_.run));
    std::uint64_t first = 0;
    for (std::size_t f = 0; f < files_.size(); ++f) {
      context.check_stop();
      std::uint64_t part = first;
      read<IslandPart>(f, entries_[f].parts, [&](const IslandPart& p) {
        faces[part] = p.faces;
        level[part] = static_cast<std::uint8_t>(p.level);
        folded[part] = p.folded;
        border[part++] = p.border;
      });
      read<IslandSeam>(f, entries_[f].seams, [&](const IslandSeam& s) { sort.add({s.key, s.part + first}); });
      first = part;
    }
    IslandSeam last{~std::uint64_t{0}, 0};
    sort.drain([&](std::span<const IslandSeam> batch) {
      context.check_stop();
      for (const IslandSeam& s : batch) {
        if (s.key == last.key) sets.unite(last.part, s.part);
        last = s;
      }
    });
    const std::vector<std::uint64_t>& root = sets.roots();
    std::uint64_t all_faces = 0;
    std::vector<Island> island(parts_);
    for (std::uint64_t c = 0; c < parts_; ++c) {
      island[root[c]].shape.faces += faces[c];
      island[root[c]].shape.border += border[c];
      island[root[c]].shape.folded += folded[c];
      island[root[c]].large_faces += static_cast<double>(faces[c]) * share_of(level[c]);
      all_faces += faces[c];
    }
    return decide(root, island, all_faces, context);
  }

 private:
  template <class Record, class Use>
  void read(std::size_t file, const Section& section, const Use& use) const {
    const PackedFile in(files_[file], kIslandKind, sizeof(IslandEntry));
    SectionReader reader(in, section);
    std::vector<Record> page(std::min(section.bytes / sizeof(Record), kPage));
    while (reader.left() > 0) {
      const std::uint64_t n = std::min(reader.left() / sizeof(Record), kPage);
      reader.next(page.data(), n * sizeof(Record));
      for (std::uint64_t i = 0; i < n; ++i) use(page[i]);
    }
  }

  /// Area of a face of a level, as a share of one of the coarsest level.
  double share_of(std::uint64_t level) const {
    return 1.0 / static_cast<double>(std::uint64_t{1} << 2 * (coarsest_ - level));
  }

  Json decide(const std::vector<std::uint64_t>& root, const std::vector<Island>& island,
              std::uint64_t all_faces, TaskContext& context) const {
    const std::uint64_t given = reconstruct_options(state_).min_component;
    std::uint64_t components = 0, dropped = dropped_, largest = 0, kept_faces = 0;
    double all_large = 0.0, largest_large = 0.0;
    for (const Island& i : island) {
      largest = std::max(largest, i.shape.faces);
      largest_large = std::max(largest_large, i.large_faces);
      all_large += i.large_faces;
    }
    const auto counted = [](double faces) { return static_cast<std::uint64_t>(faces); };
    const std::uint64_t dropped_at_once = coarsest_ == 0 ? dropped_faces_ : 0;  // else of any level, and few
    const std::uint64_t limit =
        given != 0 ? given : automatic_min_component(counted(all_large) + dropped_at_once);
    const auto stays = [&](const Island& i) {
      return given != 0 ? i.shape.faces >= limit
                        : island_stays(i.shape, limit, counted(i.large_faces), counted(largest_large));
    };
    for (std::uint64_t c = 0; c < parts_; ++c) {
      if (root[c] != c) continue;
      (stays(island[c]) ? components : dropped) += 1;
      if (stays(island[c])) kept_faces += island[c].shape.faces;
    }
    if (kept_faces == 0) {
      const std::string reason = clump_sentence(state_.work);
      throw EmptyError(all_faces + dropped_faces_ == 0 ? no_surface(reason) : too_small(limit, reason));
    }
    PackedWriter out(context.create(kDroppedFile), kDroppedKind, std::size_t{1} << 16);
    std::vector<Section> sections;
    std::uint64_t part = 0;
    for (std::size_t f = 0; f < files_.size(); ++f) {
      std::vector<IslandPart> gone;
      read<IslandPart>(f, entries_[f].parts, [&](const IslandPart& p) {
        if (!stays(island[root[part++]])) gone.push_back(p);
      });
      sections.push_back(out.append(bytes_of(gone)));
    }
    context.count_written(out.finish(sections));
    return {{"components", components},
            {"largest_component_faces", largest},
            {"min_component_faces", limit},
            {"islands_dropped", dropped},
            {"island_faces_dropped", all_faces - kept_faces + dropped_faces_},
            {"full_faces", kept_faces}};
  }

  JobState state_;
  std::uint64_t coarsest_;
  std::vector<std::filesystem::path> files_;
  std::vector<IslandEntry> entries_;
  std::uint64_t parts_ = 0;
  std::uint64_t dropped_ = 0, dropped_faces_ = 0;  ///< in the surface stage
};

}  // namespace

std::uint64_t islands_bytes(const RunOptions& run, std::uint64_t parts) {
  return parts * 72 + sort_bytes(run) + (std::uint64_t{8} << 20);
}

std::unique_ptr<Stage> make_islands_stage(const JobState& state) {
  return std::make_unique<IslandsStage>(state);
}

StageForecast forecast_islands(const PlannedScan& scan) {
  return {.finish_bytes = islands_bytes(scan.run, scan.patches.components()),
          .sure_bytes = islands_bytes(scan.run, 0),
          .files = 1};
}

}  // namespace tessera
