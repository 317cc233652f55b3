/// \file field_parts.h
/// The band of a block from those of its parts, so that no more points than a part's need lie in memory at once.
#pragma once
#include <cstddef>
#include <vector>

#include "kernels/field/directed_field.h"

namespace tessera {

/// Joins the bands of parts that fill a block without overlap, in any order. What lies around the block comes from the
/// parts beside it.
class FieldParts {
 public:
  /// \param origin, cells  of the block; multiples of 8
  FieldParts(const Int3& origin, const Int3& cells);

  /// \pre the part lies in the block, edges on multiples of 8 cells; its band is of the same samples and options as
  ///      the others
  void add(DirectedField&& part);

  /// \post what the extractor reads of it is what evaluate_field() makes of the whole block, to the bit
  [[nodiscard]] DirectedField take() &&;

 private:
  /// A leaf with its runs of roots and moves.
  struct Piece {
    std::size_t at = 0;  ///< in the dense table of the block
    BandLeaf leaf;
    std::uint32_t first_root = 0, end_root = 0;
    std::size_t first_move = 0, end_move = 0;
  };

  DirectedField block_;  ///< without leaves until they are taken
  std::vector<Piece> pieces_;
  std::vector<EdgeRoot> roots_;
  std::vector<std::uint8_t> creased_;
  std::vector<BorderMove> moves_;
};

}  // namespace tessera
