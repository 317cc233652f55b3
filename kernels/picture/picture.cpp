#include "kernels/picture/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "kernels/picture/band_rasterizer.h"
#include "kernels/picture/gl_functions.h"
#include "kernels/picture/page_levels.h"
#include "kernels/picture/picture_shaders.h"
#include "octree/error.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr float kUnitNormal = 32767.0f;
constexpr double kMaxPointSize = 200.0;   // samples (picture_shaders.h)
constexpr double kRounding = 2.0;         // pixels, of floats on the way to the screen
constexpr double kOcclusionShare = 0.07;  // of a view's half width, where no radius is given
constexpr double kMaxRadius = 0.3;        // of a view's height: as far as occlusion looks in perspective
/// A view of 800 x 600 with three samples a side is a band.
constexpr std::uint64_t kBandSamples = 4'500'000;

/// Texture units of the screen passes.
enum Unit : int { kColours = 0, kDepths = 1, kFacings = 2, kOcclusions = 3, kPage = 4 };

std::string with_light(const char* source) {
  std::string text = source;
  const std::string mark = "%LIGHT%";
  return text.replace(text.find(mark), mark.size(), shaders::kLight);
}

std::string with_page(const char* source) {
  std::string text = source;
  return text.insert(text.find('\n') + 1, "#define PAGE\n");
}

const PictureVertex& vertex_of(const PictureVertex& v) {
  return v;
}
const PictureVertex& vertex_of(const PageVertex& v) {
  return v.vertex;
}

float channel(std::uint32_t rgba, int i) {
  return static_cast<float>((rgba >> (8 * i)) & 0xffu) / 255.0f;
}

/// Pixels around a band whose depths and occlusions the passes over the screen look at (picture_shaders.h): as far as taps of occlusion
/// reach, and four for the blur, the crease and what is rounded.
int band_margin(const PictureView& view) {
  const double maximum = kMaxRadius * view.height;
  const double radius =
      view.camera.orthographic ? std::min(0.5 * kOcclusionShare * view.width, maximum) : maximum;
  return static_cast<int>(std::ceil(std::max(radius, 4.0))) + 4;
}

/// Width and rows that any of the bands fits into, pixels.
std::array<int, 2> slot_size(std::span<const PictureView> views, std::span<const PictureBand> bands) {
  std::array<int, 2> size = {0, 0};
  for (const PictureBand& band : bands) {
    size[0] = std::max(size[0], views[band.view].width);
    size[1] = std::max(size[1], band.drawn_high - band.drawn_low);
  }
  return size;
}

}  // namespace

void set_normal(PictureVertex& vertex, float x, float y, float z) {
  const float square = x * x + y * y + z * z;
  vertex.nx = vertex.ny = vertex.nz = vertex.has_normal = 0;
  if (!(square > 0.0f) || !std::isfinite(square)) return;
  const float scale = kUnitNormal / std::sqrt(square);
  vertex.nx = static_cast<std::int16_t>(x * scale);
  vertex.ny = static_cast<std::int16_t>(y * scale);
  vertex.nz = static_cast<std::int16_t>(z * scale);
  vertex.has_normal = static_cast<std::int16_t>(kUnitNormal);
}

std::vector<PictureBand> picture_bands(const PictureOptions& options, std::span<const PictureView> views) {
  std::vector<PictureBand> bands;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const PictureView& view = views[v];
    const int margin = band_margin(view);
    const auto row = static_cast<std::uint64_t>(view.width) *
                     static_cast<std::uint64_t>(options.supersample * options.supersample);
    const auto fit =
        static_cast<int>(std::min<std::uint64_t>(kBandSamples / std::max<std::uint64_t>(row, 1), 1 << 20));
    const int rows = view.height <= fit ? view.height : std::max(fit - 2 * margin, margin);
    const int count = (view.height + rows - 1) / std::max(rows, 1);
    for (int k = 0; k < count; ++k) {
      const int low = view.height * k / count, high = view.height * (k + 1) / count;
      bands.push_back({v, low, high, std::max(low - margin, 0), std::min(high + margin, view.height)});
    }
  }
  return bands;
}

