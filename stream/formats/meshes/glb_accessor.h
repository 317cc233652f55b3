/// \file glb_accessor.h
/// Elements of glTF's accessors, streamed: plain, interleaved, sparse, quantised (KHR_mesh_quantization), or packed by
/// EXT_meshopt_compression, whose views are unpacked in memory, one after the other.
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/scalar.h"

namespace tessera {

/// Elements in a row, each `width` bytes wide.
struct GlbRun {
  std::optional<std::uint64_t>
      packed;                ///< number of the view that is to be unpacked; else they lie in the file
  std::uint64_t offset = 0;  ///< of the first: in the file, or in what the view unpacks to
  std::uint64_t stride = 0;
  std::uint64_t width = 0;
  std::uint64_t count = 0;
};

struct GlbAccessor {
  ScalarType type = ScalarType::kFloat32;
  int components = 1;
  bool normalized = false;  ///< whole numbers stand for shares of the largest one
  std::uint64_t count = 0;
  std::optional<GlbRun> base;  ///< none: zeros
  struct Sparse {
    GlbRun indices, values;  ///< elements that differ from the base, and what they are
    ScalarType index_type = ScalarType::kUint32;
  };
  std::optional<Sparse> sparse;

  /// Number k of an element, as the accessor means it.
  double number(const char* element, int k) const;
};

/// The binary chunk of a GLB with its views. For one thread at a time.
class GlbBuffers {
 public:
  /// \param begin, bytes  of the binary chunk; none: 0 bytes
  GlbBuffers(const ReadFile& file, std::uint64_t begin, std::uint64_t bytes);

  /// Everything about an accessor, checked against the ranges of view and chunk: what it describes is there.
  /// \throws InputError naming the accessor, what is wrong with it, or the extension that it needs
  GlbAccessor accessor(const Json& document, std::uint64_t index);

 private:
  friend class GlbElements;
  struct Packed {
    std::uint64_t offset = 0, bytes = 0;  ///< in the file
    std::uint64_t count = 0, stride = 0;
    std::string mode, filter;
  };
  using Bytes = std::shared_ptr<const std::vector<char>>;

  [[noreturn]] void fail(const std::string& what) const;
  GlbRun run(const Json& document, const Json& part, std::uint64_t width, std::uint64_t count,
             const std::string& what);
  void add_packed(std::uint64_t view, const Json& extension, const std::string& what);
  /// A range of the chunk. \throws InputError when it passes the end
  void require_in_chunk(std::uint64_t offset, std::uint64_t bytes, const std::string& what) const;
  Bytes unpacked(std::uint64_t view);

  const ReadFile* file_;
  std::uint64_t begin_, bytes_;
  std::map<std::uint64_t, Packed> packed_;               ///< by view
  std::vector<std::pair<std::uint64_t, Bytes>> lately_;  ///< unpacked, the newest last
};

/// The elements of an accessor in order.
class GlbElements {
 public:
  GlbElements(GlbBuffers& buffers, const GlbAccessor& accessor);
  /// Bytes of the next element, valid until the next call. \pre called at most accessor.count times
  /// \throws InputError for damage that only shows here: indices of a sparse accessor out of order, a view that does not unpack
  const char* next();

 private:
  struct Cursor {
    std::optional<ByteWindow> window;
    GlbBuffers::Bytes bytes;
    std::uint64_t at = 0, stride = 0, width = 0, left = 0;
    Cursor() = default;
    Cursor(GlbBuffers& buffers, const GlbRun& run);
    const char* next();
  };
  void next_sparse();

  GlbBuffers* buffers_;
  GlbAccessor accessor_;
  Cursor base_, indices_, values_;
  std::uint64_t element_ = 0;
  std::optional<std::uint64_t> sparse_;  ///< the next element that differs
};

}  // namespace tessera
