/// Stage "surface" of solids.
#include <algorithm>
#include <optional>

#include "kernels/mesh/patch_components.h"
#include "kernels/solid/mesh_creases.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/patch_store.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/solid/solid_stages.h"
#include "stream/stages/solid/solid_tiles.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSurfaceTaskBytes = std::uint64_t{12} << 20;  ///< write buffers
/// Faces of a mesh for each place where it passes a lattice edge, up to which its creases are followed: finer ones are noise to
/// the lattice as often as not, and would take more memory than all else.
constexpr std::uint64_t kCreaseFaces = 4;
/// Faces of a mesh as fine as the lattice in a leaf at its surface.
constexpr std::uint64_t kLeafFaces = 128;

class SolidSurfaceStage : public Stage {
 public:
  SolidSurfaceStage(const JobState& state, SolidModel model)
      : model_(std::move(model)),
        plan_(Plan::of_work(state.work)),
        solids_(load(state.work)),
        shapes_(make_shapes(state)),
        tiling_(tables(), plan_.brick_min, plan_.brick_max, is_open(),
                [this](const SolidBlock& block) { return crease_bytes(block); }) {
    for (std::size_t o = 0; o < model_.meshes.size(); ++o)
      for (const std::size_t input : model_.meshes[o].inputs) {
        stores_.push_back({open_imported_mesh(state.work, solid_import(input)), o});
        patch_bytes_ = std::max(patch_bytes_, stores_.back().mesh.largest_patch_bytes() * 5 / 4);
      }
    choose_creased();
    for (const MeshSolid& s : solids_) operands_.push_back(&s);
    for (const Shape& s : shapes_) operands_.push_back(s.solid.get());
    const int edge = state.run.tile_cells > 0 ? std::max(1, state.run.tile_cells / kBrickCells) : 4;
    groups_ =
        tiling_.groups(edge, state.run.memory_bytes / 2 / static_cast<std::uint64_t>(state.run.threads));
  }

  std::string name() const override { return "surface"; }
  std::size_t task_count() const override { return groups_.size(); }
  std::uint64_t units() const override {
    std::uint64_t sum = 0;
    for (const TileGroup& group : groups_) sum += group.size();
    return sum;
  }
  std::string unit_name() const override { return "tiles"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (const Tile& tile : groups_[task]) maximum = std::max(maximum, tiling_.tile_bytes(tile));
    return maximum + patch_bytes_ + shared_bytes_ + kSurfaceTaskBytes;  // as solid_surface_bytes()
  }

