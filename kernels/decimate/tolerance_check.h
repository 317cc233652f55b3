/// \file tolerance_check.h
/// Whether a collapse stays within the tolerance of the reference. Sums of bounds tell most; where they grow faster than the
/// distance itself, first a coarse reference is asked, then the reference.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/decimate/collapse_bound.h"
#include "kernels/decimate/collapse_legality.h"
#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/decimate.h"
#include "kernels/decimate/reference_deviation.h"

namespace tessera {

class ToleranceCheck {
 public:
  /// \param mesh       outlives it, as the options do
  /// \param reference  same origin as mesh; read when options.tolerance > 0
  /// \param reference_vertex  per vertex of the mesh the same one in the reference, or kNoCorner
  ToleranceCheck(const CollapseMesh& mesh, const CollapseMesh& reference,
                 std::vector<std::uint32_t> reference_vertex, const DecimateOptions& options);

  /// Whether every new face must be held against the normals of the reference.
  [[nodiscard]] bool asks_normals() const { return min_cosine_ > -1.0; }

  // Of the collapse of u into star.ring[at], over the link in `sides`.

  /// \param bound  the sum that bound_by_sum() found; comes back as a smaller one where that was proven
  CollapseRefusal check(std::uint32_t u, const Star& star, std::size_t at, const LinkSides& sides,
                        CollapseBound& bound);
  /// The same whatever the sum. \param[out] bound  what was proven \param line_deviation  of the line that u lies on
  CollapseRefusal ask(std::uint32_t u, const Star& star, std::size_t at, const LinkSides& sides, float& bound,
                      double line_deviation = 0.0);

  /// The same of the collapse of both u and v into p, over the link `loop`. Where it is, v goes on with the reference vertex of
  /// an end of the edge. \param bound  the sum of bounds (infinite: ask); comes back as what was proven
  bool is_edge_near(std::uint32_t u, std::uint32_t v, const Double3& p, const LinkLoop& loop, float& bound);

  /// The mesh as it is becomes the coarse reference.
  void set_coarse();
  /// From now on vertices keep their numbers, and remember which vertex of the reference refused them.
  void keep_witnesses();
  /// After CollapseMesh::compact().
  void compact(const std::vector<std::uint32_t>& kept);

  void report(DecimateReport& report) const;

 private:
  CollapseRefusal check_line(std::uint32_t u, std::uint32_t v, std::uint32_t end, bool short_sum,
                             double& deviation) const;
  enum class Doubt : std::uint8_t { kOpen, kWithin, kBeyond };
  ReferenceDeviation::Result measure_side(std::uint32_t u, std::uint32_t v, const LinkSides& sides,
                                          std::size_t s, bool on_line);
  Doubt ask_coarse(std::uint32_t u, const Star& star, std::size_t at, const LinkSides& sides, float& bound);

  const CollapseMesh& mesh_;
  const DecimateOptions& options_;
  const double min_cosine_;
  ReferenceDeviation reference_, coarse_;
  std::vector<std::uint32_t> reference_vertex_;
  /// Per vertex: the vertex of the reference, of the coarse one that last refused its removal.
  std::vector<std::uint32_t> witness_, coarse_witness_;
  std::size_t asked_ = 0, accepted_ = 0;
};

}  // namespace tessera
