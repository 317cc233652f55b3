/// \file brick_columns.h
/// The points of a scene seen from above by brick column: what passes over columns read.
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "kernels/points/surface_model.h"
#include "stream/points/point_store.h"
#include "stream/points/top_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Cosine with up up to which a surface stands steep.
inline constexpr float kSteepCosine = 0.5f;

class BrickColumns {
 public:
  /// Of the job's ordered points; none where no surface model is wanted (point_overlay.h).
  explicit BrickColumns(const JobState& state);

  bool wanted() const { return store_ != nullptr; }
  const ViewAxes& axes() const { return axes_; }
  /// Their bricks by (u, v).
  const std::map<std::pair<int, int>, std::vector<std::size_t>>& bricks() const { return columns_; }
  /// Of the columns [u0, u1) x [v0, v1) the points of the fullest, and of the fullest brick in them.
  struct Fullest {
    std::uint64_t column = 0, brick = 0;
  };
  Fullest fullest(int u0, int u1, int v0, int v1) const;
  /// The points of a brick column but outliers, in no order; empty where there is none.
  std::vector<ColumnPoint> load(int u, int v, TaskContext& context) const;
  /// Memory of load(), without its result. \param points  of its fullest brick
  static std::uint64_t load_bytes(std::uint64_t points);
  /// Of a brick column, as the stores of columns have it.
  std::uint64_t key(int u, int v) const;

 private:
  ViewAxes axes_;
  std::unique_ptr<PointStore> store_;
  std::map<std::pair<int, int>, std::vector<std::size_t>> columns_;
};

}  // namespace tessera