  Json run(std::size_t task, TaskContext& context) const override {
    // Either the result, or what distances are measured to.
    std::optional<PatchFileWriter> result;
    std::optional<SolidMeshWriter> between;
    if (model_.is_measured()) {
      between.emplace(plan_.lattice, task, context);
    } else {
      result.emplace(context.create("mesh/" + task_file_stem(task) + ".tsm"));
    }
    ExtractOptions options = model_.extract;
    options.names = model_.is_measured();
    options.in_faces = true;
    options.bends = !options.names;
    std::uint64_t patches = 0, vertices = 0, faces = 0, synthetic = 0;
    ExtractReport total;
    SolidFieldReport roots;
    for (const Tile& tile : groups_[task]) {
      context.check_stop();
      const SolidBlock block = solid_block(tile);
      MeshCreases creases(block, options.feature_angle_deg);
      std::vector<SolidCrossing> crossings = find(block, creases, context);
      std::vector<Int3> closing;
      close(block, crossings, closing);
      if (!crossings.empty() || !closing.empty()) {
        const DirectedField field = build_solid_field(block, std::move(crossings), operands_, model_.tree,
                                                      closing, roots, [&context] { context.check_stop(); });
        if (between) between->add(field);
        const CreaseLines lines = creases.lines();
        const auto add_patch = [&](Patch&& patch) {
          ++patches;
          vertices += patch.position.size();
          faces += patch.faces.size();
          for (const std::uint8_t flag : patch.synthetic) synthetic += flag;
          if (between) between->add(patch);
          if (result) result->add(patch, find_components(patch));
        };
        const ExtractReport report =
            extract_surface(field, options, add_patch, lines.pieces.empty() ? nullptr : &lines);
        total.loops += report.loops;
        total.crease_samples += report.crease_samples;
        total.corner_samples += report.corner_samples;
        total.flips += report.flips;
        total.bend_samples += report.bend_samples;
        total.crease_loops += report.crease_loops;
        total.unfollowed_loops += report.unfollowed_loops;
        total.rejected_samples += report.rejected_samples;
      }
      context.advance(1);
    }
    context.count_written(between ? between->finish() : result->finish());
    return {{"patches", patches},
            {"vertices", vertices},
            {"faces", faces},
            {"synthetic_faces", synthetic},
            {"loops", total.loops},
            {"crease_samples", total.crease_samples},
            {"corner_samples", total.corner_samples},
            {"flips", total.flips},
            {"bend_samples", total.bend_samples},
            {"crease_loops", total.crease_loops},
            {"unfollowed_loops", total.unfollowed_loops},
            {"rejected_samples", total.rejected_samples},
            {"roots", roots.roots},
            {"membrane_roots", roots.membrane_roots},
            {"missing_nodes", roots.missing_nodes},
            {"shallow_roots", roots.shallow_roots},
            {"sign_leaves", between ? between->leaves() : 0}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    // Roots in halos count more than once, and other tiles would count otherwise.
    Json sum = sum_counts(summaries, {{"tiles", units()}, {"h", plan_.lattice.h}});
    const auto roots = sum.value("roots", std::uint64_t{0}),
               membrane = sum.value("membrane_roots", std::uint64_t{0});
    const auto shallow = sum.value("shallow_roots", std::uint64_t{0});
    if (roots == 0)
      throw EmptyError(
          "nothing is inside: no node of the lattice has a winding number above 1/2; try a smaller "
          "--resolution, or "
          "close the mesh first");
    if (shallow * 2 > roots - membrane && shallow > 0) refuse_open_sheet();
    return sum;
  }

  std::vector<std::string> obsolete() const override {
    std::vector<std::string> names = {"lines/"};
    for (std::size_t i = 0; i < model_.inputs(); ++i) names.push_back(solid_import(i) + "/");
    return names;
  }

 private:
  struct Source {
    MeshStore mesh;
    std::size_t operand;
  };

  std::vector<MeshSolid> load(const std::filesystem::path& work) {
    std::vector<MeshSolid> solids;
    const std::vector<SolidLines> lines = load_solid_lines(work);
    for (std::size_t o = 0; o < model_.meshes.size(); ++o) {
      solids.push_back(load_mesh_solid(work, o, lines.at(o)));
      shared_bytes_ += lines[o].bytes();
      inside_out_.push_back(lines[o].inside_out);
    }
    return solids;
  }

  struct Shape {
    std::unique_ptr<SolidShape> form;
    std::unique_ptr<ShapeSolid> solid;
    LineWindings leaves;  ///< at its surface
  };

  std::vector<Shape> make_shapes(const JobState& state) {
    std::vector<Shape> shapes;
    for (const PlacedShape& s : model_.shapes) {
      Shape& made = shapes.emplace_back();
      made.form = make_placed_shape(state, s);
      shared_bytes_ += placed_shape_bytes(state, s);
      made.solid = std::make_unique<ShapeSolid>(*made.form, plan_.lattice);
      made.leaves = LineWindings(shape_leaves(*made.form, plan_.lattice, plan_.brick_min, plan_.brick_max));
      shared_bytes_ += made.leaves.bytes();
    }
    return shapes;
  }
  std::vector<const LineWindings*> tables() const {
    std::vector<const LineWindings*> out;
    for (const MeshSolid& s : solids_) out.push_back(&s.lines());
    for (const Shape& s : shapes_) out.push_back(&s.leaves);
    return out;
  }
  bool is_open() const {
    return std::any_of(solids_.begin(), solids_.end(),
                       [](const MeshSolid& s) { return !s.border().empty(); });
  }

  /// Crossings of all surfaces with the lines of the block, and the faces whose creases are to be followed.
  std::vector<SolidCrossing> find(const SolidBlock& block, MeshCreases& creases, TaskContext& context) const {
    std::vector<SolidCrossing> crossings;
    crossings.reserve(tiling_.load(block).crossings);
    const NodeBox nodes = block.nodes();
    for (std::size_t s = 0; s < shapes_.size(); ++s)
      tiling_.for_each_leaf(block, *tables()[solids_.size() + s], [&](const LeafWindings& leaf) {
        shapes_[s].solid->find_crossings(block, leaf_of_row_key(leaf.key),
                                         static_cast<std::uint8_t>(solids_.size() + s), crossings);
      });
    const MeshBox box = world_box(block);
    std::vector<LatticeCrossing> found;
    std::vector<Float3> normals;
    for (const Source& source : stores_) {
      const Placement& placement = model_.meshes[source.operand].placement;
      for (const std::size_t p : source.mesh.select(placed_box(placement.inverse(), box))) {
        context.check_stop();
        MeshBlock mesh = source.mesh.load({&p, 1});
        transform_block(placement, mesh);
        const std::vector<Long3> corner = quantise_block(plan_.lattice, mesh);
        const bool creased = creased_[source.operand] != 0;
        normals.clear();
        for (const auto& f : mesh.faces) {
          const QuantisedTriangle triangle = {corner[f[0]], corner[f[1]], corner[f[2]]};
          found.clear();
          find_crossings(triangle, nodes, 7, found);
          if (found.empty() && !creased) continue;
          const Float3 normal = face_normal(mesh, f, triangle);  // turned outward with its root
          if (creased) normals.push_back(normal);
          for (LatticeCrossing& c : found) {
            if (inside_out_[source.operand] != 0) c.winding = static_cast<std::int8_t>(-c.winding);
            crossings.push_back(block.local_crossing(c, normal, static_cast<std::uint8_t>(source.operand)));
          }
        }
        if (creased) creases.add(static_cast<std::uint8_t>(source.operand), corner, mesh.faces, normals);
      }
    }
    return crossings;
  }

  MeshBox world_box(const SolidBlock& block) const {
    const NodeBox nodes = block.nodes();
    MeshBox box;
    for (std::size_t a = 0; a < 3; ++a) {
      box.low[a] = plan_.lattice.world(static_cast<int>(a), nodes.low[a] - 1);
      box.high[a] = plan_.lattice.world(static_cast<int>(a), nodes.high[a] + 1);
    }
    return box;
  }

  /// Meshes whose creases are followed: closed ones that stand alone, for those of two at one place could be followed from one
  /// brick and not from the next; none where the result has names or no features.
  void choose_creased() {
    creased_.assign(solids_.size(), 0);
    if (model_.is_measured() || solids_.size() + model_.shapes.size() > 1 ||
        model_.extract.method != ExtractMethod::kExtendedMarchingCubes)
      return;
    for (std::size_t o = 0; o < solids_.size(); ++o) {
      std::uint64_t faces = 0, crossings = 0;
      for (const Source& source : stores_) faces += source.operand == o ? source.mesh.face_count() : 0;
      for (const LeafWindings& leaf : solids_[o].lines().leaves()) crossings += leaf.crossings;
      creased_[o] = solids_[o].border().empty() && faces <= kCreaseFaces * crossings ? 1 : 0;
    }
  }
  std::uint64_t crease_bytes(const SolidBlock& block) const {
    std::uint64_t faces = 0;
    const MeshBox box = world_box(block);
    for (const Source& source : stores_) {
      if (!creased_[source.operand]) continue;
      for (const std::size_t p :
           source.mesh.select(placed_box(model_.meshes[source.operand].placement.inverse(), box)))
        faces += source.mesh.patches()[p].faces;
    }
    return MeshCreases::bytes(faces);
  }

  /// Of the face as the file has it; of its quantised one where that has none.
  static Float3 face_normal(const MeshBlock& mesh, const std::array<std::uint32_t, 3>& f,
                            const QuantisedTriangle& triangle) {
    const Double3 exact =
        unit_or_zero(triangle_normal(mesh.position[f[0]], mesh.position[f[1]], mesh.position[f[2]]));
    if (exact != Double3{0, 0, 0}) return narrow(exact);
    std::array<Double3, 3> p;
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t a = 0; a < 3; ++a) p[c][a] = static_cast<double>(triangle[c][a] - triangle[0][a]);
    return narrow(unit_or_zero(triangle_normal(p[0], p[1], p[2])));
  }

