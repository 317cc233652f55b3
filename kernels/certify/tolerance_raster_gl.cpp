// A page of the atlas is a square of cells, per_side pixels each; a triangle lies in its cell as
//
//     |\            (o', o'), (n + o', o'), (o', n + o') pixels, o' = 1/2 - 85/256: the centre of pixel (i,
//     j) | \           is then the sample ((i + o) / n, (j + o) / n), and pixel (i, j) is inside exactly when
//     |__\          i + j < n. All corners are multiples of 1/256 pixel, so no snapping moves them.
//
// The second pass takes the maximum of each cell into one pixel.
#include <algorithm>
#include <cassert>

#include "kernels/certify/tolerance_raster.h"
#include "kernels/picture/gl_functions.h"
#include "octree/error.h"

namespace tessera {
namespace {

constexpr int kPage = 1024;         // pixels a side of the atlas
constexpr int kFragmentPage = 512;  // triangles a side where each has one fragment
constexpr int kQueriesAtOnce = 1024;

constexpr const char* kHead = "#version 450 core\n";

/// Texture coordinates of a point in grid coordinates: node i at the centre of texel i.
constexpr const char* kField = R"(
uniform sampler3D field;
uniform vec3 texels;  // nodes per axis
float value_at(vec3 grid) { return texture(field, (grid + 0.5) / texels).r; }
)";

constexpr const char* kAtlasVertex = R"(
layout(location = 0) in vec3 corner;
uniform ivec2 cells;  // per row of the page; pixels per side of a cell
uniform float page;
out vec3 grid;
void main() {
  int triangle = gl_VertexID / 3, which = gl_VertexID % 3;
  float n = float(cells.y);
  vec2 at = vec2(triangle % cells.x, triangle / cells.x) * n + (0.5 - 85.0 / 256.0);
  if (which == 1) at.x += n;
  if (which == 2) at.y += n;
  grid = corner;
  gl_Position = vec4(at / page * 2.0 - 1.0, 0.0, 1.0);
}
)";
constexpr const char* kAtlasFragment = R"(
in vec3 grid;
out float value;
void main() { value = value_at(grid); }
)";
constexpr const char* kQueryFragment = R"(
in vec3 grid;
out float value;
uniform float threshold;
void main() {
  value = value_at(grid);
  if (value <= threshold) discard;
}
)";
constexpr const char* kWholeVertex = R"(
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }
)";
constexpr const char* kReduceFragment = R"(
uniform sampler2D atlas;
uniform int side;
out float value;
void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * side;
  float most = 0.0;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i + j < side; ++i) most = max(most, texelFetch(atlas, first + ivec2(i, j), 0).r);
  value = most;
}
)";
constexpr const char* kOneFragment = R"(
uniform samplerBuffer corners;
uniform ivec2 cells;  // triangles per row; samples per side
out float value;
void main() {
  int triangle = int(gl_FragCoord.y) * cells.x + int(gl_FragCoord.x);
  vec3 a = texelFetch(corners, 3 * triangle).xyz;
  vec3 u = texelFetch(corners, 3 * triangle + 1).xyz - a, v = texelFetch(corners, 3 * triangle + 2).xyz - a;
  float most = 0.0;
  float per = 1.0 / float(cells.y);
  for (int j = 0; j < cells.y; ++j)
    for (int i = 0; i + j < cells.y; ++i)
      most = max(most, value_at(a + u * ((float(i) + 85.0 / 256.0) * per) + v * ((float(j) + 85.0 / 256.0) * per)));
  value = most;
}
)";

