#include "stream/stages/deform/deform_needs.h"

#include <algorithm>
#include <set>
#include <string>

#include "kernels/edit/refined_base.h"
#include "kernels/edit/self_intersections.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/remesh/remesh.h"
#include "kernels/smooth/smooth.h"
#include "stream/files/json.h"
#include "stream/import/import_needs.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/pose_base.h"
#include "stream/stages/deform/vertex_batches.h"
#include "stream/stages/plan/planned_patches.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSlackBytes = std::uint64_t{8} << 20, kWriteSlackBytes = std::uint64_t{32} << 20;
/// Bytes a vertex of the base, at the most, while the system of order 1, 2, 3 is solved for, without its factor and columns. With
/// seven columns, on sheets and tori of 39,000 to 420,000 vertices that are support throughout: 1,091 to 1,199 bytes of
/// order 1, 1,269 to 1,377 of order 2, 1,571 to 2,549 of order 3, 2,140 to 3,990 where smoothness differs.
constexpr std::uint64_t kSolvingBytes[] = {830, 1030, 2280}, kUnevenSolvingBytes = 3880;
/// Of these, the ordering and fronts: 118 to 170, 382 to 563, 652 to 1,536 and 1,361 to 2,658.
constexpr std::uint64_t kFrontsBytes[] = {300, 750, 2000}, kUnevenFrontsBytes = 3400;
/// Of factors: how much may lie in memory. 444 to 495, 1,285 to 1,608, 2,475 to 3,584, twice as much where smoothness differs.
constexpr std::uint64_t kFactorBytes[] = {600, 1800, 4000}, kUnevenFactorBytes = 8000;
/// Of a block of a mesh, without colours.
constexpr std::uint64_t kBlockVertexBytes = 33, kBlockFaceBytes = 13;
/// The process beside it, behind passes over many million faces: what of the factor it leaves no room for lies on disk.
constexpr std::uint64_t kProcessBytes = std::uint64_t{64} << 20;
constexpr std::uint64_t kSystemSlackBytes = std::uint64_t{16} << 20;  ///< small ones vary more
constexpr std::uint64_t kColumnBytes = 60, kVertexBytes = 850;
/// Of a vertex of the base while others stream past it: positions, normals and faces at rest and posed, its role.
constexpr std::uint64_t kHeldBytes = 200;
/// Of what is kept: a vertex of the base without its columns, and with copies of it; a column with its gradients.
constexpr std::uint64_t kKeptBytes = 80, kLevelBytes = 80, kKeptColumnBytes = 20;
/// Of the vertices asked for: how many a base has at the most.
constexpr double kMax = 1.3;
/// Of a mesh that is its own base, with what is split of it: seconds are not worth more.
constexpr std::uint64_t kMostSplit = 60000;

/// Of the solution: as EditBasis::width().
std::uint64_t columns(const EditScript& script) {
  std::set<std::string> handles;
  bool targets = false;
  for (const EditRegion& r : script.regions) {
    if (r.role == RegionRole::kHandle && r.targets.empty()) handles.insert(r.name);
    targets = targets || !r.targets.empty();
  }
  return (targets ? 6 : 3) + 4 * handles.size();
}

/// Smoothness that differs may leave a system that is not symmetric, whose factors are larger.
bool is_uneven(const EditScript& script) {
  return script.order == 3 && std::any_of(script.regions.begin(), script.regions.end(),
                                          [](const EditRegion& r) { return r.smoothness >= 0.0; });
}

/// Of the basis while it is solved for, without the factor.
std::uint64_t solving_bytes(std::uint64_t vertices, const EditScript& script) {
  return vertices * ((is_uneven(script) ? kUnevenSolvingBytes : kSolvingBytes[script.order - 1]) +
                     columns(script) * kColumnBytes) +
         kSystemSlackBytes;
}

}  // namespace

std::uint64_t base_capacity(std::uint64_t faces, std::uint64_t base_vertices) {
  return std::max(faces + faces / 2, 3 * base_vertices);
}

