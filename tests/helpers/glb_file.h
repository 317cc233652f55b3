/// \file glb_file.h
/// GLB files made part by part, with whatever accessors a test asks for.
#pragma once
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/json.h"

namespace tessera::test {

/// Numbers as bytes, one after the other.
template <class To, class From>
std::string packed_numbers(const std::vector<From>& numbers) {
  std::string bytes;
  for (const From& number : numbers) {
    const To value = static_cast<To>(number);
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  return bytes;
}

class GlbFile {
 public:
  /// Returns the view's number.
  std::size_t view(const std::string& bytes, std::size_t stride = 0) {
    bin_.resize((bin_.size() + 3) / 4 * 4, '\0');
    tessera::Json v = {{"buffer", 0}, {"byteOffset", bin_.size()}, {"byteLength", bytes.size()}};
    if (stride > 0) v["byteStride"] = stride;
    bin_ += bytes;
    views_.push_back(std::move(v));
    return views_.size() - 1;
  }
  /// A view that EXT_meshopt_compression packs. \param packed  what its codec made of `count` elements
  std::size_t packed_view(const std::string& packed, std::size_t count, std::size_t stride,
                          const std::string& mode, const std::string& filter = "NONE") {
    view(packed);
    tessera::Json extension = views_.back();
    extension.update({{"count", count}, {"byteStride", stride}, {"mode", mode}, {"filter", filter}});
    views_.back() = {{"buffer", 1},
                     {"byteLength", count * stride},
                     {"extensions", {{"EXT_meshopt_compression", std::move(extension)}}}};
    return views_.size() - 1;
  }
  /// Returns the accessor's number. \param more  what it has besides
  std::size_t accessor(std::size_t view, int type, std::size_t count, const std::string& shape,
                       const tessera::Json& more = tessera::Json::object()) {
    accessors_.push_back({{"bufferView", view}, {"componentType", type}, {"count", count}, {"type", shape}});
    accessors_.back().update(more);
    return accessors_.size() - 1;
  }
  std::size_t floats(const std::vector<Double3>& points) {
    std::vector<double> flat;
    for (const Double3& p : points) flat.insert(flat.end(), p.begin(), p.end());
    return accessor(view(packed_numbers<float>(flat)), 5126, points.size(), "VEC3");
  }
  std::size_t indices(const std::vector<std::uint32_t>& corners) {
    return accessor(view(packed_numbers<std::uint16_t>(corners)), 5123, corners.size(), "SCALAR");
  }
  tessera::Json& last_accessor() { return accessors_.back(); }
  tessera::Json& last_view() { return views_.back(); }

  /// \param nodes  all of the scene; none: one with the mesh  \param more  at the top of the document
  std::string bytes(const tessera::Json& primitives,
                    const tessera::Json& nodes = tessera::Json::array({{{"mesh", 0}}}),
                    const tessera::Json& more = tessera::Json::object()) const {
    tessera::Json scene = tessera::Json::array();
    for (std::size_t i = 0; i < nodes.size(); ++i) scene.push_back(i);
    tessera::Json all = {{"asset", {{"version", "2.0"}}},
                         {"scene", 0},
                         {"scenes", {{{"nodes", scene}}}},
                         {"nodes", nodes},
                         {"meshes", {{{"primitives", primitives}}}},
                         {"accessors", accessors_},
                         {"bufferViews", views_},
                         {"buffers", {{{"byteLength", bin_.size()}}, {{"byteLength", 0}}}}};
    all.update(more);
    std::string text = tessera::dump_json(all), bin = bin_;
    text.resize((text.size() + 3) / 4 * 4, ' ');
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    return "glTF" + words({2, 28 + text.size() + bin.size(), text.size()}) + "JSON" + text +
           words({bin.size()}) + std::string("BIN\0", 4) + bin;
  }

 private:
  static std::string words(const std::vector<std::size_t>& numbers) {
    return packed_numbers<std::uint32_t>(numbers);
  }
  tessera::Json views_ = tessera::Json::array(), accessors_ = tessera::Json::array();
  std::string bin_;
};

}  // namespace tessera::test
