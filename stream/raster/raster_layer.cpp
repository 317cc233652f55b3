#include "stream/raster/raster_layer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "kernels/survey/relief.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

constexpr std::uint32_t kOutside = 255, kHole = 1;

Json statistics_json(double minimum, double maximum, double mean, double deviation) {
  return {{"minimum", minimum}, {"maximum", maximum}, {"mean", mean}, {"deviation", deviation}};
}

/// Of the layers of heights.
template <class Cell>
float height_value(RasterLayer layer, const Cell& cell) {
  if (layer == RasterLayer::kTop) return static_cast<float>(cell.top);
  if (layer == RasterLayer::kGround) return static_cast<float>(cell.ground);
  return static_cast<float>(cell.top - cell.ground);
}

}  // namespace

const std::vector<std::string>& raster_layer_names() {
  static const std::vector<std::string> names = {"top",   "ground",  "height", "slope",    "hillshade",
                                                 "ortho", "missing", "count",  "intensity"};
  return names;
}

RasterLayer raster_layer(const std::string& name) {
  const auto& names = raster_layer_names();
  return static_cast<RasterLayer>(std::find(names.begin(), names.end(), name) - names.begin());
}

const std::string& name_of(RasterLayer layer) {
  return raster_layer_names()[static_cast<std::size_t>(layer)];
}

bool is_point_layer(RasterLayer layer) {
  return layer != RasterLayer::kSlope && layer != RasterLayer::kHillshade;
}

bool is_mesh_layer(RasterLayer layer) {
  return layer <= RasterLayer::kMissing;
}

LayerValues::LayerValues(RasterLayer layer, const LayerSettings& settings)
    : layer_(layer),
      settings_(settings),
      minimum_(std::numeric_limits<double>::max()),
      maximum_(-std::numeric_limits<double>::max()) {
  const bool heights = layer == RasterLayer::kTop || layer == RasterLayer::kGround;
  if (heights) middle_ = settings.low + 0.5 * (settings.high - settings.low);
  constexpr double kMaxIntensity = 65535.0;
  const double largest = layer == RasterLayer::kSlope       ? 90.0
                         : layer == RasterLayer::kIntensity ? kMaxIntensity
                         : layer == RasterLayer::kCount     ? settings.points
                                                            : settings.high - settings.low;
  // Heights of floats may lie an ulp beyond the mesh.
  const double bound = 1.0 + largest + std::max(std::abs(settings.low), std::abs(settings.high)) * 1e-6;
  sum_ = FixedSum(bound), squares_ = FixedSum(bound * bound);
}

bool LayerValues::has_value(const ScanCell& cell) const {
  switch (layer_) {
    case RasterLayer::kGround:
    case RasterLayer::kHeight:
      return cell.has_ground();
    case RasterLayer::kIntensity:
      return cell.measured > 0;
    default:
      return cell.covered();
  }
}

float LayerValues::float_value(const ScanCell& cell) const {
  if (layer_ == RasterLayer::kIntensity) return static_cast<float>(cell.intensity());
  return height_value(layer_, cell);
}

std::uint32_t LayerValues::count_of(const ScanCell& cell) const {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(cell.count, std::numeric_limits<std::uint32_t>::max()));
}

std::uint32_t LayerValues::byte_values(const ScanCell& cell, bool inside) const {
  if (layer_ == RasterLayer::kMissing) return cell.covered() ? 0 : inside ? kHole : kOutside;
  return cell.rgba();
}

float LayerValues::float_value(const RasterCell& cell) const {
  if (layer_ == RasterLayer::kSlope)
    return static_cast<float>(slope_degrees(cell.gradient_x, cell.gradient_y));
  return height_value(layer_, cell);
}

std::uint32_t LayerValues::byte_values(const RasterCell& cell, bool inside) const {
  if (layer_ == RasterLayer::kMissing) return cell.covered() ? 0 : inside ? kHole : kOutside;
  if (!cell.covered()) return 0;
  return layer_ == RasterLayer::kOrtho ? cell.rgba
                                       : hillshade(cell.gradient_x, cell.gradient_y, settings_.sun);
}

void LayerValues::add(double value) {
  ++count_;
  minimum_ = std::min(minimum_, value), maximum_ = std::max(maximum_, value);
  const double off = value - middle_;
  sum_.add(off), squares_.add(off * off);
}

