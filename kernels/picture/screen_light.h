/// \file screen_light.h
/// What of the light comes to the pixels of a band: ambient occlusion and creases, from distances and normals of the samples in their
/// middles, as the passes over the screen of picture_shaders.h tell it, by the processor and with the same bytes on every machine.
/// Source: McGuire et al., "The Alchemy Screen-Space Ambient Obscurance Algorithm", 2011.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/picture/camera.h"
#include "octree/lattice.h"

namespace tessera {

class ScreenLight {
 public:
  /// Of nothing, until begin().
  ScreenLight() = default;
  /// Of a view of width x height pixels the `rows` from row `first` on, counted from below; nothing is there yet.
  /// \param middle  of a pixel, where its distance and normal are from: a share of its width from its left and lower side
  ScreenLight(const Camera& camera, int width, int height, int first, int rows, double middle) {
    begin(camera, width, height, first, rows, middle);
  }
  /// The same in the memory that it has, where that is enough.
  void begin(const Camera& camera, int width, int height, int first, int rows, double middle);

  /// Eye coordinates. \param x, y  pixel of the band
  void set_normal(int x, int y, const Float3& unit) {
    const std::size_t at = index(x, y);
    plane(kX)[at] = unit[0], plane(kY)[at] = unit[1], plane(kZ)[at] = unit[2];
  }
  /// Along the view. \pre below the far plane
  void set_distance(int x, int y, float distance) { plane(kDistance)[index(x, y)] = distance; }

  /// Once all is set. \param strength  of occlusion, 0 = none \param radius  that it looks around, scene units
  void find_occlusion(double strength, double radius);
  /// Shares of the light of a row: occlusion averaged over its pattern where distances differ by less than near_size, less at creases.
  /// \pre find_occlusion() \param light  row_size() long
  void shares(int row, double near_size, std::span<float> light) const;
  [[nodiscard]] std::size_t row_size() const { return stride_; }
  [[nodiscard]] static std::uint64_t bytes(int width, int rows);

 private:
  static constexpr int kPad = 8;  ///< pixels: a vector of them may begin or end beyond the band
  static std::size_t stride_of(int width) { return (static_cast<std::size_t>(width) + 2 * kPad + 7) / 8 * 8; }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y + kPad) * stride_ + static_cast<std::size_t>(x + kPad);
  }
  enum Plane : std::size_t { kDistance, kOpen, kX, kY, kZ, kPlanes };
  float* plane(Plane p) { return planes_.data() + p * plane_size_; }
  const float* plane(Plane p) const { return planes_.data() + p * plane_size_; }
  void pad();

  Camera camera_;
  int width_ = 0, height_ = 0, first_ = 0, rows_ = 0;
  double middle_ = 0.0;
  std::size_t stride_ = 0, plane_size_ = 0;
  std::vector<float> planes_;  ///< one after the other in one block, which is large enough for large pages
};

}  // namespace tessera