std::uint64_t band_bytes(const PictureOptions& options, std::span<const PictureView> views) {
  const auto [width, rows] = slot_size(views, picture_bands(options, views));
  if (options.only_faces) return BandRasterizer::bytes(width, rows, options.supersample);
  const auto pixels = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(rows);
  const auto samples = static_cast<std::uint64_t>(options.supersample * options.supersample);
  constexpr std::uint64_t kPerSample = 4 + 4 + 4;  // colour, facing, depth
  constexpr std::uint64_t kPerPixel = 4 + 4 + 4;   // result, occlusion, read-back
  return pixels * (samples * kPerSample + kPerPixel);
}

std::uint64_t page_bytes(std::uint64_t texels) {
  return texels * (3 + 6);  // the page; its levels in GL, four bytes a texel and a third of it
}

Image blank_picture(const PictureOptions& options) {
  Image image;
  image.width = options.width;
  image.height = options.height;
  image.rgb.resize(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  constexpr std::array<std::uint8_t, 3> kBetween = {158, 163, 168};
  for (std::size_t i = 0; i < image.rgb.size(); ++i) image.rgb[i] = kBetween[i % 3];
  return image;
}

/// Textures that a band is drawn into.
struct Slot {
  GLuint colours = 0, facings = 0, depths = 0, occlusions = 0, result = 0;
  GLuint scene_frame = 0, occlusion_frame = 0, result_frame = 0;
};

struct Picture::State {
  PictureOptions options;
  std::vector<PictureView> views;
  std::array<int, 2> slot{};  ///< size of each
  std::vector<Slot> slots;
  std::vector<PictureBand> resident;  ///< each in the slot of its number
  Double3 offset{};
  bool cut_backs = false;
  std::vector<BandRasterizer> bands;  ///< resident ones, of only_faces, which has no context
  std::unique_ptr<GlContext> context;
  // GL objects live as long as the context.
  GLuint triangle_program = 0, page_program = 0, point_program = 0, line_program = 0, occlusion_program = 0,
         compose_program = 0;
  GLuint vertex_array = 0, page_array = 0, line_array = 0, empty_array = 0, buffer = 0, page = 0;

  const GlFunctions& gl() const {
    if (!context) throw std::logic_error("picture: more than faces is drawn into a picture of faces alone");
    return context->gl();
  }

  Slot build_slot() const;
  void build_arrays();
  void use_scene(GLuint program) const;
  void use_band(GLuint program, std::size_t k) const;
  void use_screen_band(GLuint program, std::size_t k) const;
  void read_band(std::size_t k, Image& image) const;
  template <class Vertex>
  bool may_show(std::span<const Vertex> batch, const PictureBand& band, double pad_pixels) const;
  void upload(std::span<const std::byte> vertices) const;
  void begin_faces(GLuint program, float wire_pixels) const;
  void build_page_program();
  GLuint frame(std::span<const GLuint> colour, GLuint depth) const;
};

GLuint Picture::State::frame(std::span<const GLuint> colour, GLuint depth) const {
  GLuint name = 0;
  gl().GenFramebuffers(1, &name);
  gl().BindFramebuffer(GL_FRAMEBUFFER, name);
  std::vector<GLenum> buffers;
  for (const GLuint texture : colour) {
    const GLenum attachment = GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(buffers.size());
    gl().FramebufferTexture2D(GL_FRAMEBUFFER, attachment, GL_TEXTURE_2D, texture, 0);
    buffers.push_back(attachment);
  }
  if (depth != 0) gl().FramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth, 0);
  gl().DrawBuffers(static_cast<GLsizei>(buffers.size()), buffers.data());
  if (gl().CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw ResourceError("rasterizer: the framebuffer of the picture is refused; ask for a smaller picture");
  }
  return name;
}

Slot Picture::State::build_slot() const {
  const int width = slot[0] * options.supersample, height = slot[1] * options.supersample;
  Slot s;
  s.colours = create_gl_texture(gl(), GL_RGBA8, width, height);
  s.facings = create_gl_texture(gl(), GL_RGBA8, width, height);
  s.depths = create_gl_texture(gl(), GL_DEPTH_COMPONENT32F, width, height);
  s.occlusions = create_gl_texture(gl(), GL_RGBA8, slot[0], slot[1]);
  s.result = create_gl_texture(gl(), GL_RGBA8, slot[0], slot[1]);
  const std::array<GLuint, 2> scene = {s.colours, s.facings};
  s.scene_frame = frame(scene, s.depths);
  s.occlusion_frame = frame(std::span(&s.occlusions, 1), 0);
  s.result_frame = frame(std::span(&s.result, 1), 0);
  return s;
}

