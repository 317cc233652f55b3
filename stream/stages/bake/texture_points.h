/// \file texture_points.h
/// Coloured points by cells of space, in an order that depends on the points alone.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "octree/lattice.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Cells: cubes around a mesh.
struct TextureCells {
  Double3 low{};
  double edge = 1.0;
  std::uint64_t points = 0;      ///< kept, with colours
  std::uint64_t normals = 0;     ///< whether points have any
  std::uint64_t directions = 0;  ///< kept besides, without colours

  /// Around the bricks of a mesh. \param share  of a brick's edge
  static TextureCells around(const MeshStore& mesh, double share);
  Int3 cell_of(const Double3& p) const;
};

/// In the colour of a point: it tells a direction alone.
inline constexpr std::uint32_t kNoPointColour = 0x01000000u;

/// Points of some cells.
struct TexturePointBlock {
  std::vector<Float3> position;  ///< from the origin asked for
  std::vector<std::uint32_t> rgba;
  std::vector<std::uint32_t> normal;  ///< packed (point_colours.h), empty if none is known

  /// Takes those without colours out, both in their order.
  TexturePointBlock take_directions();
};

/// Hands out points in the frame of the mesh. \param rgba  or kNoPointColour \param normal  zero where unknown
using TexturePointSink = std::function<void(const Double3& p, std::uint32_t rgba, const Double3& normal)>;

/// How points are dealt to cells, and which are kept.
struct TexturePointCells {
  double share = 0.125;   ///< TextureCells::around
  bool near_only = true;  ///< those near to patches; else those around the whole mesh
};

/// Hands out all points; advances by about so many steps.
using TexturePointGiver = std::function<void(TaskContext& context, const TexturePointSink& sink)>;

/// Steps of who gives, and units of the stage that reading and sorting are together.
struct TexturePointProgress {
  TaskContext& context;
  std::uint64_t steps;
  std::uint64_t units;
};

/// Writes the points that lie near to patches of the mesh, sorted by cell, position and colour.
/// \param sort_bytes  memory of the sort
/// \returns bytes written
/// \throws StoppedError, and what `give` throws
std::uint64_t write_texture_points(const std::filesystem::path& path, const MeshStore& mesh,
                                   const std::filesystem::path& temp, std::uint64_t sort_bytes, bool normals,
                                   const TexturePointProgress& progress, const TexturePointGiver& give,
                                   std::uint64_t& given, std::uint64_t& kept,
                                   const TexturePointCells& wanted = {});

/// Reads them. Holds the table, 40 bytes a cell. Thread-safe.
class TexturePoints {
 public:
  explicit TexturePoints(const std::filesystem::path& path);
  ~TexturePoints();
  const TextureCells& cells() const { return cells_; }
  /// Of the cells that meet the box.
  std::uint64_t count(const MeshBox& box) const;
  TexturePointBlock load(const MeshBox& box, const Double3& origin) const;
  /// All cells, in their order; positions from the low corner of the cell.
  void for_each_cell(
      const std::function<void(const Double3& low, const TexturePointBlock& points)>& use) const;
  std::uint64_t largest_cell() const;  ///< points
  static constexpr std::uint64_t bytes_per_point() { return 12 + 4 + 4 + 20; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  TextureCells cells_;
};

}  // namespace tessera
