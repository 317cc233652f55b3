#include "kernels/picture/rasterizer.h"

#include <array>
#include <stdexcept>
#include <vector>

#include <dlfcn.h>

#include "kernels/picture/gl_functions.h"
#include "octree/error.h"

// The attribute names below are OSMesa's (GL/osmesa.h). That header includes GL/gl.h, which clashes with the
// core profile header, so the four functions and the constants are declared here.
#ifdef __SANITIZE_ADDRESS__
// OSMesa 22.3 keeps about 100 bytes for every context that was current, also after it is destroyed.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libOSMesa";
}  // NOLINT: the runtime's name
#endif

namespace tessera {
namespace {

constexpr int kOsMesaFormat = 0x22;
constexpr int kOsMesaDepthBits = 0x30;
constexpr int kOsMesaStencilBits = 0x31;
constexpr int kOsMesaAccumBits = 0x32;
constexpr int kOsMesaProfile = 0x33;
constexpr int kOsMesaCoreProfile = 0x34;
constexpr int kOsMesaMajor = 0x36;
constexpr int kOsMesaMinor = 0x37;

using OsMesaHandle = struct osmesa_context*;
using OsMesaCreate = OsMesaHandle (*)(const int*, OsMesaHandle);
using OsMesaDestroy = void (*)(OsMesaHandle);
using OsMesaMakeCurrent = unsigned char (*)(OsMesaHandle, void*, GLenum, GLsizei, GLsizei);
using OsMesaGetProc = void (*(*)(const char*))();

struct OsMesaLibrary {
  OsMesaCreate create = nullptr;
  OsMesaDestroy destroy = nullptr;
  OsMesaMakeCurrent make_current = nullptr;
  OsMesaGetProc get_proc = nullptr;
};

constexpr std::array<const char*, 2> kLibraryNames = {"libOSMesa.so.8", "libOSMesa.so.6"};
constexpr const char* kInstall = "install it (Debian: apt-get install libosmesa6)";

OsMesaLibrary load_osmesa() {
  void* handle = nullptr;
  std::string reason;
  for (const char* name : kLibraryNames) {
    handle = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (handle != nullptr) break;
    if (reason.empty()) reason = dlerror();
  }
  if (handle == nullptr) {
    throw ResourceError("rasterizer: the software OpenGL library OSMesa cannot be loaded (" + reason + "); " +
                        kInstall);
  }
  OsMesaLibrary library;
  library.create = reinterpret_cast<OsMesaCreate>(dlsym(handle, "OSMesaCreateContextAttribs"));
  library.destroy = reinterpret_cast<OsMesaDestroy>(dlsym(handle, "OSMesaDestroyContext"));
  library.make_current = reinterpret_cast<OsMesaMakeCurrent>(dlsym(handle, "OSMesaMakeCurrent"));
  library.get_proc = reinterpret_cast<OsMesaGetProc>(dlsym(handle, "OSMesaGetProcAddress"));
  if (library.create == nullptr || library.destroy == nullptr || library.make_current == nullptr ||
      library.get_proc == nullptr) {
    throw ResourceError(std::string("rasterizer: this OSMesa is too old for core contexts; ") + kInstall);
  }
  return library;
}

/// Loaded once, never unloaded: llvmpipe keeps threads of its own until the process ends.
const OsMesaLibrary& osmesa() {
  static const OsMesaLibrary library = load_osmesa();
  return library;
}

class OsMesaContext final : public GlContext {
 public:
  OsMesaContext() : library_(osmesa()) {
    // No depth or stencil of its own: we only draw into framebuffer objects.
    const std::array<int, 15> attributes = {kOsMesaFormat,
                                            GL_RGBA,
                                            kOsMesaDepthBits,
                                            0,
                                            kOsMesaStencilBits,
                                            0,
                                            kOsMesaAccumBits,
                                            0,
                                            kOsMesaProfile,
                                            kOsMesaCoreProfile,
                                            kOsMesaMajor,
                                            4,
                                            kOsMesaMinor,
                                            5,
                                            0};
    handle_ = library_.create(attributes.data(), nullptr);
    if (handle_ == nullptr) {
      throw ResourceError(
          std::string("rasterizer: OSMesa gives no OpenGL 4.5 core context; it is too old, ") + kInstall);
    }
    try {
      make_current();
      load_gl_functions(gl_, library_.get_proc, "OSMesa");
    } catch (...) {
      library_.destroy(handle_);
      throw;
    }
    gl_.GetIntegerv(GL_MAX_TEXTURE_SIZE, &max_texture_size_);
    description_ = std::string("OSMesa ") + reinterpret_cast<const char*>(gl_.GetString(GL_VERSION)) + ", " +
                   reinterpret_cast<const char*>(gl_.GetString(GL_RENDERER));
  }
  ~OsMesaContext() override { library_.destroy(handle_); }

