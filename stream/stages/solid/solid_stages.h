/// \file solid_stages.h
/// Solids to surfaces, out of core: meshes and what is made of them become patches of the lattice.
///
///   lattice  boxes of all meshes and shapes -> plan.json: lattice and origin
///   lines    faces -> how they turn the lines of the lattice (line_windings.h), border edges that do not cancel
///   surface  faces near a tile -> exact crossings, signs, directed distances -> patches, one per brick
///   offset   where a model asks for it: the surface as a mesh -> distances to it -> patches of what lies between two of them
///   distances, grid  instead: distances of the nodes near the surface, or of all -> leaves -> an OpenVDB file
///   cells, octree  instead: cells that are as large as a tolerance lets them be -> a file of octrees
///
/// After them weld and write, as in a reconstruction (stages/surface).
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/mesh/patch_mesh.h"
#include "kernels/solid/mesh_solid.h"
#include "kernels/solid/offset_field.h"
#include "kernels/solid/solid_shape.h"
#include "kernels/solid/solid_tree.h"
#include "stream/meshes/mesh_store.h"
#include "stream/points/plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// One mesh of a model: inputs that are together one soup, and where it is put.
struct PlacedMesh {
  std::vector<std::size_t> inputs;
  Placement placement = {};
};
/// An implicit solid by its kind (solid_shape.h).
struct PlainShape {
  std::string kind;  ///< of kShapeKinds
  std::vector<double> numbers;
  Placement placement;
};
/// What a milling tool takes away on its way (swept_tool.h).
struct MillShape {
  std::vector<double> tool;  ///< radius, rim and length
  Placement placement;
  std::size_t path = 0;  ///< input of its tool path
};
/// Two solids with the joint rounded (blended_shape.h).
struct BlendShape {
  PlainShape first, second;
  SolidTree::Join join = SolidTree::Join::kUnite;
  double radius = 0.0;
};
using PlacedShape = std::variant<PlainShape, MillShape, BlendShape>;
/// \throws InputError naming file and line: no numbers, no point
std::unique_ptr<SolidShape> make_placed_shape(const JobState& state, const PlacedShape& shape);
/// What it takes.
std::uint64_t placed_shape_bytes(const JobState& state, const PlacedShape& shape);

/// What a job makes its surface of. Operands of the tree are the meshes, then the shapes.
struct SolidModel {
  std::vector<PlacedMesh> meshes;
  std::vector<PlacedShape> shapes;
  SolidTree tree;
  double resolution = 0.0;  ///< h, units of the meshes; 0 = a 300th of the diagonal
  ExtractOptions extract;
  double offset = 0.0;  ///< units of the meshes: the surface moves so far outwards
  double mitre = 1.0;   ///< most of a mitre, in offsets; 1 = corners come out round
  double shell = 0.0;   ///< what lies deeper than this below it is hollow; 0 = nothing
  double band =
      0.0;  ///< cells: nodes so near to the surface get a distance, and there is no other result; 0 = none

  bool full = false;  ///< all nodes of the box get one
  double tolerance =
      0.0;  ///< units of the meshes: the result is an octree instead, whose field is off by no more

  std::size_t inputs() const;
  bool is_offset() const { return offset != 0.0 || shell > 0.0; }
  bool is_measured() const { return is_offset() || band > 0.0 || full || tolerance > 0.0; }
  /// Between which distances of the surface the result lies, cells.
  OffsetLayer layer(double h) const;
};

/// Folder of an imported input: "mesh-0".
std::string solid_import(std::size_t input);

/// What the stage "lines" found of one operand.
struct SolidLines {
  std::uint64_t leaves = 0;   ///< records of LineWindings
  std::uint64_t borders = 0;  ///< edges of BorderWinding
  bool inside_out = false;

  std::uint64_t bytes() const { return leaves * sizeof(LeafWindings) + BorderWinding::bytes(borders); }
};
/// \param told  as the stage "inside" has left it; else inside_out is by volume alone
std::vector<SolidLines> load_solid_lines(const std::filesystem::path& work, bool told = true);
/// Per operand whether it is inside out.
inline constexpr const char* kInsideSummary = "inside/summary.json";
/// With its faces outwards: crossings of an operand that is inside out are to be turned too.
MeshSolid load_mesh_solid(const std::filesystem::path& work, std::size_t operand, const SolidLines& lines);

/// Of a mesh that has no inside. \throws EmptyError  always
[[noreturn]] void refuse_open_sheet();

/// The surface of the solids as a mesh, where it is no result but what distances are measured to.
MeshStore open_solid_mesh(const std::filesystem::path& work);
/// Writes one task's part of it.
class SolidMeshWriter {
 public:
  SolidMeshWriter(const Lattice& lattice, std::size_t task, TaskContext& context);
  void add(const DirectedField& field);
  void add(const Patch& patch);  ///< \pre extracted with ExtractOptions::names
  std::uint64_t finish();        ///< returns bytes written
  std::uint64_t leaves() const { return signs_.size(); }

 private:
  MeshFrame frame_;
  MeshFileWriter mesh_;
  std::filesystem::path signs_path_;
  std::vector<LeafSigns> signs_;
};
std::vector<LeafSigns> load_solid_signs(const std::filesystem::path& work);

/// Moves a block to where it is put; faces of a mirror image are turned, so that they look outwards as before.
void transform_block(const Placement& placement, MeshBlock& block);
/// The smallest box around a box that is put elsewhere.
MeshBox placed_box(const Placement& placement, const MeshBox& box);
/// A block's vertices in quanta.
std::vector<Long3> quantise_block(const Lattice& lattice, const MeshBlock& block);

/// What the stages take, told before there is a mesh (solid_needs.cpp). \param leaves  of a brick, at the surface
/// \param near_faces  of the surface around a brick   \param brick_faces  in it
std::uint64_t solid_lattice_bytes(const JobState& state, const SolidModel& model);
std::uint64_t solid_lines_task_bytes(std::uint64_t vertices, std::uint64_t faces);  ///< of a patch
std::uint64_t solid_lines_finish_bytes();
std::uint64_t solid_surface_bytes(const JobState& state, const SolidModel& model, std::uint64_t leaves,
                                  std::uint64_t patch_bytes);
std::uint64_t solid_offset_bytes(std::uint64_t near_faces);
std::uint64_t distances_bytes(std::uint64_t near_faces);
std::uint64_t far_distances_bytes(std::uint64_t brick_faces);
std::uint64_t cells_bytes(std::uint64_t brick_faces);
std::uint64_t grid_bytes();
std::uint64_t octree_bytes();

std::unique_ptr<Stage> make_solid_lattice_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_solid_lines_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_solid_inside_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_solid_surface_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_solid_offset_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_distances_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_far_distances_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_cells_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_octree_stage(const JobState& state, const SolidModel& model);
std::unique_ptr<Stage> make_grid_stage(const JobState& state, const SolidModel& model);

}  // namespace tessera
