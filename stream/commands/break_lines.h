/// \file break_lines.h
/// Lines along which a mesh bends by more than an angle, chained: what surveyors hand on as breaklines of a TIN.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"

namespace tessera {

struct BreakLineOptions {
  double angle =
      30.0;  ///< degrees between the normals of two faces at an edge, above which it is part of a line
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  std::filesystem::path temp;
  std::function<void()> check_stop;  ///< may throw StoppedError; may be empty
};

class BreakLines {
 public:
  /// Reads the mesh twice; edges are sorted outside of memory, those that break are held: 56 bytes each. Borders are no breaks;
  /// edges of more than two faces are where two of these differ by more than the angle.
  /// \throws ResourceError where too many edges break
  BreakLines(MeshReader& mesh, const BreakLineOptions& options);
  std::uint64_t lines() const { return lines_; }
  std::uint64_t edges() const { return edges_.size(); }
  /// Lines end where not two edges meet; closed ones have their first point twice. Their order and direction hang on the mesh alone.
  void for_each(const std::function<void(std::span<const Double3>)>& use);

 private:
  using Edge = std::array<std::uint64_t, 2>;
  struct End {
    std::uint64_t vertex = 0, edge = 0;
    bool operator<(const End& o) const { return vertex != o.vertex ? vertex < o.vertex : edge < o.edge; }
  };
  void find_edges(MeshReader& mesh, const BreakLineOptions& options);
  template <class Use>
  void walk(const Use& use) const;
  std::span<const End> ends_at(std::uint64_t vertex) const;

  VertexStore store_;
  std::vector<Edge> edges_;  ///< ascending
  std::vector<End> ends_;    ///< ascending
  std::uint64_t lines_ = 0;
};

}  // namespace tessera