void Picture::State::build_arrays() {
  const auto buffer_offset = [](std::size_t bytes) { return reinterpret_cast<const void*>(bytes); };
  const auto attribute = [&](GLuint index, GLint size, GLenum type, GLboolean normalised, GLsizei stride,
                             std::size_t at, GLuint divisor) {
    gl().EnableVertexAttribArray(index);
    gl().VertexAttribPointer(index, size, type, normalised, stride, buffer_offset(at));
    gl().VertexAttribDivisor(index, divisor);
  };
  gl().GenBuffers(1, &buffer);
  gl().BindBuffer(GL_ARRAY_BUFFER, buffer);
  gl().GenVertexArrays(1, &empty_array);
  gl().GenVertexArrays(1, &vertex_array);
  gl().BindVertexArray(vertex_array);
  constexpr GLsizei kStride = sizeof(PictureVertex);
  attribute(0, 3, GL_FLOAT, GL_FALSE, kStride, offsetof(PictureVertex, x), 0);
  attribute(1, 4, GL_SHORT, GL_TRUE, kStride, offsetof(PictureVertex, nx), 0);
  attribute(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, kStride, offsetof(PictureVertex, rgba), 0);
  gl().GenVertexArrays(1, &page_array);
  gl().BindVertexArray(page_array);
  constexpr GLsizei kPageStride = sizeof(PageVertex);
  constexpr std::size_t kVertex = offsetof(PageVertex, vertex);
  attribute(0, 3, GL_FLOAT, GL_FALSE, kPageStride, kVertex + offsetof(PictureVertex, x), 0);
  attribute(1, 4, GL_SHORT, GL_TRUE, kPageStride, kVertex + offsetof(PictureVertex, nx), 0);
  attribute(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, kPageStride, kVertex + offsetof(PictureVertex, rgba), 0);
  attribute(3, 2, GL_FLOAT, GL_FALSE, kPageStride, offsetof(PageVertex, u), 0);
  gl().GenVertexArrays(1, &line_array);
  gl().BindVertexArray(line_array);
  attribute(0, 3, GL_FLOAT, GL_FALSE, 2 * kStride, offsetof(PictureVertex, x), 1);
  attribute(1, 3, GL_FLOAT, GL_FALSE, 2 * kStride, kStride + offsetof(PictureVertex, x), 1);
  attribute(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, 2 * kStride, offsetof(PictureVertex, rgba), 1);
}

void Picture::State::use_scene(GLuint program) const {
  context->make_current();
  gl().Enable(GL_DEPTH_TEST);
  gl().DepthFunc(GL_LESS);
  gl().Enable(GL_SCISSOR_TEST);
  gl().UseProgram(program);
}

/// Frame, viewport, scissor and matrices of a band in the scene. The viewport is that of the whole view.
void Picture::State::use_band(GLuint program, std::size_t k) const {
  const PictureBand& band = resident[k];
  const PictureView& view = views[band.view];
  const GLint s = options.supersample;
  gl().BindFramebuffer(GL_FRAMEBUFFER, slots[k].scene_frame);
  gl().Viewport(0, -band.drawn_low * s, view.width * s, view.height * s);
  gl().Scissor(0, 0, view.width * s, (band.drawn_high - band.drawn_low) * s);
  Camera camera = view.camera;
  for (std::size_t i = 0; i < 3; ++i) camera.eye[i] -= offset[i];
  const std::array<float, 16> matrix = camera.view_matrix();
  const std::array<float, 16> projection = view.camera.projection_matrix();
  gl().UniformMatrix4fv(gl_uniform(gl(), program, "view"), 1, GL_FALSE, matrix.data());
  gl().UniformMatrix4fv(gl_uniform(gl(), program, "projection"), 1, GL_FALSE, projection.data());
  gl().Uniform1i(gl_uniform(gl(), program, "orthographic"), view.camera.orthographic ? 1 : 0);
}

