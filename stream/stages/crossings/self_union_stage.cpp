#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "kernels/boolean/self_union.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/runtime/long_call.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/crossings/crossing_pairs.h"
#include "stream/stages/crossings/crossing_parts.h"

namespace tessera {
namespace {

/// What the kernel works on and what it found: a call that was left behind holds on to nothing else.
struct UnionWork {
  SolidMesh mesh;
  PositionStep step = PositionStep::kDouble;
  SelfUnion found;
};

/// Vertices by name, faces patch by patch.
struct NamedMesh {
  std::vector<std::uint64_t> key;         ///< ascending
  std::vector<std::uint32_t> first_face;  ///< by patch, one more at the end
  std::vector<std::uint8_t> border;       ///< of every face: kFaceBorder01, ...
};

constexpr std::uint8_t kBorderBits = kFaceBorder01 | kFaceBorder12 | kFaceBorder20;

/// Of every face that stays, the bits of the edges at which the surface no longer ends. The import cuts the faces around an edge of more
/// than two faces from each other, which uniting joins again: the face across has other corners then. A mark that stayed would hide from
/// a block that the face across lies in another one.
std::vector<std::uint8_t> closed_borders(const UnionWork& work, const NamedMesh& names) {
  struct Border {
    std::array<std::uint32_t, 2> edge;  ///< as the face across would have it
    std::uint32_t face;
    std::uint8_t bit;
  };
  std::vector<Border> borders;
  for (std::uint32_t f = 0; f < names.border.size(); ++f)
    for (std::size_t k = 0; k < 3 && !work.found.gone[f]; ++k)
      if (const auto bit = static_cast<std::uint8_t>(kFaceBorder01 << k); (names.border[f] & bit) != 0)
        borders.push_back({{work.mesh.faces[f][(k + 1) % 3], work.mesh.faces[f][k]}, f, bit});
  const auto less = [](const Border& a, const Border& b) { return a.edge < b.edge; };
  std::sort(borders.begin(), borders.end(), less);
  std::vector<std::uint8_t> closed(names.border.size(), 0);
  for (const SelfUnion::Face& made : work.found.made)
    for (std::size_t k = 0; k < 3; ++k) {
      const Border like = {{made.corner[k], made.corner[(k + 1) % 3]}, 0, 0};
      const auto [first, last] = std::equal_range(borders.begin(), borders.end(), like, less);
      for (auto b = first; b != last; ++b)
        closed[b->face] = static_cast<std::uint8_t>(closed[b->face] | b->bit);
    }
  return closed;
}

std::uint64_t self_union_stage_bytes(std::uint64_t faces, std::uint64_t pairs,
                                     std::uint64_t largest_patch_bytes) {
  return self_union_bytes(faces, pairs) + faces * 90 + 4 * largest_patch_bytes;
}

class SelfUnionStage : public SerialStage {
 public:
  SelfUnionStage(const JobState& state, const CrossingPlan& plan)
      : name_(self_union_name(plan)), generation_(plan.generation) {
    const std::filesystem::path left = state.work / crossing_mend_name(plan) / kLeftPairsFile;
    if (std::filesystem::exists(left))
      for_each_page<LeftPairs>(left, 1, [&](std::span<const LeftPairs> page) { left_ = page[0]; });
    if (left_.pairs == 0) return;
    mesh_.emplace(open_before_union(state, plan));
  }

  std::string name() const override { return name_; }
  std::uint64_t units() const override { return mesh_ ? mesh_->face_count() : 0; }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override {
    if (!mesh_ || why_not()) return std::uint64_t{1} << 20;
    return bytes();
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    if (!mesh_) return Json::object();
    if (const auto why = why_not()) refuse(*why);
    const auto work = std::make_shared<UnionWork>();
    work->step = mesh_->info().double_positions ? PositionStep::kDouble : PositionStep::kFloat;
    const NamedMesh names = gather(work->mesh, context);
    long_call([work] { work->found = unite_self(work->mesh, work->step); });
    context.check_stop();
    if (work->found.fault) refuse(*work->found.fault);
    write(*work, names, context);
    const SelfUnionStats& s = work->found.stats;
    return {{"pairs", s.pairs},
            {"coplanar_pairs", s.coplanar_pairs},
            {"cut_faces", s.cut_faces},
            {"inner_faces", s.inner_faces},
            {"faces_added", work->found.made.size()},
            {"new_vertices", work->found.fresh.size()},
            {"rounding_moved", s.rounding.moved},
            {"rounding_farthest", s.rounding.farthest}};
  }

