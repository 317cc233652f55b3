/// \file feature_loops.h
/// The loops of a brick and its halo that a sharp feature passes, and their faces.
/// Source: thesis 4.2.2; Kobbelt, Botsch, Schwanecke, Seidel, "Feature Sensitive Surface Extraction", 2001.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/extract/edge_vertices.h"
#include "kernels/extract/extended_marching_cubes.h"

namespace tessera {

class LevelCells;

/// What all passes over one brick read.
struct BrickInput {
  const DirectedField& field;
  const BrickBand& band;
  ExtractMethod method;
  FeatureThresholds thresholds;
  const LevelCells* levels = nullptr;  ///< of bricks whose edges finer bricks split; the field is mixed then
};

struct FeatureLoop {
  /// A point of a loop.
  struct Corner {
    std::uint32_t vertex, root;
    std::uint8_t edge;
    std::uint8_t kinks = 0;        ///< of the segment from here
    std::uint32_t first_kink = 0;  ///< FeatureLoops::kink()
  };
  Int3 cell;            ///< relative to the brick; -1 on one axis for the halo
  std::uint8_t number;  ///< loop of the cell
  std::uint8_t size;
  /// Per axis: loops of the cell below that a flip already links to this one.
  std::uint8_t flipped[3] = {0, 0, 0};
  std::uint32_t first;   ///< of its corners
  std::uint32_t centre;  ///< vertex
  Float3 position;       ///< of the centre, relative to the cell
};

/// Feature loops in the order of their cells, found by an edge of a cell.
class FeatureLoops {
 public:
  explicit FeatureLoops(std::size_t active_cells) : first_of_cell_(active_cells, -1) {}

  /// \param rank  LeafMasks::cell_rank() of its cell; loops of a cell come one after the other
  void add(const TracedLoop& loop, std::uint32_t rank, std::uint32_t centre, const Float3& position);
  /// A vertex on a segment of the loop added last, in the order of segments and along them.
  void add_kink(std::size_t segment, std::uint32_t vertex);
  [[nodiscard]] std::uint32_t kink(std::size_t k) const { return kinks_[k]; }
  /// Null where the cell has no feature loop through the edge.
  FeatureLoop* find(const BrickBand& band, const Int3& cell, int edge);
  std::vector<FeatureLoop>& all() { return loops_; }
  /// \param s  within [0, size]: the one behind the last is the first
  [[nodiscard]] const FeatureLoop::Corner& corner(const FeatureLoop& loop, std::size_t s) const {
    return corners_[loop.first + (s == loop.size ? 0 : s)];
  }

 private:
  std::vector<FeatureLoop> loops_;
  std::vector<FeatureLoop::Corner> corners_;
  std::vector<std::uint32_t> kinks_;
  std::vector<std::int32_t> first_of_cell_;  ///< per active cell, -1 = none
};

/// The feature that a loop passes, kNone where its normals agree or noise alone bends them.
/// \param loop  its samples get normals and offsets
FeatureSample feature_of(const BrickInput& brick, TracedLoop& loop);

/// Faces at feature loops, segment by segment, by the brick that owns the cell above the face in which the segment lies. Where
/// two loops meet the segment is flipped, if that follows the feature better.
/// \param bends   where it bends it gets a vertex on that edge (bend_sample.h); the vertex has no name
/// \param report  counts flips and such vertices
void emit_feature_segments(const BrickInput& brick, FeatureLoops& features, bool bends, PatchBuilder& patch,
                           ExtractReport& report);

}  // namespace tessera