std::uint64_t most_split(std::uint64_t base_vertices) {
  return std::min(base_vertices, kMostSplit);
}

bool may_split(const DeformOptions& options) {
  return options.base == "auto" || options.base == "split";
}

std::uint64_t split_base_bytes(const DeformOptions& options) {
  const std::uint64_t most = most_split(options.base_vertices);
  return may_split(options) ? refined_base_bytes(most, 2 * most) : 0;
}

std::uint64_t base_stage_bytes(bool own, const BaseInput& input, std::uint64_t base_vertices) {
  if (own) return 2 * input.loading_bytes + kSlackBytes;
  const std::uint64_t most_faces = base_capacity(input.faces, base_vertices);
  // What came in, twice only where it is small; then what came out, its vectors grown by doubling, and a copy of it.
  const std::uint64_t held = kBlockVertexBytes * input.vertices + kBlockFaceBytes * input.faces;
  const std::uint64_t out = kBlockVertexBytes * most_faces / 2 + kBlockFaceBytes * most_faces;
  const std::uint64_t given = input.vertices <= base_vertices ? 2 * held : held;
  return std::max({input.loading_bytes, given + remesh_bytes(most_faces, input.faces, false),
                   given + 3 * out + smooth_bytes(most_faces / 2, most_faces, base_low_pass().front())}) +
         kSlackBytes;
}

BaseInput base_input(std::uint64_t faces) {
  return {faces, faces, MeshStore::block_bytes(faces + faces / 4, faces)};
}

std::uint64_t fronts_bytes(std::uint64_t vertices, const EditScript& script) {
  return vertices * (is_uneven(script) ? kUnevenFrontsBytes : kFrontsBytes[script.order - 1]) +
         kSystemSlackBytes;
}

std::uint64_t held_factor_bytes(std::uint64_t vertices, const EditScript& script, const RunOptions& run) {
  const std::uint64_t factor = vertices *
                               (is_uneven(script) ? kUnevenFactorBytes : kFactorBytes[script.order - 1]),
                      left = std::max(run.memory_bytes * 3 / 16, kProcessBytes),
                      room = run.memory_bytes > left ? run.memory_bytes - left : 0,
                      need = solving_bytes(vertices, script) + kSlackBytes;
  return std::min(factor, room > need ? room - need : 0);
}

std::uint64_t basis_stage_bytes(std::uint64_t vertices, const EditScript& script, const RunOptions& run) {
  const std::uint64_t solved = solving_bytes(vertices, script) + held_factor_bytes(vertices, script, run);
  const bool paints = std::any_of(script.regions.begin(), script.regions.end(),
                                  [](const EditRegion& r) { return r.shape == RegionShape::kPainted; });
  const std::uint64_t painted =
      paints ? vertices * (kVertexBytes + 2 * ClosestFaces::bytes_per_face()) +
                   vertex_window(run) * kDisplacedVertices * DisplacedBatch::kVertexBytes
             : 0;
  // Copies for volumes are made when the factor is gone.
  const std::uint64_t copied =
      script.volumes
          ? vertices * (kVertexBytes + columns(script) * kKeptColumnBytes) + layer_levels_bytes(2 * vertices)
          : 0;
  const std::uint64_t crossed =
      vertices * (kVertexBytes + columns(script) * kKeptColumnBytes) + self_intersections_bytes(2 * vertices);
  return std::max({solved, copied, painted, crossed}) + kSlackBytes;
}

WriteStageSize basis_size(const BasisReader& basis, bool poses) {
  const Json about = parse_json(basis.about());
  const auto& solved = about.at("basis");
  return {basis.bytes(), solved.at("base_vertices").get<std::uint64_t>(),
          solved.at("base_faces").get<std::uint64_t>(), poses, about.at("volumes").get<bool>()};
}

