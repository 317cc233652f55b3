/// \file closing.h
/// Closes the surface of a block where the data ends, by the zero set of the closing field (closing_field.h).
///
/// Where the local fit is valid its signs stand. Everywhere else a node is inside when the closing field is
/// negative. The closing cells are those that the surface of this field reaches from the rims of the
/// local surface: start at every cell that shares a crossed face with a local cell and lacks a valid node, go
/// on through crossed faces, stop at local cells. So every crossed face has a cell on both sides, and the
/// result has no border, whatever the field does. The set is unique: it does not matter in which order bricks
/// are grown.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <vector>

#include "kernels/closing/closing_field.h"
#include "kernels/field/directed_field.h"

namespace tessera {

/// Signs of the local field at the nodes of one leaf.
struct BandSigns {
  Int3 origin = {0, 0, 0};  ///< global node coordinates, multiples of 8
  LeafWords valid{};
  LeafWords inside{};
};

/// Closing cells of one leaf.
struct ClosingLeaf {
  Int3 origin = {0, 0, 0};  ///< global cell coordinates, multiples of 8
  LeafWords cells{};
  LeafWords forced{};  ///< nodes whose sign the flow of signs has changed: neither field has its say there
  LeafWords inside{};  ///< of these
  LeafWords near{};    ///< nodes whose value follows from the flow: forced ones, and those beside them
  std::array<std::int8_t, 512> value{};  ///< of these, cells * kFlowSteps, > 0 outside
};
inline constexpr float kFlowSteps = 60.0f;

/// Signs of the nodes of a leaf that need no evaluation.
struct FixedSigns {
  Int3 origin = {0, 0, 0};  ///< as in BandSigns
  LeafWords known{};        ///< of the closing field, or forced
  LeafWords forced{};
  LeafWords inside{};
};

struct ClosingOptions {
  /// Winding number from which a node is inside: 1/2 for the surface of a solid, 0 for an open sheet, -1/2 for the
  /// walls of a room.
  float level = 0.5f;
  /// Global nodes that are not between low and high (exclusive) are as infinity is: outside, or inside if level < 0.
  Int3 low = {0, 0, 0};
  Int3 high = {0, 0, 0};
  /// Cells; growth stops where a node is farther from the data, and what is connected to such a place is taken back:
  /// a hole is closed whole or not at all. 0 = no limit.
  float limit = 0.0f;
};

/// Largest limit, cells: what the near field holds around a brick.
inline constexpr float kMaxClosingLimit = 56.0f;

/// Cells of the block from which closing starts: for every pair of cells that share a crossed face, one of
/// them local, the other not. A pair belongs to the block that holds its upper cell; its lower one may lie
/// just below the block. Global coordinates, ascending by Morton code, no repeats.
[[nodiscard]] std::vector<Int3> boundary_cells(const DirectedField& field);

/// Signs of the leaves of one brick of the block. \param brick  within the block
[[nodiscard]] std::vector<BandSigns> signs_of_brick(const DirectedField& field, const Int3& brick);

/// Values of the closing field; asked only where a sign is wanted that is not known.
using SignSource = std::function<void(std::span<const Int3> queries, std::span<float> value)>;

struct GrownCells {
  std::vector<ClosingLeaf> cells;  ///< all closing cells of the brick, by leaf in Morton order
  std::vector<Int3> leaving;       ///< cells of other bricks to go on from; global, may repeat
  std::vector<Int3> stopped;       ///< cells that the limit kept out; global, may repeat
  /// Signs of the closing field that were asked for; the leaves may be part of a brick's.
  std::vector<BandSigns> evaluated;
  std::uint64_t added = 0;
};

/// Takes back the cells that hang together, face by face, with one beside a cell that the limit kept out.
/// \param bricks   closing cells of all bricks, by brick in Morton order of keys
/// \param stopped  of all bricks
/// \returns how many cells were taken back; bricks may end up empty
std::uint64_t take_back_unfinished(std::map<std::uint64_t, std::vector<ClosingLeaf>>& bricks,
                                   std::span<const Int3> stopped);

/// Grows the closing cells of one brick from seeds.
/// \param corner  global cell coordinates of the brick
/// \param signs   of the leaves that hold nodes [0, 64] of the brick
/// \param known   its closing cells so far
/// \param near_points  data around the brick, for the limit: quanta; complete within the limit or empty
/// \param fixed  signs that stand, of leaves that hold nodes [0, 64] of the brick
/// \pre  `field` holds what nodes [0, 64] of the brick need
[[nodiscard]] GrownCells grow_closing(const Int3& corner, std::span<const BandSigns> signs,
                                      std::span<const ClosingLeaf> known, std::span<const Int3> seeds,
                                      const SignSource& field, std::span<const Int3> near_points,
                                      const ClosingOptions& options, std::span<const FixedSigns> fixed = {});

/// Adds closing cells to the band of a block: values of the closing field at their nodes and roots on their
/// edges.
/// \param cells  those of the block and of the leaves just below and above it
/// \post  the local cells of `field` are what they were, but for those with a forced node
void add_closing(DirectedField& field, std::span<const ClosingLeaf> cells, const ClosingField& closing,
                 const ClosingOptions& options);

}  // namespace tessera