/// What all ways of drawing share: the field as a texture, a vertex array, buffers, targets.
class FieldOnGl {
 public:
  FieldOnGl(const ToleranceVolume& volume, TexturePrecision precision, GlContext& context)
      : context_(context), gl_(context.gl()), nodes_(volume.nodes()) {
    const FieldTexels texels = field_texels(volume, precision);
    scale_ = precision == TexturePrecision::k8Bit ? texels.scale * 255.0f : texels.scale;
    bytes_ = texels.bytes.size() - 4;
    while (gl_.GetError() != GL_NO_ERROR) {
    }
    gl_.GenTextures(1, &field_);
    gl_.BindTexture(GL_TEXTURE_3D, field_);
    gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
    const bool eight = precision == TexturePrecision::k8Bit, half = precision == TexturePrecision::kHalf;
    const GLint format = eight ? GL_R8 : half ? GL_R16F : GL_R32F;
    const GLenum type = eight ? GL_UNSIGNED_BYTE : half ? GL_HALF_FLOAT : GL_FLOAT;
    gl_.TexImage3D(GL_TEXTURE_3D, 0, format, nodes_[0], nodes_[1], nodes_[2], 0, GL_RED, type,
                   texels.bytes.data());
    if (gl_.GetError() != GL_NO_ERROR)
      throw ResourceError("rasterizer: no memory for a distance field of " + std::to_string(nodes_[0]) +
                          " x " + std::to_string(nodes_[1]) + " x " + std::to_string(nodes_[2]) +
                          " texels; use a coarser one");
    gl_.TexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    gl_.TexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    for (const GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R})
      gl_.TexParameteri(GL_TEXTURE_3D, wrap, GL_CLAMP_TO_EDGE);
    gl_.GenVertexArrays(1, &array_);
    gl_.GenBuffers(1, &buffer_);
    gl_.GenFramebuffers(1, &frame_);
  }
  ~FieldOnGl() {
    gl_.DeleteTextures(1, &field_);
    gl_.DeleteVertexArrays(1, &array_);
    gl_.DeleteBuffers(1, &buffer_);
    gl_.DeleteFramebuffers(1, &frame_);
  }
  FieldOnGl(const FieldOnGl&) = delete;
  FieldOnGl& operator=(const FieldOnGl&) = delete;

  std::uint32_t program(const std::string& name, const char* vertex, const std::string& fragment) const {
    return link_gl_program(gl_, name, std::string(kHead) + vertex, kHead + fragment);
  }
  /// Uniforms and texture of a program that calls value_at.
  void use(std::uint32_t program) const {
    gl_.UseProgram(program);
    gl_.Uniform3f(gl_uniform(gl_, program, "texels"), static_cast<float>(nodes_[0]),
                  static_cast<float>(nodes_[1]), static_cast<float>(nodes_[2]));
    gl_.Uniform1i(gl_uniform(gl_, program, "field"), 0);
    gl_.ActiveTexture(GL_TEXTURE0);
    gl_.BindTexture(GL_TEXTURE_3D, field_);
  }
  void target(std::uint32_t texture, int side) const {
    gl_.BindFramebuffer(GL_FRAMEBUFFER, frame_);
    gl_.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture, 0);
    gl_.Viewport(0, 0, side, side);
  }
  /// Corners of triangles [first, first + count) one after the other, into the vertex buffer.
  void upload(const GridTriangles& triangles, std::size_t first, std::size_t count) {
    corners_.resize(9 * count);
    for (std::size_t c = 0; c < 9; ++c) {
      const float* from = triangles.column[c].data() + first;
      for (std::size_t i = 0; i < count; ++i) corners_[9 * i + c] = from[i];
    }
    gl_.BindVertexArray(array_);
    gl_.BindBuffer(GL_ARRAY_BUFFER, buffer_);
    gl_.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(corners_.size() * sizeof(float)), corners_.data(),
                   GL_STREAM_DRAW);
    gl_.EnableVertexAttribArray(0);
    gl_.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 0, nullptr);
  }

  GlContext& context_;
  const GlFunctions& gl_;
  Int3 nodes_;
  float scale_ = 1.0f;
  std::uint64_t bytes_ = 0;
  GLuint field_ = 0, array_ = 0, buffer_ = 0, frame_ = 0;
  std::vector<float> corners_;
};

class GlRasterBase : public ToleranceRaster {
 public:
  GlRasterBase(const ToleranceVolume& volume, TexturePrecision precision, GlContext& context, const char* way)
      : field_(volume, precision, context), description_(context.description() + ", " + way) {}
  const std::string& description() const override { return description_; }
  bool hardware_filter() const override { return true; }
  std::uint64_t bytes() const override { return field_.bytes_; }

