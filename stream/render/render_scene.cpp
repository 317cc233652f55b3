#include "stream/render/render_scene.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {
namespace {

constexpr double kTrim = 0.002;  // share of points per side and axis that may be strays
constexpr double kStray = 3.0;   // they are, when the whole is this many times the bulk

}  // namespace

void SceneSample::add(const Double3& p) {
  if (count_ == 0) low_ = high_ = p;
  for (std::size_t i = 0; i < 3; ++i) {
    low_[i] = std::min(low_[i], p[i]);
    high_[i] = std::max(high_[i], p[i]);
  }
  if (count_++ % stride_ != 0) return;
  if (points_.size() == kMax) {
    for (std::size_t i = 0; i < kMax / 2; ++i) points_[i] = points_[2 * i];
    points_.resize(kMax / 2);
    stride_ *= 2;
    if ((count_ - 1) % stride_ != 0) return;
  }
  points_.push_back(p);
}

void SceneSample::merge(const SceneSample& other) {
  if (other.empty()) return;
  if (empty()) {
    low_ = other.low_;
    high_ = other.high_;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    low_[i] = std::min(low_[i], other.low_[i]);
    high_[i] = std::max(high_[i], other.high_[i]);
  }
  count_ += other.count_;
  points_.insert(points_.end(), other.points_.begin(), other.points_.end());
}

SceneBox scene_box(const SceneSample& sample, bool may_trim) {
  SceneBox box{sample.low(), sample.high(), false};
  if (!may_trim || sample.points().size() < 1000) return box;
  SceneBox bulk = box;
  std::vector<double> values(sample.points().size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = sample.points()[i][axis];
    const auto skip = static_cast<std::ptrdiff_t>(kTrim * static_cast<double>(values.size()));
    std::nth_element(values.begin(), values.begin() + skip, values.end());
    const double low = values[static_cast<std::size_t>(skip)];
    std::nth_element(values.begin(), values.end() - 1 - skip, values.end());
    const double high = values[values.size() - 1 - static_cast<std::size_t>(skip)];
    bulk.low[axis] = low;
    bulk.high[axis] = high;
  }
  double whole_size = 0.0, bulk_size = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    whole_size = std::max(whole_size, box.high[axis] - box.low[axis]);
    bulk_size = std::max(bulk_size, bulk.high[axis] - bulk.low[axis]);
  }
  if (!(bulk_size > 0.0) || whole_size < kStray * bulk_size) return box;
  const double margin = 0.05 * bulk_size;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] = std::max(box.low[axis], bulk.low[axis] - margin);
    box.high[axis] = std::min(box.high[axis], bulk.high[axis] + margin);
  }
  box.trimmed = true;
  return box;
}

std::uint32_t ramp_colour(double share) {
  constexpr std::array<std::array<double, 3>, 5> kStops = {
      {{52, 72, 148}, {46, 138, 160}, {112, 180, 110}, {232, 208, 96}, {226, 128, 92}}};
  const double at = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
  const double t = at - static_cast<double>(i);
  std::uint32_t rgba = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = kStops[i][c] * (1.0 - t) + kStops[i + 1][c] * t;
    rgba |= static_cast<std::uint32_t>(value + 0.5) << (8 * c);
  }
  return rgba;
}

std::uint32_t deviation_colour(double deviation, double high, bool with_sign) {
  const double size = std::abs(deviation);
  if (!(size <= high)) return 0xffc02ad0u;  // magenta: beyond the scale
  if (!with_sign) return ramp_colour(high > 0.0 ? size / high : 0.0);
  constexpr std::array<std::array<double, 3>, 3> kSides = {{{44, 92, 190}, {222, 222, 216}, {206, 60, 44}}};
  const auto& end = kSides[deviation < 0.0 ? 0 : 2];
  const double t = high > 0.0 ? size / high : 0.0;
  std::uint32_t rgba = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c)
    rgba |= static_cast<std::uint32_t>(kSides[1][c] * (1.0 - t) + end[c] * t + 0.5) << (8 * c);
  return rgba;
}

std::filesystem::path render_temp(const RenderOptions& options) {
  if (!options.temp.empty()) return options.temp;
  return options.output.has_parent_path() ? options.output.parent_path() : std::filesystem::path(".");
}

double height_share(const Double3& p, const DrawContext& context) {
  const Double3& up = context.options->up;
  double height = 0.0, low = 0.0, high = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    height += up[i] * p[i];
    low += std::min(up[i] * context.box.low[i], up[i] * context.box.high[i]);
    high += std::max(up[i] * context.box.low[i], up[i] * context.box.high[i]);
  }
  return high > low ? (height - low) / (high - low) : 0.5;
}

}  // namespace tessera
