/// \file sign_flow.h
/// Cuts the small handles and flaps that closing leaves where scans contradict each other.
///
/// The signs of the nodes around the closing cells flow by their mean curvature: blurred, then cut at zero, a fixed
/// number of rounds. Source: Merriman, Bence, Osher, "Diffusion generated motion by mean curvature", 1992. Changes: nodes
/// of the local field stay, but for those at the rims; a node changes only where the blur is sure, so that a
/// smooth surface stays what it was, bit for bit. What is thinner than the blur goes: handles, tunnels, flaps.
///
/// Works brick by brick with a halo; every step reads the signs of the step before, so bricks may come in any
/// order.
#pragma once
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "kernels/closing/closing.h"

namespace tessera {

/// What is known of the nodes of one leaf.
struct NodeSigns {
  LeafWords local{};     ///< sign of the local field
  LeafWords field{};     ///< sign of the closing field
  LeafWords known{};     ///< either, or that of the nearest such nodes
  LeafWords inside{};    ///< of known nodes
  LeafWords original{};  ///< what `inside` was before the flow
  LeafWords free{};      ///< the sign may change

  [[nodiscard]] std::uint64_t forced(std::size_t z) const { return (inside[z] ^ original[z]) & free[z]; }
};

/// By Morton code of (node >> 3): leaves of one brick lie in a row.
using SignMap = std::map<std::uint64_t, NodeSigns>;
using SignChange = std::vector<std::pair<std::uint64_t, NodeSigns>>;
/// Closing cells of all bricks, by key of the brick.
using ClosingMap = std::map<std::uint64_t, std::vector<ClosingLeaf>>;

inline constexpr int kFlowRounds = 6;

/// The leaves within one of those that hold closing cells, nothing known of their nodes.
[[nodiscard]] SignMap flow_region(const ClosingMap& cells);

/// Adds signs of the closing field.
void add_field_signs(std::span<const BandSigns> signs, SignMap& map);
/// Enters signs into those leaves of the region that are there: first the local ones, which stand above the others.
void enter_local_signs(std::span<const BandSigns> signs, SignMap& region);
void enter_field_signs(const SignMap& signs, SignMap& region);

/// The leaves of one brick with the signs of unknown nodes taken from around them, and with the nodes that are free.
[[nodiscard]] SignChange prepare_flow(const SignMap& region, const ClosingMap& cells, const Int3& brick);

/// The local nodes among the free ones of prepared leaves, quanta, in the order of fix_local().
[[nodiscard]] std::vector<Int3> loose_nodes(const SignChange& leaves);
/// Takes those from the free ones whose sign the winding number is sure of, too: what scans show stays, however thin.
/// \param winding  at the loose nodes
void fix_local(std::span<const float> winding, float level, SignChange& leaves);

/// The leaves of one brick after one round.
[[nodiscard]] SignChange flow_signs(const SignMap& region, const Int3& brick);

/// What grow_closing() need not ask for in a brick.
[[nodiscard]] std::vector<FixedSigns> fixed_around(const SignMap& signs, const Int3& brick);
/// Cells with a forced node, for closing to start from.
[[nodiscard]] std::vector<Int3> forced_cells(const SignMap& signs);
/// The leaves of one brick with forced nodes or beside them, with values and without cells, ascending.
[[nodiscard]] std::vector<ClosingLeaf> flow_values(const SignMap& signs, const Int3& brick);
/// Enters what flow_values() found for a brick into its closing cells. \returns how many nodes are forced
std::uint64_t add_flow_values(std::vector<ClosingLeaf> values, std::vector<ClosingLeaf>& cells);

}  // namespace tessera
