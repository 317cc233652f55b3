/// \file import_plan.h
/// How a mesh on disk is cut: bricks by the density of its vertices, buckets of bricks for the tasks.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Hands out all vertices, with their colours if there are any, in batches, from any threads at once; any number of times.
using VertexSource =
    std::function<void(const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>&)>;

/// Cells of a grid aligned to the world's zero. \pre `edge` is a power of two
class GridCells {
 public:
  GridCells(double edge, const Double3& origin, double end)
      : inverse_(1.0 / edge), origin_(origin), end_(end) {}
  /// Morton code of the cell of a position; coordinates count from the origin and are below the end.
  std::uint64_t operator()(const Double3& p) const {
    std::array<std::uint32_t, 3> at;
    for (std::size_t a = 0; a < 3; ++a) {
      double cell = std::floor(p[a] * inverse_);  // as cell_at() of the edge: the quotient is the same
      if (cell == 0.0 && p[a] < 0.0) cell = -1.0;
      const double index = cell - origin_[a];
      at[a] = index >= 0.0 && index < end_ ? static_cast<std::uint32_t>(static_cast<std::int64_t>(index))
                                           : checked_index(index, end_);
    }
    return morton_encode(at[0], at[1], at[2]);
  }

 private:
  double inverse_;
  Double3 origin_;
  double end_;
};

/// A pure function of the set of vertices. Bricks are cubes of a power of two, aligned to the world's zero,
/// the largest that hold at most about so many vertices in the middle of the distribution.
struct ImportPlan {
  MeshStoreInfo info;
  std::uint64_t file_vertices = 0;
  std::uint64_t nonfinite_vertices = 0;
  std::optional<double> confidence;  ///< mean of the vertices, where the file tells any
  int brick_level = 0;               ///< the root cube has 2^brick_level bricks an edge
  int cell_level = 0;  ///< buckets consist of cells of this level, each of whole bricks: <= brick_level
  std::vector<std::uint64_t> first_cell;       ///< per bucket: Morton code of its first cell, ascending
  std::vector<std::uint64_t> bucket_vertices;  ///< as in the file, with duplicates

  static constexpr std::uint64_t kBrickVertices = 6000;
  static constexpr std::uint64_t kBucketVertices = 1u << 17;
  static constexpr std::size_t kMaxBuckets = 1000;
  static constexpr std::uint64_t kSurveyBytes = std::uint64_t{20} << 20;  ///< what measuring takes

  std::size_t buckets() const { return first_cell.size(); }
  /// Morton codes of the bricks of positions. \pre of these: finite, within what was measured
  GridCells bricks() const;
  std::uint64_t brick_of(const Double3& position) const { return bricks()(position); }
  std::size_t bucket_of_brick(std::uint64_t brick) const;

  /// Reads all vertices twice. \throws EmptyError when there is no finite vertex
  static ImportPlan measure(const MeshHeader& header, const VertexSource& vertices,
                            const std::function<void()>& check_stop,
                            std::uint64_t brick_vertices = kBrickVertices);
  static void fields(auto& self, auto&& field) {
    field("h", self.info.lattice.h);
    field("origin_brick", self.info.lattice.origin_brick);
    field("double_positions", self.info.double_positions);
    field("colour", self.info.colour);
    field("shift", self.info.shift);
    field("file_vertices", self.file_vertices);
    field("nonfinite_vertices", self.nonfinite_vertices);
    field("confidence", self.confidence);
    field("brick_level", self.brick_level);
    field("cell_level", self.cell_level);
    field("first_cell", self.first_cell);
    field("bucket_vertices", self.bucket_vertices);
  }
};

/// Where one mesh of a job lies.
struct ImportSource {
  std::size_t input = 0;       ///< index of JobState::inputs
  std::string folder;          ///< of the store in the work directory, "mesh": stages are named after it
  std::string work_file = {};  ///< a file of the work directory instead of an input; goes when it is imported
  std::uint64_t brick_vertices =
      ImportPlan::kBrickVertices;  ///< of a brick in the middle of the distribution

  std::filesystem::path path(const JobState& state) const {
    return work_file.empty() ? state.inputs.at(input) : state.work / work_file;
  }
};

}  // namespace tessera