void Picture::State::use_screen_band(GLuint program, std::size_t k) const {
  const PictureBand& band = resident[k];
  const PictureView& view = views[band.view];
  const Camera& camera = view.camera;
  gl().Viewport(0, -band.drawn_low, view.width, view.height);
  gl().Scissor(0, 0, view.width, band.drawn_high - band.drawn_low);
  gl().Uniform4i(gl_uniform(gl(), program, "rect"), 0, -band.drawn_low, view.width, view.height);
  gl().Uniform1i(gl_uniform(gl(), program, "rows"), band.drawn_high - band.drawn_low);
  gl().Uniform1i(gl_uniform(gl(), program, "samples"), options.supersample);
  gl().Uniform1i(gl_uniform(gl(), program, "orthographic"), camera.orthographic ? 1 : 0);
  gl().Uniform2f(gl_uniform(gl(), program, "planes"), static_cast<float>(camera.near_plane),
                 static_cast<float>(camera.far_plane));
}

/// False where the box of the batch lies above or below the band, which then need not be asked to draw it.
template <class Vertex>
bool Picture::State::may_show(std::span<const Vertex> batch, const PictureBand& band,
                              double pad_pixels) const {
  const PictureView& view = views[band.view];
  if (band.drawn_low == 0 && band.drawn_high == view.height) return true;
  Double3 low = {1e300, 1e300, 1e300}, high = {-1e300, -1e300, -1e300};
  for (const Vertex& v : batch) {
    const PictureVertex& p = vertex_of(v);
    const Double3 at = {p.x, p.y, p.z};
    for (std::size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], at[i]), high[i] = std::max(high[i], at[i]);
  }
  const Camera& camera = view.camera;
  double minimum = 1e300, maximum = -1e300;  // rows
  for (unsigned corner = 0; corner < 8; ++corner) {
    Double3 d;
    for (std::size_t i = 0; i < 3; ++i)
      d[i] = (corner >> i & 1u ? high[i] : low[i]) + offset[i] - camera.eye[i];
    double up = dot(d, camera.up) / camera.half_height;
    if (!camera.orthographic) {
      const double ahead = -dot(d, camera.back);
      if (!(ahead > camera.near_plane)) return true;
      up /= ahead;
    }
    const double row = 0.5 * (up + 1.0) * view.height;
    minimum = std::min(minimum, row), maximum = std::max(maximum, row);
  }
  return !(maximum + pad_pixels < band.drawn_low || minimum - pad_pixels > band.drawn_high);
}

void Picture::State::upload(std::span<const std::byte> vertices) const {
  gl().BindBuffer(GL_ARRAY_BUFFER, buffer);
  gl().BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices.size()), vertices.data(), GL_STREAM_DRAW);
}

Picture::Picture(const PictureOptions& options, std::span<const PictureView> views)
    : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.options = options;
  s.views.assign(views.begin(), views.end());
  if (options.only_faces) return;
  s.context = create_gl_context();
  s.slot = slot_size(s.views, picture_bands(options, views));
  if (const int widest = s.slot[0] * options.supersample; widest > s.context->max_texture_size())
    throw UsageError("a view of " + std::to_string(s.slot[0]) + " pixels with " +
                     std::to_string(options.supersample) + " samples a side is over " +
                     std::to_string(s.context->max_texture_size()) +
                     " samples wide, the limit of the rasterizer");
  s.build_arrays();
  const GlFunctions& gl = s.gl();
  s.triangle_program =
      link_gl_program(gl, "triangles", shaders::kTriangleVertex, with_light(shaders::kTriangleFragment));
  s.point_program = link_gl_program(gl, "points", shaders::kPointVertex, with_light(shaders::kPointFragment));
  s.line_program = link_gl_program(gl, "lines", shaders::kLineVertex, shaders::kLineFragment);
  s.occlusion_program = link_gl_program(gl, "occlusion", shaders::kScreenVertex, shaders::kOcclusionFragment);
  s.compose_program = link_gl_program(gl, "compose", shaders::kScreenVertex, shaders::kComposeFragment);
  gl.Enable(GL_PROGRAM_POINT_SIZE);
}

Picture::~Picture() = default;