 private:
  std::uint64_t bytes() const {
    return self_union_stage_bytes(mesh_->face_count(), left_.pairs, mesh_->largest_patch_bytes());
  }
  /// What can be told before the mesh is loaded.
  std::optional<std::string> why_not() const {
    if (left_.pairs > kMaxCrossingPairs) return "they are too many";
    if (mesh_->face_count() > 0x3fffffffU) return "the mesh has more than 2^30 faces";
    return std::nullopt;
  }

  [[noreturn]] void refuse(const std::string& why) const {
    throw ValidationError(std::to_string(left_.pairs) +
                          " pairs of faces that cross, overlap or touch could not be mended, the first at " +
                          std::to_string(left_.place[0]) + " " + std::to_string(left_.place[1]) + " " +
                          std::to_string(left_.place[2]) + ": " + why +
                          "; `tessera resurface` makes the whole mesh anew without them, --crossings refuse "
                          "leaves them as they are");
  }

  NamedMesh gather(SolidMesh& mesh, TaskContext& context) const {
    NamedMesh names;
    std::vector<std::pair<std::uint64_t, Double3>> vertices;
    const std::size_t patches = mesh_->patches().size();
    for (std::size_t p = 0; p < patches; ++p) {
      context.check_stop();
      const MeshBlock patch = mesh_->load({&p, 1});
      for (std::size_t v = 0; v < patch.key.size(); ++v)
        vertices.emplace_back(patch.key[v], patch.position[v]);
    }
    const auto less = [](const auto& a, const auto& b) { return a.first < b.first; };
    std::sort(vertices.begin(), vertices.end(), less);
    vertices.erase(std::unique(vertices.begin(), vertices.end(),
                               [](const auto& a, const auto& b) { return a.first == b.first; }),
                   vertices.end());
    for (const auto& [key, position] : vertices) {
      names.key.push_back(key);
      mesh.points.push_back(position);
    }
    std::vector<std::pair<std::uint64_t, Double3>>().swap(vertices);
    for (std::size_t p = 0; p < patches; ++p) {
      context.check_stop();
      const MeshBlock patch = mesh_->load({&p, 1});
      std::vector<std::uint32_t> number;
      for (const std::uint64_t key : patch.key)
        number.push_back(static_cast<std::uint32_t>(
            std::lower_bound(names.key.begin(), names.key.end(), key) - names.key.begin()));
      names.first_face.push_back(static_cast<std::uint32_t>(mesh.faces.size()));
      for (const auto& f : patch.faces) mesh.faces.push_back({number[f[0]], number[f[1]], number[f[2]]});
      for (const std::uint8_t flags : patch.face_flags) names.border.push_back(flags & kBorderBits);
      context.advance(patch.faces.size());
    }
    names.first_face.push_back(static_cast<std::uint32_t>(mesh.faces.size()));
    return names;
  }

