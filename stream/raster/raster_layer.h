/// \file raster_layer.h
/// The layers that a mesh seen from above can be written as: values of cells as bytes, and their statistics.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "kernels/survey/plan_raster.h"
#include "stream/check/fixed_sum.h"
#include "stream/files/json.h"

namespace tessera {

enum class RasterLayer {
  kTop,        ///< height of the highest face, 32 bit floats
  kGround,     ///< of the lowest
  kHeight,     ///< the difference of both
  kSlope,      ///< of the highest face, degrees, 32 bit floats
  kHillshade,  ///< light on the highest face, 8 bits
  kOrtho,      ///< colour of the highest face, 4 x 8 bits; alpha 0 = none
  kMissing     ///< 8 bits: 1 where the mesh has a hole, 0 where it has not, 255 outside of its box
};

/// "top", ...; in the order of the enum.
const std::vector<std::string>& raster_layer_names();
/// \pre one of these names
RasterLayer raster_layer(const std::string& name);
const std::string& name_of(RasterLayer layer);

struct LayerSettings {
  Double3 sun = {0, 0, 1};
  float nodata = -9999.0F;       ///< of layers of floats
  double low = 0.0, high = 0.0;  ///< heights of the mesh
};

/// Turns cells into values of one layer.
class LayerValues {
 public:
  LayerValues(RasterLayer layer, const LayerSettings& settings);
  std::size_t bytes_per_cell() const { return layer_ == RasterLayer::kOrtho || is_float() ? 4 : 1; }
  bool is_float() const { return layer_ <= RasterLayer::kSlope; }

  /// \param inside  per cell: its centre lies in the outline box of the mesh
  /// \param to      bytes_per_cell() for each cell
  /// \throws UsageError when a value is the one that stands for no data
  void put(std::span<const RasterCell> cells, std::span<const std::uint8_t> inside, char* to);
  /// Adds the statistics of another one of this layer. The order makes no difference.
  void merge(const LayerValues& other);

  /// Bands, types, value for no data, statistics and the rule for overviews, as tools/survey/gdal_export.cpp reads them.
  Json description() const;
  std::uint64_t count() const { return count_; }  ///< cells with a value

 private:
  float float_value(const RasterCell& cell) const;
  std::uint32_t byte_values(const RasterCell& cell, bool inside) const;
  void add(float value);
  Json statistics_of_bytes(std::size_t band) const;

  RasterLayer layer_;
  LayerSettings settings_;
  std::uint64_t count_ = 0;
  float minimum_, maximum_;
  FixedSum sum_, squares_;  ///< of values less the middle
  double middle_ = 0.0;
  std::array<std::array<std::uint64_t, 256>, 4> histogram_{};
};

}  // namespace tessera
