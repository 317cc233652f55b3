// Sources: Khronos, glTF 2.0, sections 3.6 and 5.1; KHR_mesh_quantization; EXT_meshopt_compression (its codecs are
// meshoptimizer's, which are safe for bytes of any kind).
#include "stream/formats/meshes/glb_accessor.h"

#include <algorithm>

#include <meshoptimizer.h>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/glb_document.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxStride = 256;
constexpr std::uint64_t kMaxUnpacked = std::uint64_t{256} << 20;  ///< bytes of one view, and of views kept
constexpr std::size_t kMaxKept = 4;                               ///< views
constexpr const char* kMeshopt = "EXT_meshopt_compression";
constexpr char kZeros[32] = {};

std::optional<ScalarType> component_type(int number) {
  switch (number) {
    case 5120:
      return ScalarType::kInt8;
    case 5121:
      return ScalarType::kUint8;
    case 5122:
      return ScalarType::kInt16;
    case 5123:
      return ScalarType::kUint16;
    case 5125:
      return ScalarType::kUint32;
    case 5126:
      return ScalarType::kFloat32;
    default:
      return std::nullopt;
  }
}

int component_count(const std::string& shape) {
  return shape == "SCALAR" ? 1 : shape == "VEC2" ? 2 : shape == "VEC3" ? 3 : shape == "VEC4" ? 4 : 0;
}

bool is_index_type(std::optional<ScalarType> type) {
  return type == ScalarType::kUint8 || type == ScalarType::kUint16 || type == ScalarType::kUint32;
}

/// The extension of a view that packs it, if one does.
const Json* meshopt_of(const Json& view) {
  if (!view.contains("extensions") || !view.at("extensions").contains(kMeshopt)) return nullptr;
  return &view.at("extensions").at(kMeshopt);
}

/// Whether so many bytes can unpack to what is claimed: vertices take two bits for 16 values, a triangle or an index a byte.
bool plausible(const std::string& mode, std::uint64_t count, std::uint64_t stride, std::uint64_t bytes) {
  return count / (mode == "ATTRIBUTES"  ? 64
                  : mode == "TRIANGLES" ? 3
                                        : 1) <=
         bytes / (mode == "ATTRIBUTES" ? stride : 1);
}

bool is_filter(const std::string& filter) {
  return filter == "NONE" || filter == "EXPONENTIAL" || filter == "OCTAHEDRAL" || filter == "QUATERNION";
}

bool fits_filter(const std::string& filter, std::uint64_t stride) {
  return filter == "OCTAHEDRAL" ? stride == 4 || stride == 8 : filter != "QUATERNION" || stride == 8;
}

}  // namespace

double GlbAccessor::number(const char* element, int k) const {
  const double value = load_double(type, false, element + static_cast<std::size_t>(k) * scalar_bytes(type));
  if (!normalized) return value;
  switch (type) {
    case ScalarType::kInt8:
      return std::max(value / 127.0, -1.0);
    case ScalarType::kUint8:
      return value / 255.0;
    case ScalarType::kInt16:
      return std::max(value / 32767.0, -1.0);
    case ScalarType::kUint16:
      return value / 65535.0;
    case ScalarType::kUint32:
      return value / 4294967295.0;
    default:
      return value;
  }
}

GlbBuffers::GlbBuffers(const ReadFile& file, std::uint64_t begin, std::uint64_t bytes)
    : file_(&file), begin_(begin), bytes_(bytes) {}

void GlbBuffers::fail(const std::string& what) const {
  throw InputError(file_->path().string() + ": " + what);
}

void GlbBuffers::require_in_chunk(std::uint64_t offset, std::uint64_t bytes, const std::string& what) const {
  if (offset <= bytes_ && bytes <= bytes_ - offset) return;
  fail(what + " passes the end of the binary chunk; the file is damaged");
}