void Picture::begin(std::span<const PictureBand> bands) {
  State& s = *state_;
  s.resident.assign(bands.begin(), bands.end());
  if (s.options.only_faces) {
    if (s.bands.size() > bands.size())
      s.bands.erase(s.bands.begin() + static_cast<std::ptrdiff_t>(bands.size()), s.bands.end());
    for (std::size_t k = 0; k < bands.size(); ++k) {
      const PictureView& view = s.views[bands[k].view];
      if (k < s.bands.size())
        s.bands[k].begin(view, bands[k]);
      else
        s.bands.emplace_back(view, bands[k], s.options.supersample);
    }
    return;
  }
  const GlFunctions& gl = s.gl();
  s.context->make_current();
  while (s.slots.size() < s.resident.size()) s.slots.push_back(s.build_slot());
  gl.Disable(GL_SCISSOR_TEST);
  gl.ClearColor(0.0f, 0.0f, 0.0f, 0.0f);
  for (std::size_t k = 0; k < s.resident.size(); ++k) {
    gl.BindFramebuffer(GL_FRAMEBUFFER, s.slots[k].scene_frame);
    gl.Clear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  }
}

void Picture::set_offset(const Double3& offset) {
  state_->offset = offset;
}

void Picture::cut_backs(bool cut) {
  state_->cut_backs = cut;
}

/// What all faces of a batch share.
void Picture::State::begin_faces(GLuint program, float wire_pixels) const {
  use_scene(program);
  gl().Uniform1f(gl_uniform(gl(), program, "wire_pixels"),
                 wire_pixels * static_cast<float>(options.supersample));
  gl().Uniform1i(gl_uniform(gl(), program, "cut_backs"), cut_backs ? 1 : 0);
  gl().Uniform1i(gl_uniform(gl(), program, "shade"), static_cast<int>(options.shade));
  gl().Uniform4f(gl_uniform(gl(), program, "back_colour"), channel(kBackFace, 0), channel(kBackFace, 1),
                 channel(kBackFace, 2), 1.0f);
}

void Picture::triangles(std::span<const PictureVertex> corners, float wire_pixels) {
  if (state_->options.only_faces && !(wire_pixels > 0.0f)) {
    for (std::size_t k = 0; k < state_->bands.size(); ++k)
      if (state_->may_show(corners, state_->resident[k], kRounding))
        state_->bands[k].triangles(corners, state_->offset, state_->cut_backs);
    return;
  }
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  const GLuint program = s.triangle_program;
  s.begin_faces(program, wire_pixels);
  s.upload(std::as_bytes(corners));
  gl.BindVertexArray(s.vertex_array);
  for (std::size_t k = 0; k < s.resident.size(); ++k) {
    if (!s.may_show(corners, s.resident[k], kRounding)) continue;
    s.use_band(program, k);
    gl.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(corners.size()));
  }
  gl.Finish();  // else llvmpipe keeps every batch until the end
}

void Picture::State::build_page_program() {
  if (page_program != 0) return;
  page_program = link_gl_program(gl(), "page", with_page(shaders::kTriangleVertex),
                                 with_light(with_page(shaders::kTriangleFragment).c_str()));
}

void Picture::set_page(Image page, bool repeats) {
  State& s = *state_;
  const GlFunctions& gl = s.gl();
  s.context->make_current();
  s.build_page_program();
  if (s.page != 0) gl.DeleteTextures(1, &s.page);
  while (std::max(page.width, page.height) > s.context->max_texture_size()) halve_page(page);
  gl.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(kPage));
  gl.GenTextures(1, &s.page);
  gl.BindTexture(GL_TEXTURE_2D, s.page);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  for (const GLenum axis : std::array<GLenum, 2>{GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
    gl.TexParameteri(GL_TEXTURE_2D, axis, repeats ? GL_REPEAT : GL_CLAMP_TO_EDGE);
  gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (GLint level = 0;; ++level) {
    gl.TexImage2D(GL_TEXTURE_2D, level, GL_RGB8, page.width, page.height, 0, GL_RGB, GL_UNSIGNED_BYTE,
                  page.rgb.data());
    if (page.width == 1 && page.height == 1) break;
    halve_page(page);
  }
  gl.ActiveTexture(GL_TEXTURE0);
  if (gl.GetError() == GL_OUT_OF_MEMORY)
    throw ResourceError("rasterizer: no memory for a page of a texture; give more --memory");
}

void Picture::page_triangles(std::span<const PageVertex> corners, float wire_pixels) {
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  s.begin_faces(s.page_program, wire_pixels);
  s.upload(std::as_bytes(corners));
  gl.BindVertexArray(s.page_array);
  gl.Uniform1i(gl_uniform(gl, s.page_program, "page"), kPage);
  for (std::size_t k = 0; k < s.resident.size(); ++k) {
    if (!s.may_show(corners, s.resident[k], kRounding)) continue;
    s.use_band(s.page_program, k);
    gl.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(corners.size()));
  }
  gl.Finish();  // else llvmpipe keeps every batch until the end
}

