/// Stage "tiles" of an import: the faces of each bucket become patches.
#include <algorithm>
#include <map>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/bucket_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/import/import_bytes.h"
#include "stream/import/import_stages.h"

namespace tessera {
namespace {

/// Vertices of a tile: its own and those of its faces that others own, ascending by number.
struct TileVertices {
  std::vector<std::uint32_t> number;
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;
  std::uint64_t unreferenced = 0;
};

class ImportTilesStage : public Stage {
 public:
  ImportTilesStage(const JobState& state, ImportSource source)
      : work_(state.work),
        source_(std::move(source)),
        names_(source_.folder),
        vertices_(state.work, source_.folder),
        dealt_(state.work / names_.dealt_faces(), sizeof(RepairFace)) {}

  std::string name() const override { return source_.folder + "-tiles"; }
  std::size_t task_count() const override { return vertices_.plan().buckets(); }
  std::uint64_t units() const override {
    std::uint64_t sum = 0;
    for (std::size_t b = 0; b < task_count(); ++b) sum += dealt_.records(b);
    return sum;
  }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const std::uint64_t own = vertices_.first(task + 1) - vertices_.first(task);
    const std::uint64_t faces = dealt_.records(task);
    return import_tiles_task_bytes(own, faces, repair_bytes(faces));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    RepairTile tile;
    tile.faces = dealt_.load<RepairFace>(task);
    const std::vector<RepairFace> synthetic = take_synthetic(tile.faces);
    tile.own_begin = vertices_.first(task);
    tile.own_end = vertices_.first(task + 1);
    tile.orient = task_count() == 1;
    const std::uint64_t units = tile.faces.size();
    context.count_read(units * sizeof(RepairFace));
    const BucketVertices own = vertices_.load(task);
    const TileVertices v = gather(tile, own);
    tile.number = v.number;
    tile.position = v.position;
    const RepairResult result = repair_tile(std::move(tile));
    context.check_stop();

    MeshFileWriter writer(context.create(names_.tiles(task)), vertices_.plan().info);
    std::vector<std::uint32_t> local(v.number.size(), kNone);
    std::size_t face = 0;
    for (std::size_t b = 0; b < own.brick.size(); ++b) {
      const std::size_t begin = face;
      const std::uint32_t end_number =
          b + 1 < own.brick.size() ? vertices_.first(task) + own.first[b + 1] : vertices_.first(task + 1);
      while (face < result.faces.size() && result.faces[face][0] < end_number) ++face;
      if (face > begin)
        writer.add(own.brick[b], make_patch(v, result, begin, face, end_number, synthetic, local));
    }
    context.count_written(writer.finish());
    std::uint64_t remote = 0;
    if (!result.fixes.empty()) {
      DirectFile file(context.create(names_.fixes(task)), std::size_t{1} << 16);
      for (const RepairFix& fix : result.fixes) {
        const auto at = std::lower_bound(v.number.begin(), v.number.end(), fix.face[0]) - v.number.begin();
        const PlacedFix placed{vertices_.plan().brick_of(v.position[static_cast<std::size_t>(at)]), fix};
        file.write(&placed, sizeof placed);
        remote += fix.slot >= 3;
      }
      context.count_written(file.finish());
    }
    context.advance(units);
    const RepairReport& r = result.report;
    return {{"faces", result.faces.size()},
            {"unreferenced_vertices", v.unreferenced},
            {"duplicate_faces", r.duplicate_faces},
            {"nonmanifold_edges", r.nonmanifold_edges},
            {"inconsistent_edges", r.inconsistent_edges},
            {"turned_faces", r.reversed_faces},
            {"split_vertices", r.split_vertices},
            {"border_edges", r.border_edges + remote},
            {"fixes", result.fixes.size()}};
  }