void GlbBuffers::add_packed(std::uint64_t view, const Json& extension, const std::string& what) {
  Packed packed;
  packed.offset = extension.value("byteOffset", std::uint64_t{0});
  packed.bytes = extension.at("byteLength").get<std::uint64_t>();
  packed.count = extension.at("count").get<std::uint64_t>();
  packed.stride = extension.at("byteStride").get<std::uint64_t>();
  packed.mode = extension.at("mode").get<std::string>();
  packed.filter = extension.value("filter", std::string("NONE"));
  if (extension.value("buffer", std::uint64_t{0}) != 0)
    fail("the glTF data lies in another file; export it as one GLB");
  require_in_chunk(packed.offset, packed.bytes, what);
  const bool vertices = packed.mode == "ATTRIBUTES",
             indices = packed.mode == "TRIANGLES" || packed.mode == "INDICES";
  if (!(vertices && is_filter(packed.filter)) && !(indices && packed.filter == "NONE"))
    fail(what + " is packed by " + kMeshopt + " with mode " + packed.mode + " and filter " + packed.filter +
         ", which are not read; export it without compression");
  const bool sound = vertices ? packed.stride > 0 && packed.stride % 4 == 0 && packed.stride <= kMaxStride &&
                                    fits_filter(packed.filter, packed.stride)
                              : (packed.stride == 2 || packed.stride == 4) &&
                                    (packed.mode == "INDICES" || packed.count % 3 == 0);
  if (!sound || !plausible(packed.mode, packed.count, packed.stride, packed.bytes))
    fail(what + " is packed by " + kMeshopt + " with counts that do not fit each other; the file is damaged");
  if (packed.count * packed.stride > kMaxUnpacked)
    fail(what + " unpacks to more than " + std::to_string(kMaxUnpacked >> 20) +
         " MiB; export it without compression, or in parts");
  packed.offset += begin_;
  packed_[view] = std::move(packed);
}

GlbRun GlbBuffers::run(const Json& document, const Json& part, std::uint64_t width, std::uint64_t count,
                       const std::string& what) {
  const auto index = part.at("bufferView").get<std::uint64_t>();
  const Json& view = glb_item(document, "bufferViews", index, file_->path().string());
  GlbRun run;
  run.width = width;
  run.count = count;
  run.stride = view.value("byteStride", width);
  const std::uint64_t in_view = part.value("byteOffset", std::uint64_t{0});
  const auto view_bytes = view.at("byteLength").get<std::uint64_t>();
  std::uint64_t stored = view_bytes;
  if (const Json* extension = meshopt_of(view); extension != nullptr) {
    add_packed(index, *extension, what);
    const Packed& packed = packed_.at(index);
    run.packed = index;
    run.offset = in_view;
    stored = std::min(stored, packed.count * packed.stride);
  } else {
    const auto buffer = view.value("buffer", std::uint64_t{0});
    if (buffer != 0 || glb_item(document, "buffers", buffer, file_->path().string()).contains("uri"))
      fail("the glTF data lies in another file; export it as one GLB");
    const std::uint64_t in_chunk = view.value("byteOffset", std::uint64_t{0});
    require_in_chunk(in_chunk, view_bytes, what);
    run.offset = begin_ + in_chunk + in_view;
  }
  const bool fits =
      width > 0 && run.stride >= width && run.stride <= kMaxStride && in_view <= stored &&
      (count == 0 || (stored - in_view >= width && count - 1 <= (stored - in_view - width) / run.stride));
  if (!fits) fail(what + " passes the end of its buffer view; the file is damaged");
  return run;
}

GlbAccessor GlbBuffers::accessor(const Json& document, std::uint64_t index) {
  const Json& a = glb_item(document, "accessors", index, file_->path().string());
  const std::string what = "accessor " + std::to_string(index);
  GlbAccessor found;
  const auto type = component_type(a.at("componentType").get<int>());
  if (!type) fail(what + " has a component type that glTF does not know");
  found.type = *type;
  found.components = component_count(a.at("type").get<std::string>());
  if (found.components == 0) fail(what + " holds neither numbers nor vectors, which meshes do not use");
  found.normalized = a.value("normalized", false);
  found.count = a.at("count").get<std::uint64_t>();
  const std::uint64_t width = scalar_bytes(found.type) * static_cast<std::uint64_t>(found.components);
  if (a.contains("bufferView")) found.base = run(document, a, width, found.count, what);
  if (!a.contains("sparse")) {
    if (!found.base) fail(what + " has no data");
    return found;
  }
  // What a face uses costs at least a byte of the file, so zeros beyond that are a claim of damaged files.
  if (!found.base && found.count > file_->size())
    fail(what + " claims " + std::to_string(found.count) + " elements, more than the file has bytes");
  const Json& sparse = a.at("sparse");
  const auto count = sparse.at("count").get<std::uint64_t>();
  const Json& indices = sparse.at("indices");
  const auto index_type = component_type(indices.at("componentType").get<int>());
  if (!is_index_type(index_type))
    fail(what + ": indices of a sparse accessor must be whole numbers without sign");
  if (count > found.count) fail(what + " changes more elements than it has; the file is damaged");
  found.sparse = {run(document, indices, scalar_bytes(*index_type), count, what),
                  run(document, sparse.at("values"), width, count, what), *index_type};
  return found;
}

