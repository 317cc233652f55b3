/// \file boundary_chain.h
/// Boundary loops from border edges that come one after the other: memory is that of the paths which are still open.
#pragma once
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

#include "kernels/holes/boundary_loops.h"

namespace tessera {

/// Joins edges to paths at their ends. A path of more edges than asked for is forgotten but for its ends, so that what joins
/// it later is forgotten too. Canonical: a pure function of the edges and their order.
class BoundaryChain {
 public:
  /// \param max_edges  of a loop; \param max_open  edges of all open paths: beyond, all are forgotten
  BoundaryChain(std::uint64_t max_edges, std::uint64_t max_open)
      : max_edges_(max_edges), max_open_(max_open) {}

  /// Each edge once, in any order; a vertex has one edge out and one in. Order by place keeps few paths open.
  /// \param use  gets the loop that it closes, if it has 3 to max_edges edges; without chords. Its smallest number comes first.
  void add(const BoundaryEdge& edge, const std::function<void(HoleBoundary&&)>& use);

  [[nodiscard]] std::uint64_t open_edges() const { return open_; }
  /// Loops and paths that max_open cut short.
  [[nodiscard]] std::uint64_t given_up() const { return given_up_; }

  /// Upper bound of what it allocates.
  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t max_open) { return 256 * max_open; }

 private:
  /// A half-open run of edges: every vertex with the third vertex of the face at the edge out of it.
  struct Path {
    std::uint64_t first = 0, last = 0;  ///< the first edge's `from`, the last one's `to`
    bool forgotten = false;
    std::vector<BoundaryEdge> edges;
  };
  using Ends = std::unordered_map<std::uint64_t, std::size_t>;

  std::size_t new_path(const BoundaryEdge& edge);
  void forget(Path& path);
  void join(std::size_t front, std::size_t back);
  void close(std::size_t path, const std::function<void(HoleBoundary&&)>& use);

  std::uint64_t max_edges_, max_open_;
  std::uint64_t open_ = 0, given_up_ = 0;
  std::vector<Path> paths_;
  std::vector<std::size_t> free_;
  Ends by_first_, by_last_;
};

}  // namespace tessera
