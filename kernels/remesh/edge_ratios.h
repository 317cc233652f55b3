/// \file edge_ratios.h
/// How evenly lengths of edges change over a mesh that is edited: every vertex has the mean length of its edges, every edge
/// the ratio of the larger to the smaller mean of its two ends.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"

namespace tessera {

/// What edits are judged by: the sum over edges of the square of what their ratio has above kRatioAimed. What touches an
/// edge that is not known costs kNoRatio, and is for another block to do.
class EdgeRatios {
 public:
  static constexpr double kNoRatio = std::numeric_limits<double>::infinity();

  /// \param mesh   outlives this
  /// \param whole  per vertex whether all its edges are in the mesh; those that splits add are
  /// \param aimed  ratio from which on an edge costs, >= 1
  EdgeRatios(const CollapseMesh& mesh, std::vector<std::uint8_t> whole, double aimed);

  /// After an edit, for every vertex whose edges changed; new ones too.
  void renew(std::uint32_t v);
  [[nodiscard]] double mean(std::uint32_t v) const { return sum_[v] / degree_[v]; }
  /// 1 and more; 0 where an end is not whole.
  [[nodiscard]] double ratio(std::uint32_t a, std::uint32_t b) const;

  // What an edit adds to the cost, negative where lengths get more even; kNoRatio where that cannot be told.
  /// Of the edge across from the corner, which has two faces.
  double flip_adds(std::uint32_t corner);
  /// Of the edge across from the corner, at that place.
  double split_adds(std::uint32_t corner, const Double3& at);
  /// The star's centre goes to star.ring[at].
  double collapse_adds(const Star& star, std::size_t at);

  /// Opens the star for move_costs(). \returns the cost of the edges around it as they are, or kNoRatio
  double open_star(std::uint32_t v, const Star& star);
  /// What these edges cost with the centre of the opened star at p.
  double move_costs(const Double3& p);

 private:
  double begin(std::span<const std::uint32_t> changed);
  std::uint32_t local(std::uint32_t v);
  void drop(std::uint32_t a, std::uint32_t b);
  void add(std::uint32_t a, std::uint32_t b, double length);
  double cost() const;

  const CollapseMesh& mesh_;
  std::vector<std::uint8_t> whole_;
  std::vector<double> sum_, degree_;  ///< of the edges at a vertex; degrees are whole numbers
  double aimed_;
  // Of the edit at hand: vertices whose edges change, then their neighbours, and the edges between them.
  std::vector<std::uint32_t> vertex_;
  std::vector<double> local_sum_, local_degree_;
  std::vector<std::array<std::uint32_t, 2>> edges_;
  std::vector<Double3> ring_;
  std::vector<double> without_;  ///< sums of the ring's vertices but for the spoke
};

}  // namespace tessera
