/// \file boundary_loops.h
/// Boundary loops of a mesh, traced from the edges of its faces. An edge of one face is a boundary edge, an edge of more is
/// a chord.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace tessera {

/// An edge of a face. Sorted, the faces of one edge follow each other.
struct EdgeRecord {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
  std::uint64_t third = 0;  ///< 2 * the face's other vertex + 1 if the face runs from high to low
  auto operator<=>(const EdgeRecord&) const = default;
};
/// The face runs from a to b to c.
[[nodiscard]] EdgeRecord edge_record(std::uint64_t a, std::uint64_t b, std::uint64_t c);

/// A boundary edge, directed as a face that fills the hole would run: against the face of the mesh.
struct BoundaryEdge {
  std::uint64_t from = 0;
  std::uint64_t to = 0;
  std::uint64_t third = 0;  ///< the face's other vertex
};
using Chord = std::array<std::uint64_t, 2>;  ///< low, high

/// Finds boundary edges and chords in records that come sorted.
class BoundaryMatcher {
 public:
  void add(const EdgeRecord& record);
  /// After the last record; then `border` is sorted by `from`.
  void finish();

  std::vector<BoundaryEdge> border;
  std::vector<Chord> chords;  ///< ascending

 private:
  void close();
  EdgeRecord open_;
  std::uint64_t faces_ = 0;
};

/// A boundary loop, in the order in which the faces of a filling run along it.
struct HoleBoundary {
  std::vector<std::uint64_t> vertex;  ///< n, the smallest number first
  std::vector<std::uint64_t> third;   ///< n: of the mesh's face at the edge from i to i + 1
  /// Chords between vertices of the loop, as HoleLoop::taken.
  std::vector<std::array<std::uint32_t, 2>> taken;
};

/// What tracing the boundary met.
struct LoopCounts {
  std::uint64_t loops = 0;
  std::uint64_t longest = 0;
  std::uint64_t broken = 0;  ///< paths that do not close
};

/// Loops of 3 to `maximum` edges, in the order of their smallest numbers. \cost linear in the border
/// \param use  may throw, to stop
LoopCounts for_each_boundary_loop(const BoundaryMatcher& boundaries, std::uint64_t maximum,
                                  const std::function<void(HoleBoundary&&)>& use);

/// The same where only a part of the mesh is known: loops of at most `maximum` edges whose smallest number lies in [first, last).
/// Records must leave out every edge of which some face is unknown: a path ends there.
[[nodiscard]] std::vector<HoleBoundary> short_boundary_loops(const BoundaryMatcher& boundaries,
                                                             std::uint64_t first, std::uint64_t last,
                                                             std::uint64_t maximum);

}  // namespace tessera
