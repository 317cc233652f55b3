/// \file collapse_costs.h
/// What a halfedge collapse costs, by the quadrics that vertices carry or by another priority of DecimateOptions.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/decimate/collapse_bound.h"
#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/decimate.h"
#include "kernels/decimate/quadric.h"
#include "kernels/decimate/star_lanes.h"

namespace tessera {

/// What a halfedge collapse costs by quadrics: the error of q, which goes to `to`, and of what is there already.
[[nodiscard]] inline double endpoint_cost(const Quadric& q, const CollapseVertex& to) {
  const double error = q(to.at[0], to.at[1], to.at[2]);
  return (error > 0.0 ? error : 0.0) + to.error;
}
/// In a plane all costs are 0 but for rounding: there short edges go first.
[[nodiscard]] inline double tie_cost(double squared_edge) {
  return 1e-8 * squared_edge * squared_edge;
}

/// The star of a vertex whose collapses are weighed.
struct CandidateStar {
  explicit CandidateStar(const DecimateOptions& options)
      : lanes(options.tolerance > 0.0 ? options.tolerance : 1.0, options.min_mean_ratio) {}
  std::uint32_t centre = 0;
  Star star;
  bool in_lanes = false;  ///< `lanes` hold it: costs and tests are those that these have
  StarLanes lanes;
};

struct CollapseCandidate {
  double cost;
  std::uint32_t vertex;
  std::uint32_t at;  ///< its place in the ring
};

/// In no order: few get their turn.
struct CandidateList {
  /// Brings the cheapest from item[i] on to item[i]; equal costs fall to the lower vertex. \pre i < size
  const CollapseCandidate& next(std::size_t i);
  std::size_t size = 0;
  std::array<CollapseCandidate, kMaxRing + 1> item;
};

class CollapseCosts {
 public:
  /// \param mesh  outlives it, as all others do; vertices get their errors  \param origin  of mesh
  CollapseCosts(CollapseMesh& mesh, const MeshBlock& block, const Double3& origin,
                const DecimateOptions& options);

  double area() const { return area_; }  ///< of all faces at first

  /// \return false where the vertex has too many faces
  bool gather(std::uint32_t u, CandidateStar& s) const;
  /// All collapses of the centre that lines allow.
  void list(const CandidateStar& s, CandidateList& list);
  /// The cheapest of them; one of cost `none` where there is none cheaper.
  StarLanes::Cheapest cheapest(const CandidateStar& s, double none);

  /// Whether both ends of an edge may go to its best position: they are free inside the surface, and complete.
  [[nodiscard]] bool may_move(std::uint32_t u, std::uint32_t v) const;
  /// The minimum of both quadrics as the file will hold it, or the middle of the edge where it is not well determined or far off.
  [[nodiscard]] Double3 best_position(std::uint32_t u, std::uint32_t v) const;

  /// What u stood for goes to v. Before the collapse, and after v has moved.
  void merge(std::uint32_t u, std::uint32_t v);
  /// After CollapseMesh::compact().
  void compact(const std::vector<std::uint32_t>& kept);

 private:
  /// Area-weighted sum of original normals.
  struct NormalSum {
    Double3 normal{};
    double area = 0.0;
    NormalSum& operator+=(const NormalSum& o) {
      normal = normal + o.normal;
      area += o.area;
      return *this;
    }
  };
  void add_face(std::uint32_t f);
  void add_walls(std::uint32_t f, const Double3* p, const Double3& n);
  void update_error(std::uint32_t v);
  double cost(const CandidateStar& s, const Quadric& q, const Double3& from, std::size_t at);
  double priority_cost(const CandidateStar& s, const Quadric& q, double squared_edge, std::size_t at);
  double moved_cost(std::uint32_t u, std::uint32_t v) const;
  double normal_cost(std::uint32_t u, const Star& star, std::size_t at) const;
  double worst_shape(const Star& star, std::size_t at) const;
  double attribute_cost(std::uint32_t u, const CollapseFoot& foot) const;

  CollapseMesh& mesh_;
  const MeshBlock& block_;
  const Double3 origin_;
  const DecimateOptions& options_;
  const bool plain_;  ///< costs are endpoint quadrics without attributes
  double area_ = 0.0;
  std::vector<Quadric> quadric_;
  std::vector<NormalSum> normal_sum_;  ///< kNormalDeviation only
  LinkSides sides_;                    ///< scratch
};

}  // namespace tessera