void Picture::lines(std::span<const PictureVertex> ends, float pixels, float length) {
  if (state_->options.only_faces) {
    for (std::size_t k = 0; k < state_->bands.size(); ++k)
      if (state_->may_show(ends, state_->resident[k], kRounding + double{pixels}))
        state_->bands[k].lines(ends, state_->offset, pixels, length);
    return;
  }
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  const GLuint program = s.line_program;
  s.use_scene(program);
  s.upload(std::as_bytes(ends));
  gl.BindVertexArray(s.line_array);
  const auto samples = static_cast<float>(s.options.supersample);
  gl.Uniform1f(gl_uniform(gl, program, "most_half_width"), 0.5f * pixels * samples);
  gl.Uniform1f(gl_uniform(gl, program, "least_half_width"), 0.5f * kMinLinePixels * samples);
  gl.Uniform1f(gl_uniform(gl, program, "edge_length"), length);
  for (std::size_t k = 0; k < s.resident.size(); ++k) {
    if (!s.may_show(ends, s.resident[k], kRounding + double{pixels})) continue;
    const PictureView& view = s.views[s.resident[k].view];
    s.use_band(program, k);
    gl.Uniform1f(gl_uniform(gl, program, "eye_pixel"),
                 static_cast<float>(2.0 * view.camera.half_height / (view.height * s.options.supersample)));
    gl.Uniform1f(gl_uniform(gl, program, "near_plane"), static_cast<float>(view.camera.near_plane));
    gl.Uniform2f(gl_uniform(gl, program, "pixels"), static_cast<float>(view.width) * samples,
                 static_cast<float>(view.height) * samples);
    gl.DrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(ends.size() / 2));
  }
  gl.Finish();  // else llvmpipe keeps every batch until the end
}

void Picture::points(std::span<const PictureVertex> centres, float diameter, float min_pixels,
                     bool mark_back) {
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  const GLuint program = s.point_program;
  s.use_scene(program);
  s.upload(std::as_bytes(centres));
  gl.BindVertexArray(s.vertex_array);
  const auto samples = static_cast<float>(s.options.supersample);
  gl.Uniform1f(gl_uniform(gl, program, "least_pixels"), min_pixels * samples);
  gl.Uniform1i(gl_uniform(gl, program, "mark_back"), mark_back ? 1 : 0);
  gl.Uniform4f(gl_uniform(gl, program, "back_colour"), channel(kBackFace, 0), channel(kBackFace, 1),
               channel(kBackFace, 2), 1.0f);
  for (std::size_t k = 0; k < s.resident.size(); ++k) {
    if (!s.may_show(centres, s.resident[k], kRounding + kMaxPointSize)) continue;
    const PictureView& view = s.views[s.resident[k].view];
    s.use_band(program, k);
    const double per_unit = view.height * s.options.supersample / (2.0 * view.camera.half_height);
    gl.Uniform1f(gl_uniform(gl, program, "diameter_scale"),
                 static_cast<float>(static_cast<double>(diameter) * per_unit));
    gl.DrawArrays(GL_POINTS, 0, static_cast<GLsizei>(centres.size()));
  }
  gl.Finish();  // else llvmpipe keeps every batch until the end
}

