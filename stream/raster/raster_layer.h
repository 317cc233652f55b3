/// \file raster_layer.h
/// The layers that a mesh or a scan seen from above can be written as: values of cells as bytes, and their statistics.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "kernels/survey/plan_raster.h"
#include "kernels/survey/point_raster.h"
#include "stream/check/fixed_sum.h"
#include "stream/files/json.h"

namespace tessera {

enum class RasterLayer {
  kTop,        ///< height of the highest face or point, 32 bit floats
  kGround,     ///< of the lowest face; of the lowest point of the ground
  kHeight,     ///< the difference of both
  kSlope,      ///< of the highest face, degrees, 32 bit floats
  kHillshade,  ///< light on the highest face, 8 bits
  kOrtho,      ///< colour of the highest face or the surface seen, 4 x 8 bits; alpha 0 = none
  kMissing,    ///< 8 bits: 1 where a hole is, 0 where none is, 255 outside of the box of mesh or points
  kCount,      ///< points, 32 bits without sign; 0 = none
  kIntensity   ///< of the surface seen, 32 bit floats
};

/// "top", ...; in the order of the enum.
const std::vector<std::string>& raster_layer_names();
/// \pre one of these names
RasterLayer raster_layer(const std::string& name);
const std::string& name_of(RasterLayer layer);
/// Whether a scan has it: slopes and shading need faces. Whether a mesh has it: it has no points to count.
bool is_point_layer(RasterLayer layer);
bool is_mesh_layer(RasterLayer layer);

struct LayerSettings {
  Double3 sun = {0, 0, 1};
  float nodata = -9999.0F;       ///< of layers of floats
  double low = 0.0, high = 0.0;  ///< heights of mesh or points
  double points = 0.0;           ///< of all cells
};

/// Turns cells into values of one layer.
class LayerValues {
 public:
  LayerValues(RasterLayer layer, const LayerSettings& settings);
  std::size_t bytes_per_cell() const {
    return layer_ == RasterLayer::kHillshade || layer_ == RasterLayer::kMissing ? 1 : 4;
  }
  bool is_float() const { return layer_ <= RasterLayer::kSlope || layer_ == RasterLayer::kIntensity; }

  /// \param inside  per cell: its centre lies in the outline box of the mesh, or of the points
  /// \param to      bytes_per_cell() for each cell
  /// \throws UsageError when a value is the one that stands for no data
  void put(std::span<const RasterCell> cells, std::span<const std::uint8_t> inside, char* to);
  /// \pre the layer is one that points have (is_point_layer())
  void put(std::span<const ScanCell> cells, std::span<const std::uint8_t> inside, char* to);
  /// Adds the statistics of another one of this layer. The order makes no difference.
  void merge(const LayerValues& other);

  /// Bands, types, value for no data, statistics and the rule for overviews, as tools/survey/gdal_export.cpp reads them.
  Json description() const;
  std::uint64_t count() const { return count_; }  ///< cells with a value

 private:
  template <class Cell>
  void put_cells(std::span<const Cell> cells, std::span<const std::uint8_t> inside, char* to);
  bool has_value(const RasterCell& cell) const { return cell.covered(); }
  bool has_value(const ScanCell& cell) const;
  float float_value(const RasterCell& cell) const;
  float float_value(const ScanCell& cell) const;
  std::uint32_t byte_values(const RasterCell& cell, bool inside) const;
  std::uint32_t byte_values(const ScanCell& cell, bool inside) const;
  std::uint32_t count_of(const ScanCell& cell) const;
  std::uint32_t count_of(const RasterCell&) const { return 0; }
  void add(double value);
  Json statistics_of_bytes(std::size_t band) const;

  RasterLayer layer_;
  LayerSettings settings_;
  std::uint64_t count_ = 0;
  double minimum_, maximum_;
  FixedSum sum_, squares_;  ///< of values less the middle
  double middle_ = 0.0;
  std::array<std::array<std::uint64_t, 256>, 4> histogram_{};
};

}  // namespace tessera
