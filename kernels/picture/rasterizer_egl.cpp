// EGL without a window: the devices that the system's vendors offer, each with a surfaceless OpenGL 4.5 core
// context. EGL's headers are another package, so the few names that we need are declared here (EGL 1.5,
// EGL_EXT_device_base, EGL_EXT_platform_device).
#include <dlfcn.h>

#include <array>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "kernels/picture/gl_functions.h"
#include "kernels/picture/rasterizer.h"
#include "octree/error.h"

namespace tessera {
namespace {

using Display = void*;
using Device = void*;
using Config = void*;
using Context = void*;
using Int = std::int32_t;
using Boolean = unsigned int;

constexpr unsigned kPlatformDevice = 0x313F;
constexpr unsigned kPlatformSurfaceless = 0x31DD;
constexpr unsigned kOpenGlApi = 0x30A2;
constexpr Int kNone = 0x3038;
constexpr Int kSurfaceType = 0x3033;
constexpr Int kRenderableType = 0x3040;
constexpr Int kOpenGlBit = 8;
constexpr Int kMajorVersion = 0x3098;
constexpr Int kMinorVersion = 0x30FB;
constexpr Int kProfileMask = 0x30FD;
constexpr Int kCoreProfile = 1;

struct EglLibrary {
  void (*(*get_proc)(const char*))() = nullptr;
  Display (*platform_display)(unsigned, void*, const Int*) = nullptr;
  Boolean (*query_devices)(Int, Device*, Int*) = nullptr;  ///< null where the extension is missing
  Boolean (*initialize)(Display, Int*, Int*) = nullptr;
  Boolean (*bind_api)(unsigned) = nullptr;
  Boolean (*choose_config)(Display, const Int*, Config*, Int, Int*) = nullptr;
  Context (*create_context)(Display, Config, Context, const Int*) = nullptr;
  Boolean (*destroy_context)(Display, Context) = nullptr;
  Boolean (*make_current)(Display, void*, void*, Context) = nullptr;
  std::vector<Display> displays;  ///< initialised; they last as long as the process, as drivers want
  bool usable = false;
};

EglLibrary load_egl() {
  EglLibrary egl;
  void* handle = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) return egl;
  const auto load = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(dlsym(handle, name));
    return function != nullptr;
  };
  if (!load(egl.get_proc, "eglGetProcAddress") || !load(egl.initialize, "eglInitialize") ||
      !load(egl.bind_api, "eglBindAPI") || !load(egl.choose_config, "eglChooseConfig") ||
      !load(egl.create_context, "eglCreateContext") || !load(egl.destroy_context, "eglDestroyContext") ||
      !load(egl.make_current, "eglMakeCurrent"))
    return egl;
  egl.platform_display =
      reinterpret_cast<decltype(egl.platform_display)>(egl.get_proc("eglGetPlatformDisplayEXT"));
  egl.query_devices = reinterpret_cast<decltype(egl.query_devices)>(egl.get_proc("eglQueryDevicesEXT"));
  if (egl.platform_display == nullptr) return egl;
  std::array<Device, 16> devices{};
  Int count = 0;
  if (egl.query_devices != nullptr)
    egl.query_devices(static_cast<Int>(devices.size()), devices.data(), &count);
  const auto open = [&](unsigned platform, void* device) {
    const Display display = egl.platform_display(platform, device, nullptr);
    if (display != nullptr && egl.initialize(display, nullptr, nullptr) != 0) egl.displays.push_back(display);
  };
  for (Int i = 0; i < count; ++i) open(kPlatformDevice, devices[static_cast<std::size_t>(i)]);
  if (count == 0) open(kPlatformSurfaceless, nullptr);
  egl.usable = !egl.displays.empty();
  return egl;
}

const EglLibrary& egl() {
  static const EglLibrary library = load_egl();
  return library;
}

class EglContext final : public GlContext {
 public:
  explicit EglContext(Display display) : display_(display) {
    const std::array<Int, 5> wanted = {kSurfaceType, 0, kRenderableType, kOpenGlBit, kNone};
    Config config = nullptr;
    Int count = 0;
    const std::array<Int, 7> attributes = {kMajorVersion, 4,    kMinorVersion, 5, kProfileMask,
                                           kCoreProfile,  kNone};
    if (egl().bind_api(kOpenGlApi) != 0 &&
        egl().choose_config(display, wanted.data(), &config, 1, &count) != 0 && count > 0)
      handle_ = egl().create_context(display, config, nullptr, attributes.data());
    if (handle_ == nullptr)
      throw ResourceError("rasterizer: this EGL device gives no OpenGL 4.5 core context");
    try {
      make_current();
      load_gl_functions(gl_, egl().get_proc, "EGL");
    } catch (...) {
      egl().destroy_context(display_, handle_);
      throw;
    }
    gl_.GetIntegerv(GL_MAX_TEXTURE_SIZE, &max_texture_size_);
    description_ = std::string("EGL ") + reinterpret_cast<const char*>(gl_.GetString(GL_VERSION)) + ", " +
                   reinterpret_cast<const char*>(gl_.GetString(GL_RENDERER));
  }
  ~EglContext() override {
    egl().make_current(display_, nullptr, nullptr, nullptr);
    egl().destroy_context(display_, handle_);
  }

  void make_current() override {
    egl().bind_api(kOpenGlApi);
    if (egl().make_current(display_, nullptr, nullptr, handle_) == 0)
      throw ResourceError("rasterizer: EGL refuses to make its context current without a surface");
  }
  const GlFunctions& gl() const override { return gl_; }
  const std::string& description() const override { return description_; }
  int max_texture_size() const override { return max_texture_size_; }
  bool software() const override {
    for (const char* name : {"llvmpipe", "softpipe", "swrast"})
      if (description_.find(name) != std::string::npos) return true;
    return false;
  }

 private:
  Display display_;
  Context handle_ = nullptr;
  GlFunctions gl_;
  std::string description_;
  int max_texture_size_ = 0;
};

}  // namespace

std::unique_ptr<GlContext> find_egl_context(bool software_too) {
  if (!egl().usable) return nullptr;
  for (const Display display : egl().displays) {
    try {
      auto context = std::make_unique<EglContext>(display);
      if (software_too || !context->software()) return context;
    } catch (const ResourceError&) {
      continue;  // this device cannot; the next may
    }
  }
  return nullptr;
}

}  // namespace tessera