  std::uint64_t finish_bytes() const override { return kImportTilesFinishBytes; }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    Json sum = Json::object();
    for (const Json& s : summaries)
      for (const auto& [key, value] : s.items())
        sum[key] = sum.value(key, std::uint64_t{0}) + value.get<std::uint64_t>();
    ExternalSort<PlacedFix> sort(work_, kImportSortBytes);
    for (std::size_t b = 0; b < task_count(); ++b) {
      if (summaries[b].at("fixes") == 0) continue;
      std::vector<PlacedFix> page(1u << 14);
      const ReadFile file(work_ / names_.fixes(b));
      for (std::uint64_t at = 0; at < file.size();) {
        context.check_stop();
        const std::uint64_t bytes =
            std::min<std::uint64_t>(page.size() * sizeof(PlacedFix), file.size() - at);
        file.read_at(at, page.data(), bytes);
        at += bytes;
        for (std::size_t i = 0; i < bytes / sizeof(PlacedFix); ++i) sort.add(page[i]);
      }
    }
    DirectFile file(context.create(names_.all_fixes()));
    sort.drain([&](std::span<const PlacedFix> batch) { file.write(batch.data(), batch.size_bytes()); });
    context.count_written(file.finish());
    if (sum.value("faces", std::uint64_t{0}) == 0)
      throw EmptyError(
          "the mesh has no face with three different vertices: there is nothing to work on; export it with "
          "its triangles");
    return sum;
  }

  std::vector<std::string> obsolete() const override {
    return {names_.dealt_faces(), names_.root + "vertices/"};
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  TileVertices gather(const RepairTile& tile, const BucketVertices& own) const {
    std::vector<std::uint8_t> used(tile.own_end - tile.own_begin, 0);
    std::vector<std::uint32_t> foreign;
    for (const RepairFace& f : tile.faces)
      for (const std::uint32_t n : f) {
        const std::uint32_t i = n - tile.own_begin;
        if (i < used.size())
          used[i] = 1;
        else
          foreign.push_back(n);
      }
    std::sort(foreign.begin(), foreign.end());
    foreign.erase(std::unique(foreign.begin(), foreign.end()), foreign.end());
    const auto after = std::lower_bound(foreign.begin(), foreign.end(), tile.own_begin);
    const auto split = static_cast<std::size_t>(after - foreign.begin());
    TileVertices v;
    const std::size_t total = foreign.size() + used.size();
    v.number.reserve(total);
    v.position.reserve(total);
    if (!own.rgba.empty()) v.rgba.reserve(total);
    const auto take_foreign = [&](std::size_t first, std::size_t last) {
      v.number.insert(v.number.end(), foreign.begin() + static_cast<std::ptrdiff_t>(first),
                      foreign.begin() + static_cast<std::ptrdiff_t>(last));
      vertices_.fetch({foreign.data() + first, last - first}, v.position, v.rgba);
    };
    take_foreign(0, split);
    for (std::uint32_t i = 0; i < used.size(); ++i) {
      if (!used[i]) {
        ++v.unreferenced;
        continue;
      }
      v.number.push_back(tile.own_begin + i);
      v.position.push_back(own.position[i]);
      if (!own.rgba.empty()) v.rgba.push_back(own.rgba[i]);
    }
    take_foreign(split, foreign.size());
    return v;
  }

  static RepairFace ascending(RepairFace f) {
    std::sort(f.begin(), f.end());
    return f;
  }

  /// Takes the marks off the faces that close holes; returns those faces by their corners, ascending.
  static std::vector<RepairFace> take_synthetic(std::vector<RepairFace>& faces) {
    std::vector<RepairFace> marked;
    for (RepairFace& f : faces) {
      if ((f[0] & kSyntheticCorner) == 0) continue;
      f[0] &= ~kSyntheticCorner;
      marked.push_back(ascending(f));
    }
    std::sort(marked.begin(), marked.end());
    return marked;
  }

  /// Vertices of faces [begin, end) of one brick that are no copies, ascending: those of the brick follow each other.
  /// \param local  kNone before; not kNone for them after
  static std::vector<std::uint32_t> used_vertices(const TileVertices& v, const RepairResult& result,
                                                  std::size_t begin, std::size_t end,
                                                  std::uint32_t end_number,
                                                  std::vector<std::uint32_t>& local) {
    const auto own_end = static_cast<std::uint32_t>(
        std::lower_bound(v.number.begin(), v.number.end(), end_number) - v.number.begin());
    std::vector<std::uint32_t> used, others;
    for (std::size_t f = begin; f < end; ++f)
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t at = result.local[f][c];
        if (result.copy[f][c] != 0 || local[at] != kNone) continue;
        local[at] = 0;
        if (at >= own_end) others.push_back(at);
      }
    // Faces ascend by their smallest corners.
    for (std::uint32_t at = result.local[begin][0]; at < own_end; ++at)
      if (local[at] != kNone) used.push_back(at);
    std::sort(others.begin(), others.end());
    used.insert(used.end(), others.begin(), others.end());
    return used;
  }

