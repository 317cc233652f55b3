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
  /// Of a view of width x height pixels the `rows` from row `first` on, counted from below; nothing is there yet.
  /// \param middle  of a pixel, where its distance and normal are from: a share of its width from its left and lower side
  ScreenLight(const Camera& camera, int width, int height, int first, int rows, double middle);

  /// Eye coordinates. \param x, y  pixel of the band
  void set_normal(int x, int y, const Float3& unit) {
    const std::size_t at = index(x, y);
    nx_[at] = unit[0], ny_[at] = unit[1], nz_[at] = unit[2];
  }
  /// Along the view. \pre below the far plane
  void set_distance(int x, int y, float distance) { distance_[index(x, y)] = distance; }

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
  void pad();

  Camera camera_;
  int width_, height_, first_, rows_;
  double middle_;
  std::size_t stride_;
  std::vector<float> distance_, nx_, ny_, nz_, open_;
};

}  // namespace tessera