  void make_current() override {
    if (library_.make_current(handle_, buffer_.data(), GL_UNSIGNED_BYTE, kBufferSide, kBufferSide) == 0) {
      throw ResourceError("rasterizer: OSMesa refuses to make its context current");
    }
  }
  const GlFunctions& gl() const override { return gl_; }
  const std::string& description() const override { return description_; }
  int max_texture_size() const override { return max_texture_size_; }

 private:
  static constexpr int kBufferSide = 16;  // OSMesa wants a window; nothing is drawn there

  const OsMesaLibrary& library_;
  OsMesaHandle handle_ = nullptr;
  GlFunctions gl_;
  std::array<unsigned char, 4 * kBufferSide * kBufferSide> buffer_{};
  std::string description_;
  int max_texture_size_ = 0;
};

std::uint32_t compile(const GlFunctions& gl, GLenum kind, const std::string& name,
                      const std::string& source) {
  const GLuint shader = gl.CreateShader(kind);
  const char* text = source.c_str();
  gl.ShaderSource(shader, 1, &text, nullptr);
  gl.CompileShader(shader);
  GLint ok = 0;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (ok == 0) {
    std::array<char, 2048> log{};
    gl.GetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw std::logic_error("rasterizer: shader '" + name + "' does not compile: " + log.data());
  }
  return shader;
}

}  // namespace

void load_gl_functions(GlFunctions& gl, void (*(*get_proc)(const char*))(), const std::string& library) {
#define TESSERA_GL_LOAD(type, name)                                                        \
  gl.name = reinterpret_cast<type>(get_proc("gl" #name));                                  \
  if (gl.name == nullptr)                                                                  \
    throw ResourceError("rasterizer: " + library + " lacks gl" #name ", it is too old; " + \
                        std::string(kInstall));
  TESSERA_GL_FUNCTIONS(TESSERA_GL_LOAD)
#undef TESSERA_GL_LOAD
}

bool rasterizer_loaded() {
  for (const char* name : kLibraryNames)
    if (void* handle = dlopen(name, RTLD_NOW | RTLD_NOLOAD); handle != nullptr) {
      dlclose(handle);  // counted once more by that
      return true;
    }
  return false;
}

std::unique_ptr<GlContext> create_gl_context() {
  return std::make_unique<OsMesaContext>();
}

std::uint32_t link_gl_program(const GlFunctions& gl, const std::string& name,
                              const std::string& vertex_source, const std::string& fragment_source) {
  const GLuint vertex = compile(gl, GL_VERTEX_SHADER, name, vertex_source);
  const GLuint fragment = compile(gl, GL_FRAGMENT_SHADER, name, fragment_source);
  const GLuint program = gl.CreateProgram();
  gl.AttachShader(program, vertex);
  gl.AttachShader(program, fragment);
  gl.LinkProgram(program);
  gl.DeleteShader(vertex);
  gl.DeleteShader(fragment);
  GLint ok = 0;
  gl.GetProgramiv(program, GL_LINK_STATUS, &ok);
  if (ok == 0) {
    std::array<char, 2048> log{};
    gl.GetProgramInfoLog(program, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw std::logic_error("rasterizer: program '" + name + "' does not link: " + log.data());
  }
  return program;
}

std::uint32_t create_gl_texture(const GlFunctions& gl, std::uint32_t format, int width, int height) {
  while (gl.GetError() != GL_NO_ERROR) {
  }
  GLuint texture = 0;
  gl.GenTextures(1, &texture);
  gl.BindTexture(GL_TEXTURE_2D, texture);
  const bool depth = format == GL_DEPTH_COMPONENT32F;
  gl.TexImage2D(GL_TEXTURE_2D, 0, static_cast<GLint>(format), width, height, 0,
                depth ? GL_DEPTH_COMPONENT : GL_RGBA, depth ? GL_FLOAT : GL_UNSIGNED_BYTE, nullptr);
  if (gl.GetError() != GL_NO_ERROR) {
    throw ResourceError("rasterizer: no memory for a texture of " + std::to_string(width) + " x " +
                        std::to_string(height) + "; ask for a smaller picture");
  }
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  return texture;
}

int gl_uniform(const GlFunctions& gl, std::uint32_t program, const char* name) {
  const int location = gl.GetUniformLocation(program, name);
  if (location < 0)
    throw std::logic_error(std::string("rasterizer: no uniform '") + name + "' in the program");
  return location;
}

}  // namespace tessera
