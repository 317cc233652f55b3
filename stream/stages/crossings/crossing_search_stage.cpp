#include <algorithm>
#include <numeric>

#include "kernels/holes/crossing_mend.h"
#include "kernels/mesh/block_contacts.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/crossings/crossing_pairs.h"
#include "stream/stages/crossings/crossing_parts.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSearchTaskFaces = 500'000, kMaxSearchTasks = 400;
constexpr std::uint64_t kMinTileFaces = 4096, kMaxTileFaces = 1u << 18;
/// Whole patches around a tile count: four times as much as the tile itself, for small ones.
constexpr std::uint64_t kTileHalo = 4;
constexpr std::uint64_t kSearchSlack = std::uint64_t{4} << 20;

/// Patches that are searched together. Tiles carry no meaning.
struct SearchTile {
  std::vector<std::size_t> patches;
  std::uint64_t bytes = 0;
};

/// Of a tile at most, so that it and what may lie around it take half of what a thread has.
std::uint64_t tile_faces(const RunOptions& run) {
  const std::uint64_t thread_bytes =
      run.memory_bytes / 2 / static_cast<std::uint64_t>(std::max(1, run.threads));
  const std::uint64_t face_bytes = (crossing_tile_bytes(1024, 2048) - kSearchSlack) / 2048;
  return std::clamp(thread_bytes / (kTileHalo * face_bytes), kMinTileFaces, kMaxTileFaces);
}

class CrossingSearchStage : public Stage {
 public:
  CrossingSearchStage(const JobState& state, const CrossingPlan& plan)
      : name_(crossing_search_name(plan)),
        mesh_(open_to_mend(state, plan)),
        written_(written_position(plan.placed ? plan.placed(state) : MeshPlacement{})),
        asked_for_(plan.asked_for),
        largest_bytes_(largest_guess_bytes(state.run.memory_bytes)) {
    max_faces_ = tile_faces(state.run);
    cut(0, mesh_.patches().size());
    const std::uint64_t target = std::max(kSearchTaskFaces, mesh_.face_count() / kMaxSearchTasks);
    std::uint64_t faces = target;
    for (std::size_t t = 0; t < tiles_.size(); ++t) {
      if (faces >= target) first_.push_back(t), faces = 0;
      for (const std::size_t p : tiles_[t].patches) faces += mesh_.patches()[p].faces;
    }
    first_.push_back(tiles_.size());
  }

  std::string name() const override { return name_; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return mesh_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t t = first_[task]; t < first_[task + 1]; ++t)
      maximum = std::max(maximum, tiles_[t].bytes);
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    DirectFile file(context.create(name_ + "/" + task_file_stem(task) + ".pairs"), std::size_t{1} << 16);
    std::uint64_t crossing = 0, overlapping = 0, touching = 0, in_copies = 0;
    for (std::size_t t = first_[task]; t < first_[task + 1]; ++t) {
      context.check_stop();
      in_copies += find(load(tiles_[t], task_bytes(task)), [&](const CrossingPair& pair) {
        const auto contact = static_cast<FaceContact>(pair.contact);
        ++(contact == FaceContact::kCross     ? crossing
           : contact == FaceContact::kOverlap ? overlapping
                                              : touching);
        if (crossing + overlapping + touching <= kMaxCrossingPairs) file.write(&pair, sizeof pair);
        if ((crossing + overlapping + touching) % 4096 == 0) context.check_stop();
      });
      for (const std::size_t p : tiles_[t].patches) context.advance(mesh_.patches()[p].faces);
    }
    context.count_written(file.finish());
    return {{"crossing", crossing},
            {"overlapping", overlapping},
            {"touching", touching},
            {"touching_in_copies", in_copies}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    Json sum = sum_counts(summaries,
                          {{"crossing", 0}, {"overlapping", 0}, {"touching", 0}, {"touching_in_copies", 0}});
    sum["crossing_pairs"] = sum.at("crossing").get<std::uint64_t>() +
                            sum.at("overlapping").get<std::uint64_t>() +
                            sum.at("touching").get<std::uint64_t>();
    if (const auto copies = sum.at("touching_in_copies").get<std::uint64_t>(); asked_for_ && copies > 0)
      sum["warnings"].push_back(std::to_string(copies) +
                                " pairs of faces touch in copies of vertices alone, where edges of more than "
                                "two faces and vertices of several fans were "
                                "taken apart: the copies lie at one position, repairing leaves them there, "
                                "and `check --crossings` counts them as touching");
    return sum;
  }