std::uint64_t write_stage_bytes(const WriteStageSize& size, const RunOptions& run) {
  // The base is posed beside its basis; then vertices stream past the base alone; in the end crossings are looked for.
  const std::uint64_t posing =
      size.basis_bytes + std::max(size.basis_bytes,  // while it is read
                                  size.poses ? pose_base_bytes(size.vertices, size.faces, size.volumes) : 0);
  const std::uint64_t writing = kHeldBytes * size.vertices + DisplacementEncoder::bytes(size.faces) +
                                sort_bytes(run) +
                                vertex_window(run) * kDisplacedVertices * DisplacedBatch::kVertexBytes;
  return std::max(posing + kSlackBytes, writing + kWriteSlackBytes);
}

std::vector<StageNeed> deform_needs(const JobState& state, const DeformOptions& options) {
  if (options.mode == "apply") {
    const BasisReader basis(state.inputs.at(0));
    return {{"write", write_stage_bytes(basis_size(basis, true), state.run), 0}};
  }
  const EditScript script = parse_edit(options.edit, "the edit");
  const MeshSize mesh = claimed_mesh_size(state.inputs.at(0));
  std::vector<StageNeed> needs = import_needs(state.run, {0, kDeformImport}, mesh);
  // A surface has about half as many vertices as faces; files without shared vertices claim more.
  const std::uint64_t minimum = std::min(mesh.vertices, mesh.faces / 4);
  // A small mesh of thin triangles gets an even base, too; nobody knows before its faces are read, and few are like that.
  const bool may_be_own = options.base != "even" && minimum <= options.base_vertices,
             may_be_made = options.base == "even" || mesh.vertices > options.base_vertices;
  struct Case {
    bool own;
    std::uint64_t faces, vertices;
  };
  std::vector<Case> cases;
  if (may_be_own)
    cases.push_back({true, std::min(mesh.faces, 4 * options.base_vertices),
                     std::min(mesh.vertices, options.base_vertices)});
  // Split where its edges are long beside the support: nobody knows before its regions are found.
  if (may_split(options) && may_be_own && cases.front().vertices < most_split(options.base_vertices))
    cases.push_back({true, cases.front().faces, most_split(options.base_vertices)});
  if (may_be_made) {
    SimplifyOptions reduce;
    reduce.target_faces = kDecimatedFaces * options.base_vertices;
    if (!may_be_own)
      for (const StageNeed& need : simplify_needs(state.run, reduce, mesh.faces))
        if (need.stage != "certify" && need.stage != "write") needs.push_back(need);
    cases.push_back({false, std::min(mesh.faces, reduce.target_faces),
                     static_cast<std::uint64_t>(kMax * static_cast<double>(options.base_vertices))});
  }
  const StageNeed shape{
      "shape", 0, may_be_own ? surface_block_bytes(std::min(mesh.faces, 4 * options.base_vertices)) : 0};
  StageNeed base{"base"}, basis{"basis"}, write{"write"};
  // Sure is what the smaller case takes at most: minutes of passes come before these stages, and none may end there.
  const auto widen = [](StageNeed& need, bool first, std::uint64_t maximum) {
    need.sure = first ? maximum : std::min(need.sure, maximum);
    need.likely = std::max(need.likely, maximum);
  };
  for (const Case& c : cases) {
    const bool first = &c == cases.data();
    widen(base, first,
          base_stage_bytes(c.own, base_input(c.faces), options.base_vertices) +
              (c.own ? split_base_bytes(options) : 0));
    widen(basis, first, basis_stage_bytes(c.vertices, script, state.run));
    const std::uint64_t kept =
        kKeptBytes + (script.volumes ? kLevelBytes : 0) + kKeptColumnBytes * columns(script);
    widen(write, first,
          write_stage_bytes(
              {c.vertices * kept, c.vertices, 2 * c.vertices, options.mode != "prepare", script.volumes},
              state.run));
  }
  needs.insert(needs.end(), {shape, base, basis, write});
  return needs;
}

}  // namespace tessera
