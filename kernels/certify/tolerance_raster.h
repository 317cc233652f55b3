/// \file tolerance_raster.h
/// The largest sampled value of a tolerance volume over each of many triangles: one interface, several
/// backends that take the same samples (tolerance_volume.h): our vectorised rasterizer, and OpenGL in one
/// draw call for many triangles. A GL backend belongs to the thread of its context.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "kernels/certify/tolerance_volume.h"
#include "kernels/picture/rasterizer.h"

namespace tessera {

/// Corners in grid coordinates (ToleranceVolume::to_grid), as columns: a.x a.y a.z b.x ... c.z.
struct GridTriangles {
  std::array<std::vector<float>, 9> column;
  std::size_t size() const { return column[0].size(); }
  void add(const Float3& a, const Float3& b, const Float3& c);
  void clear();
};

class ToleranceRaster {
 public:
  virtual ~ToleranceRaster() = default;
  /// out[i] = largest value at the samples of triangle i, in units of the spacing.
  /// \pre out.size() == triangles.size(), 1 <= per_side <= 256
  virtual void largest(const GridTriangles& triangles, int per_side, std::span<float> out) = 0;
  virtual const std::string& description() const = 0;
  virtual bool hardware_filter() const = 0;  ///< for ToleranceVolume::filter_error
  virtual std::uint64_t bytes() const = 0;   ///< of the field in its precision
};

/// Eight triangles at a time, AVX2.
std::unique_ptr<ToleranceRaster> make_cpu_raster(const ToleranceVolume& volume, TexturePrecision precision);

enum class GlRaster {
  kAtlas,  ///< triangles packed into an atlas page, one fragment per sample, a second pass takes the maxima
  kFragment,  ///< one fragment per triangle that takes all samples
};
/// \param context  outlives the raster, current on this thread at every call
/// \throws ResourceError when GL has no memory for the field
std::unique_ptr<ToleranceRaster> make_gl_raster(const ToleranceVolume& volume, TexturePrecision precision,
                                                GlContext& context, GlRaster variant);

/// The way of 2004: one occlusion query per triangle, whose fragments above the threshold count. Slow; for
/// comparison.
class QueryRaster {
 public:
  QueryRaster(const ToleranceVolume& volume, TexturePrecision precision, GlContext& context);
  ~QueryRaster();
  /// out[i] = 1 when some sample of triangle i exceeds `threshold` (units of the spacing).
  void exceeds(const GridTriangles& triangles, int per_side, float threshold, std::span<std::uint8_t> out);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The field in a precision, every value rounded up: what textures hold. `scale` times the stored is the
/// value.
struct FieldTexels {
  std::vector<std::uint8_t> bytes;  ///< with 4 bytes to spare behind the last
  float scale = 1.0f;
};
FieldTexels field_texels(const ToleranceVolume& volume, TexturePrecision precision);

}  // namespace tessera
