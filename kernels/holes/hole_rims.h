/// \file hole_rims.h
/// Boundary loops of a mesh, told from faces whose vertices bear numbers. An edge of one face is the border, one of
/// more is a chord.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace tessera {

/// An edge of a face. Sorted, the faces of one edge follow each other.
struct RimRecord {
  std::uint64_t low = 0;
  std::uint64_t high = 0;
  std::uint64_t third = 0;  ///< 2 * the face's other vertex + 1 if the face runs from high to low
  auto operator<=>(const RimRecord&) const = default;
};
/// The face runs from a to b to c.
RimRecord rim_record(std::uint64_t a, std::uint64_t b, std::uint64_t c);

/// A border edge as a filling's face runs: against that of the mesh.
struct BorderEdge {
  std::uint64_t from = 0;
  std::uint64_t to = 0;
  std::uint64_t third = 0;  ///< the face's other vertex
};
using Chord = std::array<std::uint64_t, 2>;  ///< low, high

/// Border and chords of records that come sorted.
class RimMatcher {
 public:
  void add(const RimRecord& record);
  /// After the last record; then `border` is sorted by `from`.
  void finish();

  std::vector<BorderEdge> border;
  std::vector<Chord> chords;  ///< ascending

 private:
  void close();
  RimRecord open_;
  std::uint64_t faces_ = 0;
};

/// A loop in the order in which the faces of a filling run along it.
struct HoleRim {
  std::vector<std::uint64_t> vertex;  ///< n, the smallest number first
  std::vector<std::uint64_t> third;   ///< n: of the mesh's face at the edge from i to i + 1
  /// Chords between vertices of the loop, as HoleLoop::taken.
  std::vector<std::array<std::uint32_t, 2>> taken;
};

/// What was met on the way along the border.
struct RimCounts {
  std::uint64_t loops = 0;
  std::uint64_t longest = 0;
  std::uint64_t broken = 0;  ///< ways that do not come back to where they began
};

/// Loops of 3 to `most` edges, in the order of their smallest numbers. \cost linear in the border
/// \param use  may throw, to stop
RimCounts for_each_rim(const RimMatcher& rims, std::uint64_t most, const std::function<void(HoleRim&&)>& use);

/// The same among loops of which all that is known are the edges around: those of at most `most` edges whose smallest
/// number lies in [first, last). An edge whose faces are not all there must not be among the records, then a way along it
/// ends.
std::vector<HoleRim> short_rims(const RimMatcher& rims, std::uint64_t first, std::uint64_t last,
                                std::uint64_t most);

}  // namespace tessera
