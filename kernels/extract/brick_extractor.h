/// \file brick_extractor.h
/// The mesh of one brick: the passes behind extract_surface.
#pragma once
#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "kernels/extract/border_shift.h"
#include "kernels/extract/brick_band.h"
#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/extract/feature_sample.h"
#include "kernels/extract/level_cells.h"
#include "kernels/extract/loop_triangulation.h"

namespace tessera {

/// Coordinates of a node or cell relative to the brick that owns it: there sums round as they do for the owner.
inline Float3 in_owner(const Int3& at) {
  return {static_cast<float>(at[0] & (kBrickCells - 1)), static_cast<float>(at[1] & (kBrickCells - 1)),
          static_cast<float>(at[2] & (kBrickCells - 1))};
}

/// Whether the brick owns a cell, given relative to it.
inline bool inside_brick(const Int3& cell) {
  for (int c : cell)
    if (c < 0 || c >= kBrickCells) return false;
  return true;
}

/// The colour of a vertex amid others; those without a colour (alpha 0) do not count.
class ColourMean {
 public:
  void add(std::uint32_t rgba) {
    if ((rgba >> 24) == 0) return;
    ++count_;
    for (std::size_t channel = 0; channel < 4; ++channel) sum_[channel] += rgba >> 8 * channel & 0xff;
  }
  std::uint32_t value() const {
    std::uint32_t mean = 0;
    for (std::size_t channel = 0; count_ && channel < 4; ++channel)
      mean |= (sum_[channel] + count_ / 2) / count_ << 8 * channel;
    return mean;
  }

 private:
  std::array<std::uint32_t, 4> sum_{};
  std::uint32_t count_ = 0;
};

/// Extracts brick after brick of one field; its buffers are reused.
class BrickExtractor {
 public:
  /// \param level, cells  of the bricks, and of those whose edges finer bricks split; the field is mixed then
  BrickExtractor(const DirectedField& field, const ExtractOptions& options, int level = 0,
                 const LevelCells* cells = nullptr);

  /// \param brick  within the block, each coordinate in [0, cells / 64)
  Patch extract(const Int3& brick, ExtractReport& report);

 private:
  /// A loop with a feature sample; its edges, vertices and roots lie in the pools from `first`.
  struct FeatureLoop {
    Int3 cell;            ///< relative to the brick; -1 on one axis for the halo
    std::uint8_t number;  ///< loop of the cell
    std::uint8_t size;
    /// Per axis: loops of the cell below that a flip already links to this one.
    std::uint8_t flipped[3] = {0, 0, 0};
    std::uint32_t first;
    std::uint32_t centre;  ///< vertex
    Float3 position;       ///< relative to the cell
  };

  void emit_edge_vertices();
  void fill_local_edges(const LeafMasks& m);
  void trace_leaf(const LeafMasks& m);
  void trace_cell(const LeafMasks& m, int x, int y, int z, unsigned pattern, bool at_boundary);
  void emit_plain_loop(const Int3& cell, int number, const std::uint32_t* vertex, const std::uint32_t* root,
                       unsigned boundary);
  unsigned boundary_segments(const Int3& cell) const;
  /// Border bit of a face whose first edge lies in the face of `cell`.
  unsigned ends_before(const Int3& cell) const { return names_ && !band_.takes_part(cell) ? 1u : 0u; }
  bool keep_feature_loop(const Int3& cell, int number, const std::uint32_t* vertex,
                         const std::uint32_t* root);
  void trace_level_cells(const LeafMasks& m);
  void emit_level_loop(const Int3& cell, int number, const LevelLoop& loop);
  std::uint32_t finer_vertex(const LevelPoint& point, const LevelCells::Name& name);
  /// A cell across the face of the brick that belongs to a brick of another level: each side emits its own faces.
  bool other_level(const Int3& cell) const;
  void emit_feature_segments();
  void emit_segment(FeatureLoop& loop, std::size_t s);
  bool should_flip(const FeatureLoop& above, const FeatureLoop& below, int axis, std::size_t s) const;
  FeatureLoop* feature_loop_at(const Int3& cell, int edge);
  std::uint32_t add_centre(const Int3& cell, int number, const Float3& position, VertexClass kind,
                           const std::uint32_t* root, int size);
  void add_face(std::uint32_t a, std::uint32_t b, std::uint32_t c) { patch_.faces.push_back({a, b, c}); }
  /// \param border  bits of its edges at which the surface ends
  void add_face(std::uint32_t a, std::uint32_t b, std::uint32_t c, unsigned border) {
    add_face(a, b, c);
    if (border == 0) return;
    patch_.border.resize(patch_.faces.size(), 0);
    patch_.border.back() = static_cast<std::uint8_t>(border);
  }
  void resolve_foreign();
  VertexKey key(const Int3& at, int type) const;
  Float3 point_in_cell(int edge, std::uint32_t root) const;

  const DirectedField& field_;
  ExtractMethod method_;
  bool names_;
  int level_;
  const LevelCells* levels_;
  FeatureThresholds thresholds_;
  BrickBand band_;
  BorderShift border_;
  bool at_border_ = false;   ///< vertices of the leaf at work may move
  Int3 corner_ = {0, 0, 0};  ///< global cell coordinates of the brick
  Patch patch_;
  ExtractReport* report_ = nullptr;
  std::uint32_t any_alpha_ = 0;

  /// Crossed edges of the leaf at work: axis, then 9^3 nodes.
  static constexpr std::size_t kLocalNodes = 9 * 9 * 9;
  std::array<std::uint32_t, 3 * kLocalNodes> local_vertex_;
  std::array<std::uint32_t, 3 * kLocalNodes> local_root_;
  std::vector<std::array<std::uint32_t, 2>> split_pairs_;  ///< vertices of cells A, B and of cells C, D

  LoopSamples samples_;
  LoopTriangles triangles_;
  std::vector<std::int32_t> first_feature_;  ///< per active cell: its first feature loop, -1 = none
  std::vector<FeatureLoop> features_;
  std::vector<std::uint8_t> feature_edge_;
  std::vector<std::uint32_t> feature_vertex_;
  std::vector<std::uint32_t> feature_root_;
  // Per provisional foreign slot; all but the key with names only.
  std::vector<VertexKey> foreign_key_;
  std::vector<Float3> foreign_position_;
  std::vector<std::uint32_t> foreign_rgba_;
  std::vector<VertexClass> foreign_class_;
  std::vector<std::uint8_t> foreign_finer_;  ///< where levels meet, of the first slots at least
  std::unordered_map<VertexKey, std::uint32_t> finer_slot_;
};

}  // namespace tessera
