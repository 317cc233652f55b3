/// \file rasterizer.h
/// An offscreen OpenGL 4.5 core context behind one interface, and the few helpers every user of it needs.
/// It is OSMesa's (software, always there), so that pictures are the same everywhere. The library is loaded when the
/// first context is wanted, so a process that never rasterizes does not map LLVM. A context belongs to the thread that made
/// it; make one per thread.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

namespace tessera {

struct GlFunctions;

class GlContext {
 public:
  virtual ~GlContext() = default;  ///< frees every GL object made in it
  /// Makes it current on the calling thread; needed again only after another context was made current.
  virtual void make_current() = 0;
  [[nodiscard]] virtual const GlFunctions& gl() const = 0;
  [[nodiscard]] virtual const std::string& description()
      const = 0;  ///< "OSMesa 4.5 ... llvmpipe (LLVM 15.0.6, 256 bits)"
  [[nodiscard]] virtual int max_texture_size() const = 0;
};

/// A new context, current on this thread. Costs about 60 MB of RSS the first time in a process.
/// \throws ResourceError when the library or a 4.5 core context is missing, naming the package to install
[[nodiscard]] std::unique_ptr<GlContext> create_gl_context();

/// Whether the library is in this process already, and what it costs with it.
[[nodiscard]] bool rasterizer_loaded();

/// Loads every function. \throws ResourceError naming `library` and the first that is missing
void load_gl_functions(GlFunctions& gl, void (*(*get_proc)(const char*))(), const std::string& library);

/// Compiles and links; the sources are ours, so a failure is a bug and throws std::logic_error with the log.
[[nodiscard]] std::uint32_t link_gl_program(const GlFunctions& gl, const std::string& name,
                                            const std::string& vertex_source,
                                            const std::string& fragment_source);

/// Empty 2D texture, nearest filtering, clamped. `format` is a sized internal format.
/// \throws ResourceError when GL has no memory for it
[[nodiscard]] std::uint32_t create_gl_texture(const GlFunctions& gl, std::uint32_t format, int width,
                                              int height);

/// Location of a uniform that the linked program uses. A wrong name is a bug: std::logic_error.
[[nodiscard]] int gl_uniform(const GlFunctions& gl, std::uint32_t program, const char* name);

}  // namespace tessera
