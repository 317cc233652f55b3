/// Stage "zip" of a merge: the strip and the cut borders of the meshes become one surface.
#include <algorithm>

#include "kernels/merge/zipper.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/edge_faces.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

constexpr double kGapCells = 2.5;  ///< the strip stays 0.6 clear, its faces are up to 1.7 wide
constexpr const char* kZippedFile = "zipped/000000.tmm";
constexpr const char* kCutFile = "cut/000000.tmm";

/// A vertex of the strip: patches that use it and do not own it have it too.
struct StripVertex {
  std::uint64_t key = 0;
  std::uint32_t foreign = 0;
  std::uint32_t slot = 0;
  auto operator<=>(const StripVertex&) const = default;
};

class ZipStage : public SerialStage {
 public:
  explicit ZipStage(const JobState& state)
      : plan_(MergePlan::of_work(state.work)),
        kept_(open_merge_store(state.work, "kept")),
        near_cut_(open_merge_store(state.work, "rims")),
        strip_(open_merge_store(state.work, "strip")) {}

  std::string name() const override { return "zip"; }
  std::uint64_t units() const override { return near_cut_.face_count() + strip_.face_count(); }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t finish_bytes() const override {
    std::uint64_t vertices = 0, faces = 0;
    for (const MeshStore* store : {&near_cut_, &strip_}) {
      for (const MeshPatchEntry& e : store->patches()) vertices += e.vertices;
      faces += store->face_count();
    }
    return merge_zip_bytes({vertices, faces},
                           std::max({kept_.largest_patch_bytes(), near_cut_.largest_patch_bytes(),
                                     strip_.largest_patch_bytes()}));
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    Pieces all = load(context);
    const Zipped zipped = zip(all.pieces, kGapCells * plan_.lattice.h);
    context.check_stop();
    std::uint64_t written = write_new(all, zipped, context);
    written += write_cut(all, zipped, context);
    context.count_written(written);
    Json result = {{"rim_faces", all.original_faces},
                   {"strip_faces", strip_.face_count()},
                   {"removed", zipped.report.removed},
                   {"stitches", zipped.report.added},
                   {"open_edges", zipped.report.open_edges}};
    if (zipped.report.open_edges > 0)
      result["warnings"].push_back(
          std::to_string(zipped.report.open_edges) +
          " edges along the joints found nothing to be stitched to and are borders now; a larger "
          "--blend or a smaller --resolution may do");
    if (zipped.report.pinched > 0)
      result["warnings"].push_back(
          std::to_string(zipped.report.pinched) +
          " vertices along the joints are of two pieces of surface, so tessera check --strict refuses the "
          "mesh; another --resolution may do");
    return result;
  }

  std::vector<std::string> obsolete() const override { return {"rims/", "strip/"}; }

 private:
  struct Pieces {
    ZipPieces pieces;
    std::vector<std::uint64_t> key;       ///< per vertex: in the merged mesh
    std::vector<std::uint32_t> rgba;      ///< per vertex of the strip, empty without colours
    std::vector<std::size_t> first_face;  ///< per patch near the cut: its first face here, and one more
    std::size_t original_faces = 0;
  };

  Pieces load(TaskContext& context) const {
    Pieces all;
    ZipPieces& z = all.pieces;
    // Originals: their vertices by key.
    for (std::size_t p = 0; p < near_cut_.patches().size(); ++p) {
      context.check_stop();
      const MeshBlock block = near_cut_.load({&p, 1});
      all.key.insert(all.key.end(), block.key.begin(), block.key.end());
    }
    std::sort(all.key.begin(), all.key.end());
    all.key.erase(std::unique(all.key.begin(), all.key.end()), all.key.end());
    z.position.resize(all.key.size());
    std::vector<std::uint8_t> cut;
    for (std::size_t p = 0; p < near_cut_.patches().size(); ++p) {
      context.check_stop();
      const MeshBlock block = near_cut_.load({&p, 1});
      std::vector<std::uint32_t> slot(block.key.size());
      for (std::size_t v = 0; v < slot.size(); ++v) {
        slot[v] = static_cast<std::uint32_t>(std::lower_bound(all.key.begin(), all.key.end(), block.key[v]) -
                                             all.key.begin());
        z.position[slot[v]] = block.position[v] - plan_.origin;
      }
      all.first_face.push_back(z.faces.size());
      for (std::size_t f = 0; f < block.faces.size(); ++f) {
        z.faces.push_back({slot[block.faces[f][0]], slot[block.faces[f][1]], slot[block.faces[f][2]]});
        z.edges.push_back(static_cast<std::uint8_t>(ZipPieces::kOriginal | (block.face_flags[f] & 7)));
        cut.push_back(static_cast<std::uint8_t>(block.face_flags[f] / kFaceCrease01 & 7));
      }
    }
    all.first_face.push_back(z.faces.size());
    all.original_faces = z.faces.size();
    mark_ends(z, cut);
    load_strip(all, context);
    return all;
  }

