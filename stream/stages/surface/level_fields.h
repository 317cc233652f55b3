/// \file level_fields.h
/// The fields of bricks of several sizes, from points on the lattice of the coarsest level. Each level has its own spacing and, where
/// normals are estimated, normals of its own; where points are too sparse for a level the next coarser one tells
/// (coarser_fits.h), and the next above that.
#pragma once
#include <functional>
#include <memory>

#include "kernels/extract/brick_levels.h"
#include "kernels/field/field.h"
#include "kernels/points/normals.h"

namespace tessera {

class LevelFieldMaker {
 public:
  /// \param refines_normals  normals of the points tell sides alone, planes are fitted on every level
  LevelFieldMaker(int levels, const FieldOptions& field, const NormalOptions& normals, bool refines_normals)
      : levels_(levels), field_(field), normals_(normals), refines_normals_(refines_normals) {}

  /// Cells of the level along one of the points', and of a brick in cells of the points.
  int scale(int level) const { return 1 << (levels_ - 1 - level); }
  int edge(int level) const { return kBrickCells / scale(level); }
  /// How far around a brick points decide of it, in cells of the points: two nodes, and what those and their normals see on the
  /// coarsest level.
  int halo() const { return 2 + field_halo(); }

  /// Of a leaf of the octree. \param points  of it and its halo, in any surroundings  \param pause  as FieldOptions::pause
  LevelFields fields_of(const Int3& leaf, int level, const LevelSurroundings& around,
                        const PointBlock& points, const std::function<void()>& pause) const;

 private:
  using Wanted = std::function<bool(const Int3&)>;  ///< of nodes of a level, from the lattice origin
  using MayBe = std::function<bool(const Int3&, const Int3&)>;  ///< of boxes of nodes relative to a brick
  struct BrickNodes;
  struct Seen;

  int field_halo() const {
    return field_halo_cells(field_) + (refines_normals_ ? normal_halo_cells(normals_) : 0);
  }
  int near_halo(int level) const;
  PointBlock with_own_normals(const PointBlock& points, float by, const Int3& low, const Int3& cells) const;
  PointBlock points_on(const PointBlock& around, int level, const Int3& low, const Int3& cells) const;
  FieldOptions options_on(int level, const std::function<void()>& pause) const;
  std::unique_ptr<CoarserFits> coarser_fits(const PointBlock& around, const PointBlock& points, int level,
                                            const Wanted& wanted, const Wanted& requested,
                                            const std::function<void()>& pause) const;
  DirectedField evaluate(const Seen& seen, int level, const Int3& low, int cells, const Wanted& wanted,
                         const MayBe& may_be) const;

  int levels_;
  FieldOptions field_;
  NormalOptions normals_;
  bool refines_normals_;
};

/// Points that lie in [low - halo, low + cells + halo), counted; and those in the same order, relative to `low`.
/// \param by  cells of the lattice of `low` along one of the points: 1, or a power of two
std::size_t count_part(const PointBlock& points, const Int3& low, const Int3& cells, int halo);
PointBlock scaled_part(const PointBlock& points, float by, const Int3& low, const Int3& cells, int halo);

}  // namespace tessera