/// Reads the band's rows into their places.
void Picture::State::read_band(std::size_t k, Image& image) const {
  const PictureBand& band = resident[k];
  const PictureView& view = views[band.view];
  const auto row_pixels = static_cast<std::size_t>(view.width);
  std::vector<std::uint8_t> rgba(4 * row_pixels * static_cast<std::size_t>(band.high - band.low));
  gl().ReadBuffer(GL_COLOR_ATTACHMENT0);
  gl().PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl().ReadPixels(0, band.low - band.drawn_low, view.width, band.high - band.low, GL_RGBA, GL_UNSIGNED_BYTE,
                  rgba.data());
  for (int row = band.low; row < band.high; ++row) {
    const std::uint8_t* from = rgba.data() + 4 * row_pixels * static_cast<std::size_t>(row - band.low);
    std::uint8_t* to = image.pixel(view.x, view.y + view.height - 1 - row);  // GL counts from below
    for (std::size_t x = 0; x < row_pixels; ++x) {
      to[3 * x] = from[4 * x], to[3 * x + 1] = from[4 * x + 1], to[3 * x + 2] = from[4 * x + 2];
    }
  }
}

void Picture::finish(Image& image) {
  if (state_->options.only_faces) {
    for (BandRasterizer& band : state_->bands) band.finish(state_->options.occlusion, kOcclusionShare, image);
    return;
  }
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  s.context->make_current();
  gl.Disable(GL_DEPTH_TEST);
  gl.Enable(GL_SCISSOR_TEST);
  gl.BindVertexArray(s.empty_array);
  // In perspective a view's size grows with distance: measured where the scene begins.
  const auto view_half_width = [](const Camera& camera) {
    return camera.orthographic ? camera.half_width
                               : camera.half_width * 0.5 * (camera.near_plane + camera.far_plane);
  };
  for (std::size_t k = 0; k < s.resident.size(); ++k) {
    const Slot& slot = s.slots[k];
    const Camera& camera = s.views[s.resident[k].view].camera;
    const std::array<GLuint, 4> textures = {slot.colours, slot.depths, slot.facings, slot.occlusions};
    for (std::size_t i = 0; i < textures.size(); ++i) {
      gl.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(i));
      gl.BindTexture(GL_TEXTURE_2D, textures[i]);
    }
    const GLuint occlusion = s.occlusion_program;
    gl.BindFramebuffer(GL_FRAMEBUFFER, slot.occlusion_frame);
    gl.UseProgram(occlusion);
    gl.Uniform1i(gl_uniform(gl, occlusion, "depths"), kDepths);
    gl.Uniform1i(gl_uniform(gl, occlusion, "facings"), kFacings);
    gl.Uniform1f(gl_uniform(gl, occlusion, "strength"), static_cast<float>(s.options.occlusion));
    s.use_screen_band(occlusion, k);
    gl.Uniform1f(gl_uniform(gl, occlusion, "radius"),
                 static_cast<float>(kOcclusionShare * view_half_width(camera)));
    gl.Uniform2f(gl_uniform(gl, occlusion, "half_size"), static_cast<float>(camera.half_width),
                 static_cast<float>(camera.half_height));
    gl.DrawArrays(GL_TRIANGLES, 0, 3);

    const GLuint compose = s.compose_program;
    gl.BindFramebuffer(GL_FRAMEBUFFER, slot.result_frame);
    gl.UseProgram(compose);
    gl.Uniform1i(gl_uniform(gl, compose, "colours"), kColours);
    gl.Uniform1i(gl_uniform(gl, compose, "depths"), kDepths);
    gl.Uniform1i(gl_uniform(gl, compose, "facings"), kFacings);
    gl.Uniform1i(gl_uniform(gl, compose, "occlusions"), kOcclusions);
    s.use_screen_band(compose, k);
    gl.Uniform1f(gl_uniform(gl, compose, "near_size"), static_cast<float>(0.02 * view_half_width(camera)));
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
    s.read_band(k, image);
  }
  // The next textures are made at the unit that was the first.
  gl.ActiveTexture(GL_TEXTURE0);
  if (gl.GetError() != GL_NO_ERROR)
    throw std::logic_error("rasterizer: OpenGL reports an error after drawing");
}

const std::string& Picture::renderer() const {
  static const std::string kOwn = "Tessera, on the processor";
  if (state_->options.only_faces) return kOwn;
  return state_->context->description();
}

}  // namespace tessera