 private:
  /// Patches in the order of their bricks, parted where the octree has its nodes.
  void cut(std::size_t first, std::size_t end) {
    if (first == end) return;
    const auto patches = mesh_.patches();
    std::uint64_t faces = 0;
    for (std::size_t p = first; p < end; ++p) faces += patches[p].faces;
    if (faces <= max_faces_ || end - first == 1) {
      SearchTile tile;
      tile.patches.resize(end - first);
      std::iota(tile.patches.begin(), tile.patches.end(), first);
      std::uint64_t near_vertices = 0, near_faces = 0;
      for (const std::size_t p : mesh_.select(mesh_.box_of(tile.patches)))
        near_vertices += patches[p].vertices, near_faces += patches[p].faces;
      // What the table tells is far above what is near as a rule: load() looks before it loads more.
      tile.bytes = std::max(crossing_tile_bytes(0, 0), crossing_tile_bytes(near_vertices, near_faces));
      std::uint64_t own_vertices = 0;
      for (std::size_t p = first; p < end; ++p) own_vertices += patches[p].vertices;
      tile.bytes = std::max(crossing_tile_bytes(own_vertices, faces), std::min(tile.bytes, largest_bytes_));
      tiles_.push_back(std::move(tile));
      return;
    }
    int shift = 0;
    while (shift < 60 && (patches[first].key >> shift >> 3) != (patches[end - 1].key >> shift >> 3))
      shift += 3;
    for (std::size_t at = first; at < end;) {
      std::size_t next = at;
      while (next < end && patches[next].key >> shift == patches[at].key >> shift) ++next;
      cut(at, next);
      at = next;
    }
  }

  MeshHaloBlock load(const SearchTile& tile, std::uint64_t bytes) const {
    const MeshBox box = mesh_.box_of(tile.patches);
    std::uint64_t vertices = 0, faces = 0;
    for (const std::size_t p : mesh_.select(box))
      vertices += mesh_.patches()[p].vertices, faces += mesh_.patches()[p].faces;
    if (crossing_tile_bytes(vertices, faces) > bytes) {
      vertices = faces = 0;
      for (const std::size_t p : mesh_.select(box)) {
        const MeshBlock patch = mesh_.load({&p, 1});
        const std::vector<std::uint8_t> near = faces_in_box(patch, box);
        const auto some = static_cast<std::uint64_t>(std::count(near.begin(), near.end(), 1));
        faces += some;
        vertices += std::min<std::uint64_t>(3 * some, patch.key.size());
      }
      if (const std::uint64_t needed = crossing_tile_bytes(vertices, faces); needed > bytes)
        throw ResourceError(name_ + ": the " + std::to_string(faces) + " faces around one patch take " +
                            format_bytes(needed) + "; raise --memory to " +
                            std::to_string(cap_mib_for_guess(needed)) + "M");
    }
    return mesh_.load_near(tile.patches, 0.0);
  }

  /// Faces are in the order of their keys in every block: the tile of the first one has the pair.
  /// \return pairs that meet in copies of vertices alone, which are none
  template <class Use>
  std::uint64_t find(MeshHaloBlock near, const Use& use) const {
    MeshBlock& block = near.block;
    std::vector<Double3> position;
    if (written_) {
      position = block.position;
      for (Double3& p : block.position) p = written_(p);
    }
    const auto place = [&](std::uint32_t v) { return written_ ? position[v] : block.position[v]; };
    std::vector<std::uint32_t> number;
    const std::vector<ContactFace> faces = doubtful_faces(block, &number);
    std::uint64_t in_copies = 0;
    const auto tell = [&](std::uint32_t i, std::uint32_t j, FaceContact contact) {
      if (near.core[number[i]] == 0) return;
      if (meet_in_copies(faces[i], faces[j])) {
        ++in_copies;
        return;
      }
      CrossingPair pair;
      pair.face = {face_keys(block, number[i]), face_keys(block, number[j])};
      for (std::size_t side = 0; side < 2; ++side)
        for (std::size_t k = 0; k < 3; ++k)
          pair.corners[side][k] = place(block.faces[number[side == 0 ? i : j]][k]);
      if (pair.face[1] < pair.face[0])
        std::swap(pair.face[0], pair.face[1]), std::swap(pair.corners[0], pair.corners[1]);
      pair.contact = static_cast<std::uint64_t>(contact);
      use(pair);
    };
    block_contacts(faces, kAllSpace, tell, ContactOrder::kAny);
    return in_copies;
  }

  std::string name_;
  MeshStore mesh_;
  std::function<Double3(const Double3&)> written_;
  bool asked_for_ = false;
  std::uint64_t largest_bytes_ = 0, max_faces_ = 0;
  std::vector<SearchTile> tiles_;
  std::vector<std::size_t> first_;  ///< tile by task, one more at the end
};

}  // namespace

std::uint64_t crossing_tile_bytes(std::uint64_t vertices, std::uint64_t faces) {
  // What is loaded is merged from pieces, so it is there twice for a moment; then the search works on it.
  return 2 * MeshStore::block_bytes(vertices, faces) + faces * (sizeof(ContactFace) + 8) +
         block_contacts_bytes(faces) + kSearchSlack;
}

std::uint64_t crossing_search_bytes(const RunOptions& run, std::uint64_t faces) {
  const std::uint64_t most = std::min(faces, kTileHalo * tile_faces(run));
  return crossing_tile_bytes(most / 2 + most / 8, most);
}

std::unique_ptr<Stage> make_crossing_search_stage(const JobState& state, const CrossingPlan& plan) {
  return std::make_unique<CrossingSearchStage>(state, plan);
}

}  // namespace tessera