 protected:
  /// The first `count` pixels of a square target, row by row.
  void read(int side, std::size_t count, float* out) {
    const GlFunctions& gl = field_.gl_;
    const int rows =
        static_cast<int>((count + static_cast<std::size_t>(side) - 1) / static_cast<std::size_t>(side));
    pixels_.resize(static_cast<std::size_t>(side) * static_cast<std::size_t>(rows));
    gl.PixelStorei(GL_PACK_ALIGNMENT, 4);
    gl.ReadPixels(0, 0, side, rows, GL_RED, GL_FLOAT, pixels_.data());
    for (std::size_t i = 0; i < count; ++i) out[i] = pixels_[i] * field_.scale_;
  }

  FieldOnGl field_;
  std::string description_;
  std::vector<float> pixels_;
};

class AtlasRaster final : public GlRasterBase {
 public:
  AtlasRaster(const ToleranceVolume& volume, TexturePrecision precision, GlContext& context)
      : GlRasterBase(volume, precision, context, "atlas"),
        draw_(field_.program("atlas", kAtlasVertex, std::string(kField) + kAtlasFragment)),
        reduce_(field_.program("reduce", kWholeVertex, kReduceFragment)),
        atlas_(create_gl_texture(field_.gl_, GL_R32F, kPage, kPage)),
        maxima_(create_gl_texture(field_.gl_, GL_R32F, kPage, kPage)) {}
  ~AtlasRaster() override {
    field_.gl_.DeleteTextures(1, &atlas_);
    field_.gl_.DeleteTextures(1, &maxima_);
    field_.gl_.DeleteProgram(draw_);
    field_.gl_.DeleteProgram(reduce_);
  }

  void largest(const GridTriangles& triangles, int per_side, std::span<float> out) override {
    assert(out.size() == triangles.size() && per_side >= 1 && per_side <= kPage / 4);
    const GlFunctions& gl = field_.gl_;
    const int columns = kPage / per_side;
    const auto per_page = static_cast<std::size_t>(columns) * static_cast<std::size_t>(columns);
    gl.Disable(GL_DEPTH_TEST);
    for (std::size_t first = 0; first < out.size(); first += per_page) {
      const std::size_t count = std::min(per_page, out.size() - first);
      field_.use(draw_);
      field_.target(atlas_, kPage);
      field_.upload(triangles, first, count);
      gl.Uniform2i(gl_uniform(gl, draw_, "cells"), columns, per_side);
      gl.Uniform1f(gl_uniform(gl, draw_, "page"), static_cast<float>(kPage));
      gl.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(3 * count));
      gl.UseProgram(reduce_);
      field_.target(maxima_, columns);
      gl.Uniform1i(gl_uniform(gl, reduce_, "atlas"), 0);
      gl.Uniform1i(gl_uniform(gl, reduce_, "side"), per_side);
      gl.BindTexture(GL_TEXTURE_2D, atlas_);
      gl.DrawArrays(GL_TRIANGLES, 0, 3);
      read(columns, count, out.data() + first);
    }
  }

 private:
  std::uint32_t draw_, reduce_;
  GLuint atlas_, maxima_;
};

class FragmentRaster final : public GlRasterBase {
 public:
  FragmentRaster(const ToleranceVolume& volume, TexturePrecision precision, GlContext& context)
      : GlRasterBase(volume, precision, context, "one fragment a triangle"),
        draw_(field_.program("one fragment", kWholeVertex, std::string(kField) + kOneFragment)),
        maxima_(create_gl_texture(field_.gl_, GL_R32F, kFragmentPage, kFragmentPage)) {
    field_.gl_.GenTextures(1, &corners_);
  }
  ~FragmentRaster() override {
    field_.gl_.DeleteTextures(1, &maxima_);
    field_.gl_.DeleteTextures(1, &corners_);
    field_.gl_.DeleteProgram(draw_);
  }

