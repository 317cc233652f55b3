/// \file picture.h
/// Shaded pictures of triangles, lines and points, streamed in batches into one image that may hold several
/// views. Forward shading at `supersample` times the size (key, fill and head light fixed to the camera),
/// then screen-space ambient occlusion (after McGuire et al., "The Alchemy Screen-Space Ambient Obscurance
/// Algorithm", 2011, with the falloff tied to each sample's distance) and the average in linear light. The
/// same batches give the same bytes on one machine.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kernels/picture/camera.h"
#include "kernels/picture/rasterizer.h"

namespace tessera {

/// 8 bit RGB, rows from the top.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
  std::uint8_t* pixel(int x, int y) {
    return rgb.data() +
           3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
  }
  [[nodiscard]] const std::uint8_t* pixel(int x, int y) const {
    return const_cast<Image*>(this)->pixel(x, y);
  }
};

/// Colours are r | g<<8 | b<<16, as points carry them.
inline constexpr std::uint32_t kClay = 0xffc8d0d6u;
inline constexpr std::uint32_t kBackFace = 0xff2f8cf0u;         // orange
inline constexpr std::uint32_t kSyntheticFace = 0xffd6a866u;    // blue
inline constexpr std::uint32_t kBorderEdge = 0xff2020e0u;       // red
inline constexpr std::uint32_t kNonManifoldEdge = 0xffe01fd8u;  // magenta
inline constexpr std::uint32_t kCrossingFace = 0xff20e820u;     // green

/// The least that lines() draws.
inline constexpr float kMinLinePixels = 0.3f;

/// What the GPU gets per corner or point. Positions relative to the scene origin.
struct PictureVertex {
  float x = 0.0f, y = 0.0f, z = 0.0f;
  std::int16_t nx = 0, ny = 0, nz = 0;  ///< unit normal times 32767
  std::int16_t has_normal = 0;          ///< 32767, or 0 where unknown
  std::uint32_t rgba = kClay;
};
static_assert(sizeof(PictureVertex) == 24);
/// A corner on a page of a texture, from 0 to 1 from its lower left.
struct PageVertex {
  PictureVertex vertex;
  float u = 0.0f, v = 0.0f;
};
static_assert(sizeof(PageVertex) == 32);
/// Sets the normal; a zero or non-finite vector means unknown.
void set_normal(PictureVertex& vertex, float x, float y, float z);

/// How faces answer to light: `kPlain` almost matt; `kGloss` as lacquer, whose highlights show what is uneven; `kLines`
/// the reflection of evenly spaced light tubes from pole to pole of a sphere around the scene, which break at a crease,
/// kink where curvature jumps and waver where it is noisy.
enum class Shade { kPlain = 0, kGloss = 1, kLines = 2 };

/// A camera and the part of the image that it fills, in pixels of the result from the top left.
struct PictureView {
  Camera camera;
  int x = 0, y = 0, width = 0, height = 0;
};

struct PictureOptions {
  int width = 1600;
  int height = 1200;
  int supersample = 3;     ///< 1..4: samples per pixel and axis
  double occlusion = 1.0;  ///< strength of ambient occlusion; 0 = off
  Shade shade = Shade::kPlain;
  /// Nothing is drawn but triangles() without edges, one normal a face, and lines(), in Shade::kPlain: by the processor alone
  /// (band_rasterizer.h), without OpenGL, in a third of the time.
  bool only_faces = false;
};

/// Rows of a view that are drawn at once, counted from its bottom.
struct PictureBand {
  std::size_t view = 0;
  int low = 0, high = 0;              ///< what becomes of the picture
  int drawn_low = 0, drawn_high = 0;  ///< with what occlusion looks at around it
};
/// The bands of all views, by options and views alone: a view of usual size is one.
[[nodiscard]] std::vector<PictureBand> picture_bands(const PictureOptions& options,
                                                     std::span<const PictureView> views);
/// What set_page() takes and keeps, the page included.
[[nodiscard]] std::uint64_t page_bytes(std::uint64_t texels);
/// Bytes of pixel memory for each band that is held at a time.
[[nodiscard]] std::uint64_t band_bytes(const PictureOptions& options, std::span<const PictureView> views);
/// A picture in the colour of the lines between views.
[[nodiscard]] Image blank_picture(const PictureOptions& options);

/// What it draws, it draws into the bands that it holds: all at once, or some and then, from the same batches, the others. Every band is
/// drawn by itself, so that the picture is the same however many are held at a time.
class Picture {
 public:
  /// \throws ResourceError when no context or no memory is to be had; UsageError when the size is out of range
  Picture(const PictureOptions& options, std::span<const PictureView> views);
  ~Picture();

  /// Holds these bands, empty, instead of those before. \pre of picture_bands() for the same options and views
  void begin(std::span<const PictureBand> bands);

  /// What is drawn from now on is given relative to `offset` from the scene origin. Zero at first.
  void set_offset(const Double3& offset);
  /// From now on faces seen from behind are left out, so that one looks through the near walls of a room. Off at first.
  void cut_backs(bool cut);
  /// Three corners per triangle, counter-clockwise seen from outside. `wire_pixels` > 0 draws the edges, that
  /// wide.
  void triangles(std::span<const PictureVertex> corners, float wire_pixels = 0.0f);
  /// What page_triangles() shows from now on, with coarser levels (page_levels.h). \param repeats  beyond 0 and 1; else its border goes on
  void set_page(Image page, bool repeats);
  /// As triangles(), in the colours of the page: bilinear between texels, where texels are finer than samples their means.
  void page_triangles(std::span<const PageVertex> corners, float wire_pixels = 0.0f);
  /// Two ends per line; drawn `pixels` wide in the ends' colour, a little in front of what they lie on. Where lines of
  /// `length` (scene units; 0 = any) are short on screen they get thinner with it, below a sample by hitting fewer: a
  /// thicket of them tints what it lies on instead of covering it.
  void lines(std::span<const PictureVertex> ends, float pixels, float length = 0.0f);
  /// Discs of `diameter` (scene units), at least `min_pixels` wide. Normals that look away are drawn in
  /// kBackFace where `mark_back`.
  void points(std::span<const PictureVertex> centres, float diameter, float min_pixels, bool mark_back);

  /// Puts the bands held into the image. \pre it has the size of the options
  void finish(Image& image);
  [[nodiscard]] const std::string& renderer() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