GlbBuffers::Bytes GlbBuffers::unpacked(std::uint64_t view) {
  const auto known =
      std::find_if(lately_.begin(), lately_.end(), [&](const auto& v) { return v.first == view; });
  if (known != lately_.end()) {
    std::rotate(known, known + 1, lately_.end());
    return lately_.back().second;
  }
  const Packed& p = packed_.at(view);
  std::vector<unsigned char> bytes(p.bytes);
  file_->read_at(p.offset, bytes.data(), p.bytes);
  const auto out = std::make_shared<std::vector<char>>(p.count * p.stride);
  int error = 0;
  if (p.mode == "ATTRIBUTES")
    error = meshopt_decodeVertexBuffer(out->data(), p.count, p.stride, bytes.data(), bytes.size());
  else if (p.mode == "TRIANGLES")
    error = meshopt_decodeIndexBuffer(out->data(), p.count, p.stride, bytes.data(), bytes.size());
  else
    error = meshopt_decodeIndexSequence(out->data(), p.count, p.stride, bytes.data(), bytes.size());
  if (error != 0)
    fail("byte " + std::to_string(p.offset) + ": buffer view " + std::to_string(view) +
         " does not unpack by " + kMeshopt + "; the file is damaged, or packed by a newer version of it");
  if (p.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out->data(), p.count, p.stride);
  if (p.filter == "QUATERNION") meshopt_decodeFilterQuat(out->data(), p.count, p.stride);
  if (p.filter == "EXPONENTIAL") meshopt_decodeFilterExp(out->data(), p.count, p.stride);
  // Exporters put the vertices of many primitives into one view: the last ones are kept.
  lately_.emplace_back(view, out);
  const auto stored = [&] {
    std::size_t sum = 0;
    for (const auto& [number, kept] : lately_) sum += kept->size();
    return sum;
  };
  while (lately_.size() > 1 && (lately_.size() > kMaxKept || stored() > kMaxUnpacked))
    lately_.erase(lately_.begin());
  return out;
}

GlbElements::Cursor::Cursor(GlbBuffers& buffers, const GlbRun& run)
    : at(run.offset), stride(run.stride), width(run.width), left(run.count) {
  if (run.packed) {
    bytes = buffers.unpacked(*run.packed);
    return;
  }
  const std::uint64_t end =
      run.count == 0 ? run.offset : run.offset + (run.count - 1) * run.stride + run.width;
  window.emplace(*buffers.file_, run.offset, end, ByteWindow::kDefaultCapacity / 4);
}

const char* GlbElements::Cursor::next() {
  --left;
  if (bytes) {
    const char* element = bytes->data() + at;
    at += stride;
    return element;
  }
  if (at > window->offset()) window->skip(at - window->offset());
  at += stride;
  return window->peek(width).data();
}

GlbElements::GlbElements(GlbBuffers& buffers, const GlbAccessor& accessor)
    : buffers_(&buffers), accessor_(accessor) {
  if (accessor_.base) base_ = Cursor(buffers, *accessor_.base);
  if (!accessor_.sparse) return;
  indices_ = Cursor(buffers, accessor_.sparse->indices);
  values_ = Cursor(buffers, accessor_.sparse->values);
  next_sparse();
}

void GlbElements::next_sparse() {
  if (indices_.left == 0) {
    sparse_.reset();
    return;
  }
  const std::uint64_t next = load_integer(accessor_.sparse->index_type, false, indices_.next());
  if (next >= accessor_.count || next < element_)
    buffers_->fail("a sparse accessor has the index " + std::to_string(next) + " of " +
                   std::to_string(accessor_.count) + " out of order or range; the file is damaged");
  sparse_ = next;
}

const char* GlbElements::next() {
  const char* element = accessor_.base ? base_.next() : kZeros;
  if (sparse_ == element_++) {
    element = values_.next();
    next_sparse();
  }
  return element;
}

}  // namespace tessera