  /// Edges of originals near the cut with no face behind them here that are neither a border nor cut.
  static void mark_ends(ZipPieces& z, const std::vector<std::uint8_t>& cut) {
    EdgeFaces(z.position.size(), z.faces)
        .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
          const std::uint32_t f = half[0] / 3, k = half[0] % 3;
          if (half.size() == 1 && !(z.edges[f] >> k & 1) && !(cut[f] >> k & 1))
            z.edges[f] = static_cast<std::uint8_t>(z.edges[f] | ZipPieces::kGoesOn << k);
        });
  }

  void load_strip(Pieces& all, TaskContext& context) const {
    ZipPieces& z = all.pieces;
    std::vector<StripVertex> vertices;
    std::vector<Double3> position;
    std::vector<std::uint32_t> rgba;
    for (std::size_t p = 0; p < strip_.patches().size(); ++p) {
      context.check_stop();
      const MeshBlock block = strip_.load({&p, 1});
      for (std::size_t v = 0; v < block.key.size(); ++v) {
        const bool own = block.key[v] >> kSlotBits == strip_.patches()[p].key;
        vertices.push_back({block.key[v], own ? 0u : 1u, static_cast<std::uint32_t>(position.size())});
        position.push_back(block.position[v]);
        if (plan_.info.colour) rgba.push_back(block.rgba[v]);
      }
    }
    std::sort(vertices.begin(), vertices.end());
    std::vector<std::uint64_t> names;
    const std::size_t first = z.position.size();
    for (const StripVertex& v : vertices) {
      if (!names.empty() && names.back() == v.key) continue;
      names.push_back(v.key);
      z.position.push_back(position[v.slot] - plan_.origin);
      if (plan_.info.colour) all.rgba.push_back(rgba[v.slot]);
      all.key.push_back(merged_vertex(kStripRank, names.size() - 1));
    }
    for (std::size_t p = 0; p < strip_.patches().size(); ++p) {
      context.check_stop();
      const MeshBlock block = strip_.load({&p, 1});
      for (const auto& f : block.faces) {
        std::array<std::uint32_t, 3> corner;
        for (std::size_t k = 0; k < 3; ++k)
          corner[k] = static_cast<std::uint32_t>(
              first + static_cast<std::size_t>(std::lower_bound(names.begin(), names.end(), block.key[f[k]]) -
                                               names.begin()));
        z.faces.push_back(corner);
        z.edges.push_back(0);
      }
    }
  }

  /// What stays of the strip, and the stitches, as patches of the lattice's bricks.
  std::uint64_t write_new(const Pieces& all, const Zipped& zipped, TaskContext& context) const {
    MeshBlock block;
    block.key = all.key;
    for (const Double3& p : all.pieces.position) block.position.push_back(p + plan_.origin);
    for (std::size_t f = all.original_faces; f < all.pieces.faces.size(); ++f)
      if (!zipped.removed[f]) block.faces.push_back(all.pieces.faces[f]);
    block.faces.insert(block.faces.end(), zipped.added.begin(), zipped.added.end());
    block.vertex_class.assign(block.key.size(), VertexClass::kSmooth);
    block.face_flags.assign(block.faces.size(), 0);
    if (plan_.info.colour) {
      block.rgba.assign(block.key.size() - all.rgba.size(), 0);
      block.rgba.insert(block.rgba.end(), all.rgba.begin(), all.rgba.end());
    }
    restore_originals(all, block);
    canonicalise(block);
    MeshFileWriter writer(context.create(kZippedFile), plan_.info);
    if (!block.faces.empty()) {
      std::vector<std::uint64_t> brick;
      brick.reserve(block.faces.size());
      for (const auto& f : block.faces)
        brick.push_back(
            brick_of_face(plan_.lattice, block.position[f[0]], block.position[f[1]], block.position[f[2]]));
      split_faces(block, brick, [&](std::uint64_t key, MeshBlock&& patch) {
        writer.add(merged_brick(kStripRank, key), patch);
      });
    }
    return writer.finish();
  }

  /// Vertices of originals exactly as they are: sums with the origin may round.
  void restore_originals(const Pieces& all, MeshBlock& block) const {
    const auto end = std::lower_bound(all.key.begin(), all.key.end(), merged_vertex(kStripRank, 0));
    for (std::size_t p = 0; p < near_cut_.patches().size(); ++p) {
      const MeshBlock near_cut = near_cut_.load({&p, 1});
      for (std::size_t v = 0; v < near_cut.key.size(); ++v) {
        const auto at = static_cast<std::size_t>(std::lower_bound(all.key.begin(), end, near_cut.key[v]) -
                                                 all.key.begin());
        block.position[at] = near_cut.position[v];
        block.vertex_class[at] = near_cut.vertex_class[v];
        if (!near_cut.rgba.empty()) block.rgba[at] = near_cut.rgba[v];
      }
    }
  }

  /// Patches of originals without the faces that were taken away; edges that a stitch closed are no borders any more.
  std::uint64_t write_cut(const Pieces& all, const Zipped& zipped, TaskContext& context) const {
    MeshFileWriter writer(context.create(kCutFile), plan_.info);
    const std::vector<KeyEdge> closed = closed_borders(all, zipped);
    for (std::size_t p = 0; p < near_cut_.patches().size(); ++p) {
      context.check_stop();
      const std::size_t first = all.first_face[p], end = all.first_face[p + 1];
      std::vector<std::array<std::uint64_t, 3>> gone;
      bool touched = false;
      for (std::size_t f = first; f < end; ++f) {
        if (zipped.removed[f]) gone.push_back(corners(all.pieces.faces[f], all.key));
        for (std::size_t k = 0; k < 3; ++k)
          touched = touched || is_in(closed, edge(all.pieces.faces[f], k, all.key));
      }
      if (gone.empty() && !touched) continue;
      std::sort(gone.begin(), gone.end());
      const std::uint64_t brick = near_cut_.patches()[p].key;
      const std::int64_t found = kept_.find(brick);
      if (found < 0) throw std::logic_error("merge: faces near the cut have no patch");
      const auto patch = static_cast<std::size_t>(found);
      const MeshBlock block = kept_.load({&patch, 1});
      std::vector<std::uint8_t> keep(block.faces.size());
      for (std::size_t f = 0; f < keep.size(); ++f)
        keep[f] = !std::binary_search(gone.begin(), gone.end(), corners(block.faces[f], block.key));
      MeshBlock rest = select_faces(block, keep);
      for (std::size_t f = 0; f < rest.faces.size(); ++f)
        for (std::size_t k = 0; k < 3; ++k)
          if (is_in(closed, edge(rest.faces[f], k, rest.key)))
            rest.face_flags[f] = static_cast<std::uint8_t>(rest.face_flags[f] & ~(kFaceBorder01 << k));
      if (rest.faces.empty())
        writer.remove(brick);
      else
        writer.add(brick, rest);
    }
    return writer.finish();
  }

  using KeyEdge = std::array<std::uint64_t, 2>;  ///< from, to: of a face that lies on its left
  static KeyEdge edge(const std::array<std::uint32_t, 3>& f, std::size_t k,
                      const std::vector<std::uint64_t>& key) {
    return {key[f[k]], key[f[(k + 1) % 3]]};
  }
  static bool is_in(const std::vector<KeyEdge>& sorted, const KeyEdge& e) {
    return std::binary_search(sorted.begin(), sorted.end(), e);
  }

  /// Borders of originals that filled loops have closed, ascending. A writer takes a flagged edge for the end of the surface.
  static std::vector<KeyEdge> closed_borders(const Pieces& all, const Zipped& zipped) {
    std::vector<KeyEdge> borders, closed;
    for (std::size_t f = 0; f < all.original_faces; ++f)
      for (std::size_t k = 0; k < 3; ++k)
        if (!zipped.removed[f] && (all.pieces.edges[f] & (ZipPieces::kEnds << k)) != 0)
          borders.push_back(edge(all.pieces.faces[f], k, all.key));
    std::sort(borders.begin(), borders.end());
    for (const auto& f : zipped.added)
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [from, to] = edge(f, k, all.key);
        if (is_in(borders, {to, from})) closed.push_back({to, from});
      }
    std::sort(closed.begin(), closed.end());
    return closed;
  }

  /// The smallest first, in the direction of the face: its reverse, where a mesh has both, is another one.
  static std::array<std::uint64_t, 3> corners(const std::array<std::uint32_t, 3>& f,
                                              const std::vector<std::uint64_t>& key) {
    std::array<std::uint64_t, 3> c = {key[f[0]], key[f[1]], key[f[2]]};
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
    return c;
  }
  static constexpr int kSlotBits = 22;  ///< of mesh_key(): bricks lie above them

  MergePlan plan_;
  MeshStore kept_, near_cut_, strip_;
};

}  // namespace

std::uint64_t merge_zip_bytes(const MeshSize& strip, std::uint64_t patch_bytes) {
  const std::uint64_t pieces = strip.vertices * (24 + 8 + 24 + 16) + strip.faces * 40;
  return pieces + zip_bytes(strip.vertices, strip.faces) +
         MeshStore::block_bytes(strip.vertices, 2 * strip.faces) + 2 * patch_bytes +
         2 * DirectFile::kDefaultBuffer + (std::uint64_t{4} << 20);
}

std::unique_ptr<Stage> make_merge_zip_stage(const JobState& state) {
  return std::make_unique<ZipStage>(state);
}

}  // namespace tessera
