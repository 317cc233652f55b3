#include "stream/formats/meshes/glb_document.h"

#include <cstddef>
#include <iterator>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxDepth = 64;
constexpr std::size_t kMaxValues = 400000;  ///< kept; about 120 bytes each with key and node
constexpr std::size_t kMaxRun = std::size_t{4}
                                << 20;  ///< bytes of a text, or without any: the lexer keeps them

/// Everything that GlbMeshReader and GlbTextures ask for.
const std::set<std::string, std::less<>>& known_keys() {
  static const std::set<std::string, std::less<>> keys = {"COLOR_0",
                                                          "EXT_mesh_gpu_instancing",
                                                          "EXT_meshopt_compression",
                                                          "KHR_draco_mesh_compression",
                                                          "POSITION",
                                                          "ROTATION",
                                                          "SCALE",
                                                          "NORMAL",
                                                          "TEXCOORD_0",
                                                          "TRANSLATION",
                                                          "accessors",
                                                          "asset",
                                                          "attributes",
                                                          "baseColorTexture",
                                                          "buffer",
                                                          "bufferView",
                                                          "bufferViews",
                                                          "buffers",
                                                          "byteLength",
                                                          "byteOffset",
                                                          "byteStride",
                                                          "children",
                                                          "componentType",
                                                          "count",
                                                          "extensions",
                                                          "extensionsRequired",
                                                          "filter",
                                                          "generator",
                                                          "images",
                                                          "index",
                                                          "indices",
                                                          "material",
                                                          "materials",
                                                          "matrix",
                                                          "mesh",
                                                          "meshes",
                                                          "mode",
                                                          "nodes",
                                                          "normalized",
                                                          "pbrMetallicRoughness",
                                                          "primitives",
                                                          "rotation",
                                                          "scale",
                                                          "scene",
                                                          "scenes",
                                                          "skin",
                                                          "source",
                                                          "sparse",
                                                          "tessera_shift",
                                                          "textures",
                                                          "translation",
                                                          "type",
                                                          "values"};
  return keys;
}

/// What the lexer gets: characters of the chunk, and an end to tokens that never end.
struct Bytes {
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = char;

  ByteWindow* window = nullptr;  ///< nullptr: the end
  std::size_t* run = nullptr;    ///< bytes since the last text or number
  const std::string* name = nullptr;

  char operator*() const { return window->peek(1).front(); }
  Bytes& operator++() {
    window->peek(1);
    if (++*run > kMaxRun)
      throw InputError(*name + ": byte " + std::to_string(window->offset()) +
                       ": the JSON chunk has a text of more than 4 MiB, or as much without any; export the "
                       "data into the binary chunk");
    window->skip(1);
    return *this;
  }
  Bytes operator++(int) {
    Bytes old = *this;
    ++*this;
    return old;
  }
  bool at_end() const { return window == nullptr || window->remaining() == 0; }
  bool operator==(const Bytes& other) const { return at_end() == other.at_end(); }
  bool operator!=(const Bytes& other) const { return !(*this == other); }
};

/// Builds the document without what nobody asks for.
class Pruner : public nlohmann::json_sax<nlohmann::json> {
 public:
  Pruner(ByteWindow& window, const std::string& name) : window_(window), name_(name) {}

  Json root;
  std::size_t run = 0;

  bool null() override { return value(nullptr); }
  bool boolean(bool v) override { return value(v); }
  bool number_integer(number_integer_t v) override { return counted(v); }
  bool number_unsigned(number_unsigned_t v) override { return counted(v); }
  bool number_float(number_float_t v, const string_t&) override { return counted(v); }
  bool string(string_t& v) override { return counted(v); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(Json::object()); }
  bool start_array(std::size_t) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

  bool key(string_t& k) override {
    run = 0;
    if (skipped_ > 0) return true;
    // That they are there is all that is asked of these.
    if (k == "targets" || k == "uri") {
      keep_key(k);
      insert(nullptr);
      drop_ = true;
      return true;
    }
    const bool own_extras = k == "extras" && names_.size() == 2 && names_.back() == "asset";
    drop_ = !own_extras && known_keys().count(k) == 0;
    if (!drop_) keep_key(k);
    return true;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(name_ + ": byte " + std::to_string(window_.offset()) + ": the JSON chunk " + what);
  }
  void keep_key(const std::string& k) { key_ = k; }

  bool counted(Json v) {
    run = 0;
    return value(std::move(v));
  }
  bool value(Json v) {
    if (skipped_ > 0) return true;
    if (!std::exchange(drop_, false)) insert(std::move(v));
    return true;
  }
  bool open(Json v) {
    if (++depth_ > kMaxDepth) fail("nests deeper than " + std::to_string(kMaxDepth) + " levels");
    if (skipped_ > 0 || std::exchange(drop_, false)) {
      ++skipped_;
      return true;
    }
    names_.push_back(open_.empty() || open_.back()->is_array() ? "" : key_);
    open_.push_back(insert(std::move(v)));
    return true;
  }
  bool close() {
    --depth_;
    if (skipped_ > 0) {
      --skipped_;
      return true;
    }
    names_.pop_back();
    open_.pop_back();
    return true;
  }
  Json* insert(Json v) {
    if (++values_ > kMaxValues)
      fail("describes more than " + std::to_string(kMaxValues) +
           " values of meshes and nodes: join the meshes before exporting them");
    if (open_.empty()) return &(root = std::move(v));
    Json& parent = *open_.back();
    if (parent.is_array()) {
      parent.push_back(std::move(v));
      return &parent.back();
    }
    return &(parent[key_] = std::move(v));
  }

  ByteWindow& window_;
  const std::string& name_;
  std::vector<Json*> open_;  ///< kept objects and lists around the value at hand
  std::vector<std::string> names_;
  std::string key_;
  bool drop_ = false;        ///< the value that comes is not asked for
  std::size_t skipped_ = 0;  ///< levels within one that is not
  std::size_t depth_ = 0, values_ = 0;
};

}  // namespace

void require_glb_version(std::uint64_t version, const std::string& name) {
  if (version != 2)
    throw InputError(name + ": glTF version " + std::to_string(version) +
                     " is not read; convert it to version 2");
}

const Json& glb_item(const Json& document, const char* list, std::uint64_t index, const std::string& name) {
  if (!document.contains(list) || !document.at(list).is_array() || index >= document.at(list).size())
    throw InputError(name + ": the glTF document names " + list + " " + std::to_string(index) +
                     ", which does not exist");
  return document.at(list)[index];
}

Json read_glb_document(ByteWindow bytes, const std::string& name) {
  const std::uint64_t begin = bytes.offset();
  Pruner pruner(bytes, name);
  const bool whole = nlohmann::json::sax_parse(Bytes{&bytes, &pruner.run, &name}, Bytes{}, &pruner);
  if (!whole || !pruner.root.is_object())
    throw InputError(name + ": byte " + std::to_string(begin) + ": the JSON chunk is not valid");
  return std::move(pruner.root);
}

}  // namespace tessera