  /// The patches in which faces changed: pieces lie in the patch of the face that they were cut from.
  void write(const UnionWork& work, const NamedMesh& names, TaskContext& context) const {
    std::vector<SelfUnion::Face> made = work.found.made;
    std::sort(made.begin(), made.end(), [](const SelfUnion::Face& a, const SelfUnion::Face& b) {
      return a.of != b.of ? a.of < b.of : a.corner < b.corner;
    });
    const std::vector<std::uint8_t> closed = closed_borders(work, names);
    const auto none = [](auto from, auto to) {
      return std::all_of(from, to, [](std::uint8_t bits) { return bits == 0; });
    };
    MeshFileWriter writer(context.create(name_ + "/united.tmm"), mesh_->info());
    auto piece = made.begin();
    for (std::size_t p = 0; p + 1 < names.first_face.size(); ++p) {
      context.check_stop();
      const std::uint32_t first = names.first_face[p], end = names.first_face[p + 1];
      const auto begin = piece;
      while (piece != made.end() && piece->of < end) ++piece;
      std::vector<std::uint8_t> keep(end - first);
      for (std::uint32_t f = first; f < end; ++f) keep[f - first] = !work.found.gone[f];
      const bool as_it_was = std::find(keep.begin(), keep.end(), 0) == keep.end() &&
                             none(closed.begin() + first, closed.begin() + end);
      if (begin == piece && as_it_was) continue;
      MeshBlock patch = mesh_->load({&p, 1});
      for (std::uint32_t f = first; f < end; ++f)
        patch.face_flags[f - first] = static_cast<std::uint8_t>(patch.face_flags[f - first] & ~closed[f]);
      std::vector<MeshBlock> blocks;
      if (MeshBlock left = select_faces(patch, keep); !left.faces.empty()) blocks.push_back(std::move(left));
      if (begin != piece) blocks.push_back(block_of({begin, piece}, work, names, patch, first));
      std::vector<const MeshBlock*> pointers;
      for (const MeshBlock& b : blocks) pointers.push_back(&b);
      if (pointers.empty())
        writer.remove(mesh_->patches()[p].key);
      else
        writer.add(mesh_->patches()[p].key, merge_blocks(pointers, {}));
    }
    context.count_written(writer.finish());
  }

  /// New vertices have the colour of the corner of their face that is nearest.
  MeshBlock block_of(std::span<const SelfUnion::Face> faces, const UnionWork& work, const NamedMesh& names,
                     const MeshBlock& patch, std::uint32_t first) const {
    MeshBlock block;
    const auto given = static_cast<std::uint32_t>(names.key.size());
    std::vector<std::pair<std::uint32_t, std::uint32_t>> vertices;  // number, a face at it
    for (const SelfUnion::Face& f : faces)
      for (const std::uint32_t v : f.corner) vertices.emplace_back(v, f.of - first);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end(),
                               [](const auto& a, const auto& b) { return a.first == b.first; }),
                   vertices.end());
    for (const auto& [v, face] : vertices) {
      block.key.push_back(v < given
                              ? names.key[v]
                              : ~std::uint64_t{0} << 52 | static_cast<std::uint64_t>(generation_) << 32 |
                                    1U << 31 | (v - given));
      block.position.push_back(v < given ? work.mesh.points[v] : work.found.fresh[v - given]);
      const std::uint32_t like = nearest_corner(patch, face, block.position.back());
      const auto own = std::lower_bound(patch.key.begin(), patch.key.end(), block.key.back());
      const bool known = own != patch.key.end() && *own == block.key.back();
      const auto from = known ? static_cast<std::uint32_t>(own - patch.key.begin()) : like;
      block.vertex_class.push_back(known ? patch.vertex_class[from] : VertexClass::kSmooth);
      if (!patch.rgba.empty()) block.rgba.push_back(patch.rgba[from]);
    }
    for (const SelfUnion::Face& f : faces) {
      std::array<std::uint32_t, 3> c;
      for (std::size_t k = 0; k < 3; ++k)
        c[k] = static_cast<std::uint32_t>(
            std::lower_bound(vertices.begin(), vertices.end(), std::pair(f.corner[k], std::uint32_t{0})) -
            vertices.begin());
      block.faces.push_back(c);
      block.face_flags.push_back(patch.face_flags[f.of - first] & kFaceSynthetic);
      if (!patch.face_bound.empty()) block.face_bound.push_back(patch.face_bound[f.of - first]);
    }
    canonicalise(block);
    return block;
  }

  static std::uint32_t nearest_corner(const MeshBlock& patch, std::uint32_t face, const Double3& p) {
    const auto& c = patch.faces[face];
    return *std::min_element(c.begin(), c.end(), [&](std::uint32_t a, std::uint32_t b) {
      return norm(patch.position[a] - p) < norm(patch.position[b] - p);
    });
  }

  std::string name_;
  std::uint32_t generation_;
  LeftPairs left_;
  std::optional<MeshStore> mesh_;
};

}  // namespace

std::unique_ptr<Stage> make_self_union_stage(const JobState& state, const CrossingPlan& plan) {
  return std::make_unique<SelfUnionStage>(state, plan);
}

}  // namespace tessera