  void largest(const GridTriangles& triangles, int per_side, std::span<float> out) override {
    assert(out.size() == triangles.size() && per_side >= 1);
    const GlFunctions& gl = field_.gl_;
    constexpr std::size_t kPerPage = std::size_t{kFragmentPage} * kFragmentPage;
    gl.Disable(GL_DEPTH_TEST);
    for (std::size_t first = 0; first < out.size(); first += kPerPage) {
      const std::size_t count = std::min(kPerPage, out.size() - first);
      const int rows = static_cast<int>((count + kFragmentPage - 1) / kFragmentPage);
      field_.use(draw_);
      field_.target(maxima_, kFragmentPage);
      field_.upload(triangles, first, count);
      gl.ActiveTexture(GL_TEXTURE1);
      gl.BindTexture(GL_TEXTURE_BUFFER, corners_);
      gl.TexBuffer(GL_TEXTURE_BUFFER, GL_RGB32F, field_.buffer_);
      gl.Uniform1i(gl_uniform(gl, draw_, "corners"), 1);
      gl.Uniform2i(gl_uniform(gl, draw_, "cells"), kFragmentPage, per_side);
      gl.Enable(GL_SCISSOR_TEST);  // rows that hold no triangle cost nothing
      gl.Scissor(0, 0, kFragmentPage, rows);
      gl.DrawArrays(GL_TRIANGLES, 0, 3);
      gl.Disable(GL_SCISSOR_TEST);
      gl.ActiveTexture(GL_TEXTURE0);
      read(kFragmentPage, count, out.data() + first);
    }
  }

 private:
  std::uint32_t draw_;
  GLuint maxima_, corners_ = 0;
};

}  // namespace

struct QueryRaster::State {
  State(const ToleranceVolume& volume, TexturePrecision precision, GlContext& context)
      : field(volume, precision, context),
        draw(field.program("query", kAtlasVertex, std::string(kField) + kQueryFragment)),
        page(create_gl_texture(field.gl_, GL_R32F, kSide, kSide)),
        queries(kQueriesAtOnce) {
    field.gl_.GenQueries(kQueriesAtOnce, queries.data());
  }
  ~State() {
    field.gl_.DeleteQueries(kQueriesAtOnce, queries.data());
    field.gl_.DeleteTextures(1, &page);
    field.gl_.DeleteProgram(draw);
  }
  static constexpr int kSide = 256;  // queries are cheapest in a small target
  FieldOnGl field;
  std::uint32_t draw;
  GLuint page;
  std::vector<GLuint> queries;
};

QueryRaster::QueryRaster(const ToleranceVolume& volume, TexturePrecision precision, GlContext& context)
    : state_(std::make_unique<State>(volume, precision, context)) {}
QueryRaster::~QueryRaster() = default;

void QueryRaster::exceeds(const GridTriangles& triangles, int per_side, float threshold,
                          std::span<std::uint8_t> out) {
  assert(out.size() == triangles.size() && per_side >= 1 && per_side <= State::kSide);
  FieldOnGl& field = state_->field;
  const GlFunctions& gl = field.gl_;
  const int columns = State::kSide / per_side;
  const std::size_t at_once = std::min<std::size_t>(
      kQueriesAtOnce, static_cast<std::size_t>(columns) * static_cast<std::size_t>(columns));
  gl.Disable(GL_DEPTH_TEST);
  for (std::size_t first = 0; first < out.size(); first += at_once) {
    const std::size_t count = std::min(at_once, out.size() - first);
    field.use(state_->draw);
    field.target(state_->page, State::kSide);
    field.upload(triangles, first, count);
    gl.Uniform2i(gl_uniform(gl, state_->draw, "cells"), columns, per_side);
    gl.Uniform1f(gl_uniform(gl, state_->draw, "page"), static_cast<float>(State::kSide));
    gl.Uniform1f(gl_uniform(gl, state_->draw, "threshold"), threshold / field.scale_);
    for (std::size_t i = 0; i < count; ++i) {
      gl.BeginQuery(GL_SAMPLES_PASSED, state_->queries[i]);
      gl.DrawArrays(GL_TRIANGLES, static_cast<GLint>(3 * i), 3);
      gl.EndQuery(GL_SAMPLES_PASSED);
    }
    for (std::size_t i = 0; i < count; ++i) {
      GLuint passed = 0;
      gl.GetQueryObjectuiv(state_->queries[i], GL_QUERY_RESULT, &passed);
      out[first + i] = passed > 0;
    }
  }
}

std::unique_ptr<ToleranceRaster> make_gl_raster(const ToleranceVolume& volume, TexturePrecision precision,
                                                GlContext& context, GlRaster variant) {
  if (variant == GlRaster::kAtlas) return std::make_unique<AtlasRaster>(volume, precision, context);
  return std::make_unique<FragmentRaster>(volume, precision, context);
}

}  // namespace tessera
