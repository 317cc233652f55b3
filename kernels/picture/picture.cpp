#include "kernels/picture/picture.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "kernels/picture/gl_functions.h"
#include "kernels/picture/picture_shaders.h"
#include "octree/error.h"

namespace tessera {
namespace {

constexpr float kUnitNormal = 32767.0f;
constexpr float kLeastLinePixels = 0.3f;
constexpr double kOcclusionShare = 0.07;  // of a view's half width, where no radius is given

/// Texture units of the screen passes.
enum Unit : int { kColours = 0, kDepths = 1, kFacings = 2, kOcclusions = 3 };

std::string with_light(const char* source) {
  std::string text = source;
  const std::string mark = "%LIGHT%";
  return text.replace(text.find(mark), mark.size(), shaders::kLight);
}

float channel(std::uint32_t rgba, int i) {
  return static_cast<float>((rgba >> (8 * i)) & 0xffu) / 255.0f;
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

std::uint64_t picture_bytes(const PictureOptions& options) {
  const auto pixels = static_cast<std::uint64_t>(options.width) * static_cast<std::uint64_t>(options.height);
  const auto samples = static_cast<std::uint64_t>(options.supersample * options.supersample);
  constexpr std::uint64_t kPerSample = 4 + 4 + 4;     // colour, facing, depth
  constexpr std::uint64_t kPerPixel = 4 + 4 + 4 + 3;  // result, occlusion, read-back, image
  return pixels * (samples * kPerSample + kPerPixel);
}

struct Picture::State {
  PictureOptions options;
  std::vector<PictureView> views;
  Double3 offset{};
  bool cut_backs = false;
  std::unique_ptr<GlContext> context;
  // GL objects live as long as the context.
  GLuint triangle_program = 0, point_program = 0, line_program = 0, occlusion_program = 0,
         compose_program = 0;
  GLuint vertex_array = 0, line_array = 0, empty_array = 0, buffer = 0;
  GLuint colours = 0, facings = 0, depths = 0, occlusions = 0, result = 0;
  GLuint scene_frame = 0, occlusion_frame = 0, result_frame = 0;

  const GlFunctions& gl() const { return context->gl(); }
  GLint rect_y(const PictureView& v) const {
    return options.height - v.y - v.height;
  }  // GL counts from below

  void build_targets();
  void build_arrays();
  void use_scene(GLuint program) const;
  void use_view(GLuint program, const PictureView& view) const;
  void use_screen_view(GLuint program, const PictureView& view) const;
  void upload(std::span<const PictureVertex> vertices) const;
  GLuint frame(std::span<const GLuint> colour, GLuint depth) const;
};

GLuint Picture::State::frame(std::span<const GLuint> colour, GLuint depth) const {
  GLuint name = 0;
  gl().GenFramebuffers(1, &name);
  gl().BindFramebuffer(GL_FRAMEBUFFER, name);
  std::vector<GLenum> buffers;
  for (const GLuint texture : colour) {
    const GLenum slot = GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(buffers.size());
    gl().FramebufferTexture2D(GL_FRAMEBUFFER, slot, GL_TEXTURE_2D, texture, 0);
    buffers.push_back(slot);
  }
  if (depth != 0) gl().FramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth, 0);
  gl().DrawBuffers(static_cast<GLsizei>(buffers.size()), buffers.data());
  if (gl().CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw ResourceError("rasterizer: the framebuffer of the picture is refused; ask for a smaller picture");
  }
  return name;
}

void Picture::State::build_targets() {
  const int width = options.width * options.supersample;
  const int height = options.height * options.supersample;
  if (std::max(width, height) > context->max_texture_size()) {
    throw UsageError("a picture of " + std::to_string(options.width) + "x" + std::to_string(options.height) +
                     " pixels with " + std::to_string(options.supersample) + " samples a side is over " +
                     std::to_string(context->max_texture_size()) +
                     " samples a side, the limit of the rasterizer");
  }
  colours = create_gl_texture(gl(), GL_RGBA8, width, height);
  facings = create_gl_texture(gl(), GL_RGBA8, width, height);
  depths = create_gl_texture(gl(), GL_DEPTH_COMPONENT32F, width, height);
  occlusions = create_gl_texture(gl(), GL_RGBA8, options.width, options.height);
  result = create_gl_texture(gl(), GL_RGBA8, options.width, options.height);
  const std::array<GLuint, 2> scene = {colours, facings};
  scene_frame = frame(scene, depths);
  occlusion_frame = frame(std::span(&occlusions, 1), 0);
  result_frame = frame(std::span(&result, 1), 0);
  gl().BindFramebuffer(GL_FRAMEBUFFER, scene_frame);
  gl().ClearColor(0.0f, 0.0f, 0.0f, 0.0f);
  gl().Clear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

void Picture::State::build_arrays() {
  const auto place = [](std::size_t bytes) { return reinterpret_cast<const void*>(bytes); };
  const auto attribute = [&](GLuint index, GLint size, GLenum type, GLboolean normalised, GLsizei stride,
                             std::size_t at, GLuint divisor) {
    gl().EnableVertexAttribArray(index);
    gl().VertexAttribPointer(index, size, type, normalised, stride, place(at));
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
  gl().GenVertexArrays(1, &line_array);
  gl().BindVertexArray(line_array);
  attribute(0, 3, GL_FLOAT, GL_FALSE, 2 * kStride, offsetof(PictureVertex, x), 1);
  attribute(1, 3, GL_FLOAT, GL_FALSE, 2 * kStride, kStride + offsetof(PictureVertex, x), 1);
  attribute(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, 2 * kStride, offsetof(PictureVertex, rgba), 1);
}

void Picture::State::use_scene(GLuint program) const {
  context->make_current();
  gl().BindFramebuffer(GL_FRAMEBUFFER, scene_frame);
  gl().Enable(GL_DEPTH_TEST);
  gl().DepthFunc(GL_LESS);
  gl().Enable(GL_SCISSOR_TEST);
  gl().UseProgram(program);
}

/// Viewport, scissor and matrices of a view in the scene.
void Picture::State::use_view(GLuint program, const PictureView& view) const {
  const GLint s = options.supersample;
  gl().Viewport(view.x * s, rect_y(view) * s, view.width * s, view.height * s);
  gl().Scissor(view.x * s, rect_y(view) * s, view.width * s, view.height * s);
  Camera camera = view.camera;
  for (std::size_t i = 0; i < 3; ++i) camera.eye[i] -= offset[i];
  const std::array<float, 16> matrix = camera.view_matrix();
  const std::array<float, 16> projection = view.camera.projection_matrix();
  gl().UniformMatrix4fv(gl_uniform(gl(), program, "view"), 1, GL_FALSE, matrix.data());
  gl().UniformMatrix4fv(gl_uniform(gl(), program, "projection"), 1, GL_FALSE, projection.data());
  gl().Uniform1i(gl_uniform(gl(), program, "orthographic"), view.camera.orthographic ? 1 : 0);
}

void Picture::State::use_screen_view(GLuint program, const PictureView& view) const {
  const Camera& camera = view.camera;
  gl().Viewport(view.x, rect_y(view), view.width, view.height);
  gl().Scissor(view.x, rect_y(view), view.width, view.height);
  gl().Uniform4i(gl_uniform(gl(), program, "rect"), view.x, rect_y(view), view.width, view.height);
  gl().Uniform1i(gl_uniform(gl(), program, "samples"), options.supersample);
  gl().Uniform1i(gl_uniform(gl(), program, "orthographic"), camera.orthographic ? 1 : 0);
  gl().Uniform2f(gl_uniform(gl(), program, "planes"), static_cast<float>(camera.near_plane),
                 static_cast<float>(camera.far_plane));
}

void Picture::State::upload(std::span<const PictureVertex> vertices) const {
  gl().BindBuffer(GL_ARRAY_BUFFER, buffer);
  gl().BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices.size_bytes()), vertices.data(),
                  GL_STREAM_DRAW);
}

Picture::Picture(const PictureOptions& options, std::span<const PictureView> views)
    : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.options = options;
  s.views.assign(views.begin(), views.end());
  s.context = create_gl_context();
  s.build_targets();
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

void Picture::set_offset(const Double3& offset) {
  state_->offset = offset;
}

void Picture::cut_backs(bool cut) {
  state_->cut_backs = cut;
}

void Picture::triangles(std::span<const PictureVertex> corners, float wire_pixels) {
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  const GLuint program = s.triangle_program;
  s.use_scene(program);
  s.upload(corners);
  gl.BindVertexArray(s.vertex_array);
  gl.Uniform1f(gl_uniform(gl, program, "wire_pixels"),
               wire_pixels * static_cast<float>(s.options.supersample));
  gl.Uniform1i(gl_uniform(gl, program, "cut_backs"), s.cut_backs ? 1 : 0);
  gl.Uniform1i(gl_uniform(gl, program, "shade"), static_cast<int>(s.options.shade));
  gl.Uniform4f(gl_uniform(gl, program, "back_colour"), channel(kBackFace, 0), channel(kBackFace, 1),
               channel(kBackFace, 2), 1.0f);
  for (const PictureView& view : s.views) {
    s.use_view(program, view);
    gl.DrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(corners.size()));
  }
  gl.Finish();  // else llvmpipe keeps every batch until the end
}

void Picture::lines(std::span<const PictureVertex> ends, float pixels, float length) {
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  const GLuint program = s.line_program;
  s.use_scene(program);
  s.upload(ends);
  gl.BindVertexArray(s.line_array);
  const auto samples = static_cast<float>(s.options.supersample);
  gl.Uniform1f(gl_uniform(gl, program, "most_half_width"), 0.5f * pixels * samples);
  gl.Uniform1f(gl_uniform(gl, program, "least_half_width"), 0.5f * kLeastLinePixels * samples);
  gl.Uniform1f(gl_uniform(gl, program, "edge_length"), length);
  for (const PictureView& view : s.views) {
    s.use_view(program, view);
    gl.Uniform1f(gl_uniform(gl, program, "eye_pixel"),
                 static_cast<float>(2.0 * view.camera.half_height / (view.height * s.options.supersample)));
    gl.Uniform1f(gl_uniform(gl, program, "near_plane"), static_cast<float>(view.camera.near_plane));
    gl.Uniform2f(gl_uniform(gl, program, "pixels"), static_cast<float>(view.width) * samples,
                 static_cast<float>(view.height) * samples);
    gl.DrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(ends.size() / 2));
  }
  gl.Finish();  // else llvmpipe keeps every batch until the end
}