  /// Faces [begin, end) of one brick, whose vertices end at `end_number`. \param synthetic  ascending
  static MeshBlock make_patch(const TileVertices& v, const RepairResult& result, std::size_t begin,
                              std::size_t end, std::uint32_t end_number,
                              const std::vector<RepairFace>& synthetic, std::vector<std::uint32_t>& local) {
    MeshBlock block;
    const std::vector<std::uint32_t> used = used_vertices(v, result, begin, end, end_number, local);
    block.key.reserve(used.size());
    block.position.reserve(used.size());
    if (!v.rgba.empty()) block.rgba.reserve(used.size());
    const auto add = [&](std::uint32_t at, std::uint16_t copy) {
      block.key.push_back(vertex_copy_key(v.number[at], copy));
      block.position.push_back(v.position[at]);
      if (!v.rgba.empty()) block.rgba.push_back(v.rgba[at]);
      return static_cast<std::uint32_t>(block.key.size() - 1);
    };
    for (const std::uint32_t at : used) local[at] = add(at, 0);
    std::map<std::uint64_t, std::uint32_t> copies;  // of split vertices, by key
    block.faces.resize(end - begin);
    block.face_flags.assign(result.border.begin() + static_cast<std::ptrdiff_t>(begin),
                            result.border.begin() + static_cast<std::ptrdiff_t>(end));
    for (std::size_t f = begin; f < end; ++f) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t at = result.local[f][c];
        const std::uint16_t copy = result.copy[f][c];
        if (copy != 0) {
          const auto [it, fresh] = copies.try_emplace(vertex_copy_key(v.number[at], copy), 0);
          if (fresh) it->second = add(at, copy);
          block.faces[f - begin][c] = it->second;
          continue;
        }
        block.faces[f - begin][c] = local[at];
      }
      if (!synthetic.empty() &&
          std::binary_search(synthetic.begin(), synthetic.end(), ascending(result.faces[f])))
        block.face_flags[f - begin] |= kFaceSynthetic;
    }
    for (const std::uint32_t at : used) local[at] = kNone;
    block.vertex_class.assign(block.key.size(), VertexClass::kSmooth);
    if (!copies.empty() || !sort_stars(block)) canonicalise(block);
    return block;
  }

  /// As canonicalise() of a block whose vertices ascend by key and whose faces ascend by their first, smallest corners.
  /// False, with faces left in any order, where too many have the same.
  static bool sort_stars(MeshBlock& block) {
    constexpr std::size_t kMany = 64;
    auto& faces = block.faces;
    for (std::size_t f = 1, star = 0; f < faces.size(); ++f) {
      if (faces[f][0] != faces[f - 1][0]) star = f;
      if (f - star > kMany) return false;
      if (!(faces[f] < faces[f - 1])) continue;
      const auto face = faces[f];
      const std::uint8_t flags = block.face_flags[f];
      std::size_t to = f;
      for (; to > star && face < faces[to - 1]; --to) {
        faces[to] = faces[to - 1];
        block.face_flags[to] = block.face_flags[to - 1];
      }
      faces[to] = face;
      block.face_flags[to] = flags;
    }
    return true;
  }

  std::filesystem::path work_;
  ImportSource source_;
  ImportNames names_;
  ImportedVertices vertices_;
  BucketFile dealt_;
};

}  // namespace

std::unique_ptr<Stage> make_import_tiles_stage(const JobState& state, const ImportSource& source) {
  return std::make_unique<ImportTilesStage>(state, source);
}

}  // namespace tessera