  /// Leaves that only closing membranes pass.
  void close(const SolidBlock& block, const std::vector<SolidCrossing>& crossings,
             std::vector<Int3>& closing) const {
    std::vector<std::uint8_t> occupied;
    for (std::size_t o = 0; o < solids_.size(); ++o) {
      if (solids_[o].border().empty()) continue;
      occupied.assign(block.slots(), 0);
      for (const SolidCrossing& c : crossings)
        if (c.operand == o) occupied[c.edge / (3 * 512)] = 1;
      solids_[o].membrane_leaves(block, occupied, closing);
    }
  }

  SolidModel model_;
  Plan plan_;
  std::uint64_t shared_bytes_ = 0, patch_bytes_ = 0;
  std::vector<std::uint8_t> inside_out_;  ///< per mesh operand
  std::vector<std::uint8_t> creased_;     ///< per mesh operand: its creases are followed
  std::vector<MeshSolid> solids_;
  std::vector<Shape> shapes_;
  SolidTiling tiling_;
  std::vector<Source> stores_;
  std::vector<const SolidOperand*> operands_;
  std::vector<TileGroup> groups_;
};

}  // namespace

std::uint64_t solid_surface_bytes(const JobState& state, const SolidModel& model, std::uint64_t leaves,
                                  std::uint64_t patch_bytes) {
  std::uint64_t bytes = SolidTiling::brick_bytes(leaves, model.meshes.size() + model.shapes.size()) +
                        patch_bytes * 5 / 4 + kSurfaceTaskBytes;
  if (!model.is_measured()) bytes += MeshCreases::bytes(leaves * kLeafFaces);
  for (const PlacedShape& s : model.shapes) bytes += placed_shape_bytes(state, s);
  return bytes;
}

std::unique_ptr<Stage> make_solid_surface_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<SolidSurfaceStage>(state, model);
}

}  // namespace tessera