void Picture::points(std::span<const PictureVertex> centres, float diameter, float least_pixels,
                     bool mark_back) {
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  const GLuint program = s.point_program;
  s.use_scene(program);
  s.upload(centres);
  gl.BindVertexArray(s.vertex_array);
  const auto samples = static_cast<float>(s.options.supersample);
  gl.Uniform1f(gl_uniform(gl, program, "least_pixels"), least_pixels * samples);
  gl.Uniform1i(gl_uniform(gl, program, "mark_back"), mark_back ? 1 : 0);
  gl.Uniform4f(gl_uniform(gl, program, "back_colour"), channel(kBackFace, 0), channel(kBackFace, 1),
               channel(kBackFace, 2), 1.0f);
  for (const PictureView& view : s.views) {
    s.use_view(program, view);
    const double per_unit = view.height * s.options.supersample / (2.0 * view.camera.half_height);
    gl.Uniform1f(gl_uniform(gl, program, "diameter_scale"),
                 static_cast<float>(static_cast<double>(diameter) * per_unit));
    gl.DrawArrays(GL_POINTS, 0, static_cast<GLsizei>(centres.size()));
  }
  gl.Finish();  // else llvmpipe keeps every batch until the end
}

Image Picture::finish() {
  const State& s = *state_;
  const GlFunctions& gl = s.gl();
  s.context->make_current();
  gl.Disable(GL_DEPTH_TEST);
  gl.BindVertexArray(s.empty_array);
  const std::array<GLuint, 4> textures = {s.colours, s.depths, s.facings, s.occlusions};
  for (std::size_t i = 0; i < textures.size(); ++i) {
    gl.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(i));
    gl.BindTexture(GL_TEXTURE_2D, textures[i]);
  }

  // In perspective a view's size grows with distance: measured where the scene begins.
  const auto view_half_width = [](const Camera& camera) {
    return camera.orthographic ? camera.half_width
                               : camera.half_width * 0.5 * (camera.near_plane + camera.far_plane);
  };
  const GLuint occlusion = s.occlusion_program;
  gl.BindFramebuffer(GL_FRAMEBUFFER, s.occlusion_frame);
  gl.UseProgram(occlusion);
  gl.Uniform1i(gl_uniform(gl, occlusion, "depths"), kDepths);
  gl.Uniform1i(gl_uniform(gl, occlusion, "facings"), kFacings);
  gl.Uniform1f(gl_uniform(gl, occlusion, "strength"), static_cast<float>(s.options.occlusion));
  for (const PictureView& view : s.views) {
    s.use_screen_view(occlusion, view);
    const double radius = kOcclusionShare * view_half_width(view.camera);
    gl.Uniform1f(gl_uniform(gl, occlusion, "radius"), static_cast<float>(radius));
    gl.Uniform2f(gl_uniform(gl, occlusion, "half_size"), static_cast<float>(view.camera.half_width),
                 static_cast<float>(view.camera.half_height));
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
  }

  const GLuint compose = s.compose_program;
  gl.BindFramebuffer(GL_FRAMEBUFFER, s.result_frame);
  gl.Disable(GL_SCISSOR_TEST);
  gl.ClearColor(0.62f, 0.64f, 0.66f, 1.0f);  // what no view covers: the lines between views
  gl.Clear(GL_COLOR_BUFFER_BIT);
  gl.Enable(GL_SCISSOR_TEST);
  gl.UseProgram(compose);
  gl.Uniform1i(gl_uniform(gl, compose, "colours"), kColours);
  gl.Uniform1i(gl_uniform(gl, compose, "depths"), kDepths);
  gl.Uniform1i(gl_uniform(gl, compose, "facings"), kFacings);
  gl.Uniform1i(gl_uniform(gl, compose, "occlusions"), kOcclusions);
  for (const PictureView& view : s.views) {
    s.use_screen_view(compose, view);
    gl.Uniform1f(gl_uniform(gl, compose, "near_size"),
                 static_cast<float>(0.02 * view_half_width(view.camera)));
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
  }

  Image image;
  image.width = s.options.width;
  image.height = s.options.height;
  const auto row_pixels = static_cast<std::size_t>(image.width);
  std::vector<std::uint8_t> rgba(4 * row_pixels * static_cast<std::size_t>(image.height));
  gl.ReadBuffer(GL_COLOR_ATTACHMENT0);
  gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl.ReadPixels(0, 0, image.width, image.height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  if (gl.GetError() != GL_NO_ERROR)
    throw std::logic_error("rasterizer: OpenGL reports an error after drawing");
  image.rgb.resize(3 * row_pixels * static_cast<std::size_t>(image.height));
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* from = rgba.data() + 4 * row_pixels * static_cast<std::size_t>(image.height - 1 - y);
    std::uint8_t* to = image.pixel(0, y);
    for (std::size_t x = 0; x < row_pixels; ++x) {
      to[3 * x] = from[4 * x], to[3 * x + 1] = from[4 * x + 1], to[3 * x + 2] = from[4 * x + 2];
    }
  }
  return image;
}

const std::string& Picture::renderer() const {
  return state_->context->description();
}

}  // namespace tessera
