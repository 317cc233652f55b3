/// \file surface_model.h
/// The digital surface model of a scan seen from above: what every column of the lattice shows first, regularised by its
/// neighbours with steps kept, and the samples of it that stand in for points that lie on no surface of their own: crowns,
/// noise of dense matching. Heights are integers (quanta along up), and a column depends on nothing farther away than
/// kSurfaceModelHalo: the same on every machine and for every cut. Sources: P. Perona, J. Malik, "Scale-Space and Edge
/// Detection Using Anisotropic Diffusion", 1990 (the steps that keep edges); ALGORITHMS section 13.
#pragma once
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Height of a column that shows nothing.
inline constexpr std::int32_t kNoHeight = std::numeric_limits<std::int32_t>::min();
/// Measured points that lie level are not on what stands from so far below it on, quanta: ground below low crowns.
inline constexpr std::int32_t kLevelReach = 6 * kQuantaPerCell;
/// Columns beyond its rim that the model of a raster depends on.
inline constexpr int kSurfaceModelHalo = kBrickCells;
/// Points of a column of kModelThin are on what is thin from so far above its height on, quanta.
inline constexpr std::int32_t kThinRise = 2 * kQuantaPerCell;

/// A point of a brick column.
struct ColumnPoint {
  std::uint16_t column = 0;  ///< v * kBrickCells + u inside the brick column
  bool volumetric = false;
  bool steep = false;                      ///< on a surface that stands steep
  std::int8_t normal_u = 0, normal_v = 0;  ///< of steep points: their normal across up, 127 = 1
  std::int32_t height = 0;                 ///< quanta along up
  std::uint32_t rgba = 0;
};

/// A layer of the points of a column.
struct PointLayer {
  std::int32_t height = kNoHeight;  ///< median
  std::uint16_t points = 0;
  std::uint16_t volumetric = 0;  ///< of these
  std::uint32_t rgba = 0;        ///< mean of the coloured ones
};

/// What a column shows from above, and what lies lowest in it; of the ground alone, the terrain.
struct ColumnLayers {
  PointLayer top, bottom;
  std::int32_t wall_low = 0, wall_high = 0;  ///< where steep surfaces were measured; equal where none
  std::int8_t wall_u = 0, wall_v = 0;        ///< their mean normal across up, 127 = 1
  std::int32_t terrain =
      kNoHeight;  ///< below layers of the ground and synthetic ones: what follow_measured() measures from
  std::uint16_t between = 0;  ///< points below the top layer and above the bottom one
  bool synthetic = false;     ///< nothing was measured: its top tells where the surface should go on
  bool cleared = false;       ///< strewn points over the ground were taken out of it
};

/// The median height of points and the mean of their colours. \pre at least one; in order of height
[[nodiscard]] PointLayer layer_of(std::span<const ColumnPoint> points);

/// Of every column the highest and the lowest layer of three cells that hold at least three points of many, two of few: not
/// the highest point, so that a bird is none. \param points  in any order \param layers  kBrickCells^2, u fastest
void find_column_layers(std::span<const ColumnPoint> points, std::span<ColumnLayers> layers);

/// What a model and its samples are for.
enum class ModelUse {
  kStandIn,  ///< for points on no surface of their own; measured walls, and what lies below, are left to their points
  kSkin,     ///< all that one sees: one height per column, joined by walls, and nothing below
  kGround,   ///< a skin too, of layers of the ground alone (terrain.h): no pits in it are closed
  kCleared,  ///< as kStandIn, of layers without what is strewn over the ground (terrain.h), which is left out
};

/// Whether it is one height per column and nothing else.
[[nodiscard]] constexpr bool is_skin(ModelUse use) {
  return use == ModelUse::kSkin || use == ModelUse::kGround;
}

/// Bits of SurfaceModel::flags.
enum ModelFlag : std::uint8_t {
  kModelStands = 1,    ///< samples of the model stand in for what was measured
  kModelFilled = 2,    ///< nothing of it was measured here, but all around
  kModelStep = 4,      ///< near a step whose wall was not measured; of a skin near any
  kModelSkin = 8,      ///< the model has a height here, and is a skin
  kModelGround = 16,   ///< that is the ground's: no steep points lie on it, and all show up
  kModelThin = 32,     ///< wires hang over it, which the model leaves out
  kModelCleared = 64,  ///< the ground below what is strewn, which the model leaves out
};

/// The model over a square of columns, u fastest.
struct SurfaceModel {
  int edge = 0;
  ModelUse use = ModelUse::kStandIn;
  std::vector<std::int32_t> height;  ///< kNoHeight where there is none
  std::vector<std::int32_t> noise;   ///< mean distance of the layers from the model around here, quanta
  std::vector<std::int32_t> foot;    ///< the lowest height around, where kModelStep
  std::vector<std::uint32_t> rgba;
  std::vector<std::uint8_t> flags;
  std::vector<std::int32_t>
      ground;  ///< below what stands, where points called strewn lie on a smooth bottom; kNoHeight elsewhere
  std::vector<std::uint32_t> ground_rgba;
  std::vector<std::int32_t> wall_low, wall_high;  ///< ColumnLayers
  std::vector<std::int8_t> wall_u, wall_v;

  [[nodiscard]] std::size_t at(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(edge) + static_cast<std::size_t>(u);
  }
  /// Measured points of a column that stands lie on what the samples stand for from so far below its height on, quanta.
  /// Of a skin: points so near its height lie on it; more where it is steep. \pre not on the rim
  [[nodiscard]] std::int32_t reach(std::size_t column) const;
};

/// Wires are left out: they are thinner than a column and would become roofs as wide as their distance. A column is below one
/// where the scan shows a layer high above the ground around and the ground through it, nothing in between, in a line of columns
/// that is nowhere seven wide.
/// \param layers  edge^2, u fastest; the rim of kSurfaceModelHalo columns is context
[[nodiscard]] SurfaceModel fit_surface_model(std::span<const ColumnLayers> layers, int edge,
                                             ModelUse use = ModelUse::kStandIn);

/// A sample of a model. Position in quanta from the corner of column (0, 0), height along up.
struct ModelSample {
  std::int32_t u = 0, v = 0, height = 0;
  Float3 normal = {};  ///< along u, v, up; unit
  std::uint32_t rgba = 0;
  bool step = false;    ///< of the wall between two columns of different height
  bool unseen = false;  ///< of a wall of three cells and more, or where nothing was measured
};

/// One sample on every column that stands and one on its ground, and a line of them, a cell apart, down every step to a
/// neighbour whose wall was not measured; of a skin down every step, and none on the ground. Calls use for those that lie over
/// columns [first, last)^2. \pre kSurfaceModelHalo <= first, last <= edge - kSurfaceModelHalo
void sample_surface_model(const SurfaceModel& model, int first, int last,
                          const std::function<void(const ModelSample&)>& use);

}  // namespace tessera
