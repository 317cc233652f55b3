/// \file extended_marching_cubes.h
/// Extraction of one block: marching cubes by closed loops, and its feature-sensitive extension.
/// Source: thesis 4.2.2; Kobbelt, Botsch, Schwanecke, Seidel, "Feature Sensitive Surface Extraction", 2001;
/// loop formulation and guards: kernels/README.md.
#pragma once
#include <functional>

#include "kernels/field/directed_field.h"
#include "kernels/mesh/patch.h"

namespace tessera {

struct CreaseLines;

enum class ExtractMethod { kMarchingCubes, kExtendedMarchingCubes };

struct ExtractOptions {
  ExtractMethod method = ExtractMethod::kExtendedMarchingCubes;
  double feature_angle_deg = 25.0;  ///< opening angle of the loop's normal cone from which it holds a feature
  double corner_angle_deg = 45.0;   ///< deviation of a normal from the crease's plane that makes a corner
  bool in_faces =
      false;  ///< samples may lie in the very faces of their cells: solids whose faces pass through nodes
  /// Exact normals without names: a crease that bends gets a sample where it passes from cell to cell too (bend_sample.h).
  bool bends = false;
  bool names = false;  ///< fill Patch::name and what follows it
};

struct ExtractReport {
  std::uint64_t loops = 0;
  std::uint64_t crease_samples = 0;
  std::uint64_t corner_samples = 0;
  std::uint64_t flips = 0;
  std::uint64_t bend_samples = 0;
  std::uint64_t crease_loops = 0;  ///< cut along the creases of the mesh
  std::uint64_t unfollowed_loops =
      0;  ///< creases of the mesh pass their faces, and could not be followed within
  std::uint64_t rejected_samples = 0;  ///< feature found but its sample turned triangles: plain triangulation
};

/// Extracts every brick of the block's core, in Morton order of bricks, and hands each non-empty patch to
/// `sink`. A cell takes part when all its eight nodes are valid or it closes a hole (closing.h); the latter hold no
/// features. The patch of a brick is a pure function of the field within one cell around it: the same bytes for any
/// block that holds it. A patch may be non-empty although its brick has no cell at the surface: edge points on its min
/// faces, and faces at features that pass them, belong to it, so extract every brick that touches a valid cell.
/// \pre   field.cells are multiples of kBrickCells
/// \post  the union of all patches, welded by key, is an oriented 2-manifold with border; the border lies
///        only where valid cells meet invalid ones; no face is degenerate
/// \param creases  of the mesh that the field comes from, of the same block, to be followed in the cells that they pass; null:
///        features are found from the roots alone. Not with names.
ExtractReport extract_surface(const DirectedField& field, const ExtractOptions& options,
                              const std::function<void(Patch&&)>& sink, const CreaseLines* creases = nullptr);

struct LevelFields;
struct LevelSurroundings;

/// Extracts one brick of a lattice whose bricks have several sizes (brick_levels.h).
/// \param level  its cells are 2^level cells of the finest lattice
/// \post  as above, over the bricks of all levels; the patch is named on the finest lattice (Patch::level)
Patch extract_level_brick(const LevelFields& fields, const LevelSurroundings& around, int level,
                          const ExtractOptions& options, ExtractReport& report);

}  // namespace tessera
