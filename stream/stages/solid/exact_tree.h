/// \file exact_tree.h
/// The tree of meshes of `csg --exact` in memory: how it is read from a program, and its joins one after the other.
#pragma once
#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "kernels/boolean/exact_boolean.h"
#include "kernels/boolean/settle_rounding.h"
#include "octree/placement.h"

namespace tessera {

/// A mesh, or what joins the two before it.
struct ExactStep {
  std::optional<std::size_t> input;
  Placement placement;
  BooleanJoin join = BooleanJoin::kUnite;
};

/// \throws UsageError  for shapes; InputError where it is no tree
std::vector<ExactStep> exact_steps(const std::string& program);

/// What the joins did, summed up.
struct ExactSum {
  BooleanStats stats;
  RoundingStats rounding;
  void add(const BooleanStats& s, const RoundingStats& r) {
    stats.face_pairs += s.face_pairs;
    stats.coplanar_pairs += s.coplanar_pairs;
    stats.cut_faces += s.cut_faces;
    stats.kept_faces = s.kept_faces;
    stats.made_faces = s.made_faces;
    stats.made_vertices += s.made_vertices;
    stats.split_vertices = s.split_vertices;
    rounding.met += r.met;
    rounding.moved += r.moved;
    rounding.farthest = std::max(rounding.farthest, r.farthest);
  }
};

/// Owned by the call that may be left behind.
struct ExactWork {
  std::vector<ExactStep> steps;
  std::vector<SolidMesh> meshes;
  std::vector<std::string> names;
  bool floats = false;
  SolidMesh result;
  ExactSum sum;
  std::vector<std::string> turned;  ///< inputs that were inside out

  /// \throws InputError for a mesh that is no solid, ValidationError where a cut cannot be rounded soundly
  void run();

 private:
  SolidMesh joined(const SolidMesh& first, const SolidMesh& second, BooleanJoin join);
};

}  // namespace tessera