void LayerValues::put(std::span<const RasterCell> cells, std::span<const std::uint8_t> inside, char* to) {
  put_cells(cells, inside, to);
}
void LayerValues::put(std::span<const ScanCell> cells, std::span<const std::uint8_t> inside, char* to) {
  put_cells(cells, inside, to);
}

template <class Cell>
void LayerValues::put_cells(std::span<const Cell> cells, std::span<const std::uint8_t> inside, char* to) {
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (is_float()) {
      float value = settings_.nodata;
      if (has_value(cells[k])) {
        value = float_value(cells[k]);
        if (value == settings_.nodata)
          throw UsageError("--layer " + name_of(layer_) + ": a cell has the very value " +
                           number_text(value) + " that stands for no data; choose another with --nodata");
        add(static_cast<double>(value));
      }
      std::memcpy(to, &value, sizeof value);
      to += sizeof value;
      continue;
    }
    if (layer_ == RasterLayer::kCount) {
      const std::uint32_t value = count_of(cells[k]);
      std::memcpy(to, &value, sizeof value);
      to += sizeof value;
      if (value > 0) add(static_cast<double>(value));
      continue;
    }
    const std::uint32_t value = byte_values(cells[k], inside[k] != 0);
    if (layer_ == RasterLayer::kOrtho) {
      std::memcpy(to, &value, sizeof value);
      to += sizeof value;
      if (value >> 24 == 0) continue;
      for (std::size_t band = 0; band < 4; ++band) ++histogram_[band][value >> (8 * band) & 0xff];
    } else {
      *to++ = static_cast<char>(value);
      if (value == (layer_ == RasterLayer::kMissing ? kOutside : 0u)) continue;
      ++histogram_[0][value];
    }
    ++count_;
  }
}

void LayerValues::merge(const LayerValues& other) {
  count_ += other.count_;
  minimum_ = std::min(minimum_, other.minimum_), maximum_ = std::max(maximum_, other.maximum_);
  sum_.add(other.sum_), squares_.add(other.squares_);
  for (std::size_t band = 0; band < histogram_.size(); ++band)
    for (std::size_t v = 0; v < histogram_[band].size(); ++v)
      histogram_[band][v] += other.histogram_[band][v];
}

Json LayerValues::statistics_of_bytes(std::size_t band) const {
  const auto& h = histogram_[band];
  std::uint64_t sum = 0, squares = 0;
  std::size_t minimum = h.size(), maximum = 0;
  for (std::size_t v = 0; v < h.size(); ++v) {
    if (h[v] == 0) continue;
    minimum = std::min(minimum, v), maximum = v;
    sum += v * h[v], squares += v * v * h[v];
  }
  const auto n = static_cast<double>(count_);
  const double mean = static_cast<double>(sum) / n;
  return statistics_json(static_cast<double>(minimum), static_cast<double>(maximum), mean,
                         std::sqrt(std::max(0.0, static_cast<double>(squares) / n - mean * mean)));
}

Json LayerValues::description() const {
  static const std::array<const char*, 9> kQuantities = {"height", "height", "height", "angle",    "light",
                                                         "colour", "mask",   "count",  "intensity"};
  const bool ortho = layer_ == RasterLayer::kOrtho, counts = layer_ == RasterLayer::kCount;
  Json out = {{"layer", name_of(layer_)},
              {"quantity", kQuantities[static_cast<std::size_t>(layer_)]},
              {"type", is_float() ? "float"
                       : counts   ? "count"
                                  : "byte"},
              {"bands", ortho ? 4 : 1},
              // Of a mask the middle of ones and zeros says nothing.
              {"overviews", layer_ == RasterLayer::kMissing ? "NEAREST" : "AVERAGE"}};
  if (is_float()) out["nodata"] = static_cast<double>(settings_.nodata);
  if (layer_ == RasterLayer::kHillshade || counts) out["nodata"] = 0;
  if (layer_ == RasterLayer::kMissing) out["nodata"] = kOutside;
  out["statistics"] = Json::array();
  if (count_ == 0) return out;
  if (is_float() || counts) {
    const auto n = static_cast<double>(count_);
    const double mean = sum_.value() / n;
    out["statistics"].push_back(statistics_json(
        minimum_, maximum_, middle_ + mean, std::sqrt(std::max(0.0, squares_.value() / n - mean * mean))));
    return out;
  }
  for (std::size_t band = 0; band < (ortho ? 4u : 1u); ++band)
    out["statistics"].push_back(statistics_of_bytes(band));
  return out;
}

}  // namespace tessera
