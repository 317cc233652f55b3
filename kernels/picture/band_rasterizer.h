/// \file band_rasterizer.h
/// Faces and lines of one band of a picture, drawn by the processor with a depth buffer, as picture_shaders.h does it by OpenGL: plain shade,
/// one normal a face. It loads no library, takes a third of the time, and gives the same bytes on every machine.
/// Sources: Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988 (edge functions); Sutherland and Hodgman, "Reentrant Polygon
/// Clipping", 1974; occlusion as in picture.h.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/picture/picture.h"
#include "kernels/picture/screen_light.h"

namespace tessera {

class BandRasterizer {
 public:
  /// Empty. \param samples  a pixel and axis
  BandRasterizer(const PictureView& view, const PictureBand& band, int samples);
  /// Empty again, of another band, in the same memory where that is enough.
  void begin(const PictureView& view, const PictureBand& band);

  /// Three corners per face, counter-clockwise seen from outside, relative to `offset` from the scene origin; the normal is that of the
  /// first corner. \param cut_backs  leaves out what is seen from behind; else it is kBackFace
  void triangles(std::span<const PictureVertex> corners, const Double3& offset, bool cut_backs);
  /// As Picture::lines().
  void lines(std::span<const PictureVertex> ends, const Double3& offset, float pixels, float length);
  /// Puts the band's rows into their places. \param strength  of ambient occlusion, 0 = off
  void finish(double strength, double occlusion_share, Image& image);

  /// Upper bound of what one of so many pixels holds.
  [[nodiscard]] static std::uint64_t bytes(int width, int rows, int samples);

 private:
  struct Corner {
    Float3 at;      ///< eye coordinates: x right, y up, z towards the viewer
    Float3 albedo;  ///< linear light
  };
  struct Spot {
    std::int64_t x = 0, y = 0;  ///< in parts of a sample, from the band's lower left
    float nearness = 0.0f;      ///< grows towards the viewer, and is linear on the screen
  };
  /// What all fragments of a face share.
  struct Look {
    Float3 normal{};
    bool is_lit = true;  ///< lines are not
    bool cut_backs = false;
  };

  void set_eye(const Double3& offset);
  Float3 to_eye(const PictureVertex& v) const;
  bool in_sight(const Float3& p) const;
  Spot spot(const Float3& p) const;
  Float3 view_at(double x, double y) const;
  void face(const std::array<Corner, 3>& corners, const Look& look);
  void clipped(const std::array<Corner, 3>& corners, const Look& look);
  void fill(const std::array<Corner, 3>& corners, const std::array<Spot, 3>& spots, const Look& look);
  void put(std::size_t sample, int x, int y, float nearness, std::uint32_t rgba, const Float3& normal);

  PictureView view_;
  PictureBand band_;
  int samples_, width_ = 0, rows_ = 0;  ///< of the band: samples a side of a pixel; pixels
  std::array<float, 12> eye_{};
  // By sample: rows from below.
  std::vector<float> nearness_;
  std::vector<std::uint32_t> rgba_;
  ScreenLight light_;
};

}  // namespace tessera
