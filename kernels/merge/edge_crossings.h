/// \file edge_crossings.h
/// Whether new edges would cross those around a place, as seen along a normal: most are told apart four at once.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// An edge of a border, its face on the left.
struct FrontEdge {
  std::uint32_t from, to, face;
};

/// The edges around one, laid out for vectors.
class EdgeCrossings {
 public:
  /// \param position  must outlive this
  explicit EdgeCrossings(const std::vector<Double3>& position) : position_(position) {}

  /// Around the edge from u to v, in any order.
  /// \param near  numbers among `edges`
  void load(const Double3& u, const Double3& v, const std::vector<FrontEdge>& edges,
            const std::vector<std::uint32_t>& near);
  /// Whether the edge between two vertices, both of them ends of what was loaded, crosses any of that, as seen along n. Edges with an end in common do not cross.
  [[nodiscard]] bool crosses_any(std::uint32_t p, std::uint32_t q, const Double3& n) const;

 private:
  static constexpr std::size_t kFirst = 32;

  bool crosses(std::uint32_t p, std::uint32_t q, const Double3& n, const FrontEdge& e) const;

  const std::vector<Double3>& position_;
  std::vector<std::pair<double, std::uint32_t>> by_distance_;
  std::vector<FrontEdge> near_;
  std::array<std::vector<double>, 3> from_, to_;  ///< their ends as seen from u, padded to whole vectors
  Double3 viewpoint_{};                           ///< u
  double sure_area_ = 0.0;  ///< doubled areas above it have the sign that they seem to have
};

}  // namespace tessera
