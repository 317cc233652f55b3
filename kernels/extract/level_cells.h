/// \file level_cells.h
/// Loops of the cells at which finer bricks begin: each of their faces that a finer brick shares is four squares of that
/// brick's lattice, each edge that one touches is two. Cells across see the same segments, whatever their level.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/extract/brick_band.h"
#include "kernels/extract/brick_levels.h"

namespace tessera {

/// A vertex of a loop, and its way to the next one.
struct LevelPoint {
  int axis = 0;
  bool finer = false;
  std::uint8_t edge = 0;  ///< of the cell (cell_loops.h), where its edge is whole
  Int3 node = {0, 0, 0};  ///< else of the finer lattice: where the half edge, or the edge amid a face, begins
  unsigned faces = 0;     ///< bits of the cell's faces that it lies on: two, or one amid a face
  std::uint8_t line = 0;  ///< edge of the cell that it lies on, 255 amid a face
  bool ends = false;      ///< the surface ends at the segment to the next point
};
using LevelLoop = std::vector<LevelPoint>;

class LevelCells {
 public:
  /// \param mixed  of mix_levels()
  LevelCells(const LevelFields& fields, const LevelSurroundings& around, const DirectedField& mixed)
      : fields_(fields), around_(around), mixed_(mixed) {}

  /// Loops of two points join what lies beyond both: they have no faces.
  /// \param cell  of the brick; it has a split edge (LevelPair::is_transition) and takes part
  [[nodiscard]] std::vector<LevelLoop> trace(const Int3& cell, const BrickBand& band) const;
  [[nodiscard]] int step_of(const Int3& cell) const {
    return around_.touching(cell, {1, 1, 1}, kBrickCells).minimum;
  }

  [[nodiscard]] const EdgeRoot& finer_root(const Int3& node, int axis) const;
  /// Global coordinates of a node of the finer lattice.
  [[nodiscard]] Int3 finer_node(const Int3& node) const;
  struct Name {
    int type;     ///< as VertexKey has it
    bool border;  ///< not all four cells around take part
  };
  /// Name of a finer vertex for a cell of the brick that has it.
  [[nodiscard]] Name finer_name(const Int3& node, int axis, const Int3& cell, const BrickBand& band) const;

 private:
  struct Face;
  struct Links;
  bool is_split(const Int3& low, const Int3& size) const {
    return around_.touching(low, size, 2 * kBrickCells).minimum < 0;
  }
  void list_faces(const Int3& cell, int face, std::vector<Face>& out) const;
  void link(const Int3& cell, const Face& face, std::uint8_t number, Links& links) const;
  /// \param quarter  of a face, where all nodes are of the finer lattice
  LevelPair::Node node(const Int3& at, bool quarter) const;
  bool ends_at(const Int3& cell, const Face& face, const BrickBand& band) const;
  bool ends_beyond(const Int3& cell, int face, const LevelPoint& point, bool ends,
                   const BrickBand& band) const;
  bool finer_takes_part(const Int3& finer_cell, const BrickBand& band) const;

  const LevelFields& fields_;
  const LevelSurroundings& around_;
  const DirectedField& mixed_;
};

/// Triangulation of a loop of any size: of least area without a chord in a face of the cell. Cells across might have the same
/// chord, and where a shared face is four squares, points of the loop lie in a line.
/// \param point  of the loop, cells
/// \return corners as positions in the loop; empty: every triangulation has such a chord, use a centre
[[nodiscard]] std::vector<std::array<std::size_t, 3>> triangulate_level_loop(
    const LevelLoop& loop, const std::vector<Float3>& point);

}  // namespace tessera
