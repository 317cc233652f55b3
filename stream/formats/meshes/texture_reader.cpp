#include "stream/formats/meshes/texture_reader.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/meshes/glb_accessor.h"
#include "stream/formats/meshes/glb_document.h"
#include "stream/formats/ply_header.h"
#include "stream/formats/text_scanner.h"

namespace tessera {
namespace {

constexpr std::size_t kTextureBatch = 4096;
using Float2 = std::array<float, 2>;
using TextureSink = std::function<void(std::span<const FaceTexture>)>;

/// Hands on what comes one by one.
class TextureBatch {
 public:
  explicit TextureBatch(const TextureSink& sink) : sink_(sink) { batch_.reserve(kTextureBatch); }
  void add(const FaceTexture& face) {
    batch_.push_back(face);
    if (batch_.size() == kTextureBatch) flush();
  }
  void flush() {
    if (!batch_.empty()) sink_(batch_);
    batch_.clear();
  }

 private:
  const TextureSink& sink_;
  std::vector<FaceTexture> batch_;
};

TexturePage page_beside(const std::filesystem::path& mesh, const std::string& name) {
  TexturePage page{name, mesh.parent_path() / name, 0, 0};
  std::error_code error;
  if (std::filesystem::is_regular_file(page.file, error))
    page.bytes = std::filesystem::file_size(page.file, error);
  return page;
}

[[noreturn]] void refuse_polygons(const std::string& where) {
  throw InputError(where + ": a face of more than three corners has a texture; triangulate the mesh first");
}

class ObjTextures : public TextureReader {
 public:
  ObjTextures(const std::filesystem::path& path, std::uint64_t max_bytes)
      : file_(path), max_bytes_(max_bytes) {
    find_pages(path);
  }

  void read(const TextureSink& sink) override {
    std::vector<Float2> places;
    TextureBatch batch(sink);
    std::uint32_t page = kNoPage;
    TextScanner text(file_, byte_order_mark(file_), 1, '\n', '#');
    do {
      const std::string_view keyword = text.word_in_line();
      if (keyword == "vt") {
        if (places.size() * sizeof(Float2) >= max_bytes_)
          throw ResourceError(text.where() + ": more texture coordinates than " +
                              std::to_string(max_bytes_ >> 20) + " MiB hold; give more --memory");
        Float2 at{};
        for (float& x : at) x = static_cast<float>(text.number("a texture coordinate", true));
        places.push_back(at);
      } else if (keyword == "usemtl") {
        const auto known = materials_.find(std::string(text.word_in_line()));
        page = known == materials_.end() ? kNoPage : known->second;
      } else if (keyword == "f") {
        batch.add(face_of(text, places, page));
      }
    } while (text.next_line());
    batch.flush();
  }

  bool has_coordinates() {
    TextScanner text(file_, byte_order_mark(file_), 1, '\n', '#');
    bool faces = false;
    do {
      const std::string_view keyword = text.word_in_line();
      if (keyword == "vt") return true;
      if (keyword == "f") {
        if (faces) continue;
        faces = true;
        if (text.word_in_line().find('/') == std::string_view::npos) return false;
      }
    } while (text.next_line());
    return false;
  }

 private:
  static FaceTexture face_of(TextScanner& text, const std::vector<Float2>& places, std::uint32_t page) {
    FaceTexture face;
    face.page = page;
    std::size_t k = 0;
    for (std::string_view corner = text.word_in_line(); !corner.empty(); corner = text.word_in_line(), ++k) {
      if (k == 3) refuse_polygons(text.where());
      const std::size_t slash = corner.find('/');
      if (slash == std::string_view::npos || slash + 1 == corner.size() || corner[slash + 1] == '/') {
        face.page = kNoPage;
        continue;
      }
      std::int64_t index = 0;
      const char* begin = corner.data() + slash + 1;
      const auto [end, error] = std::from_chars(begin, corner.data() + corner.size(), index);
      const auto at = static_cast<std::uint64_t>(
          index > 0 ? index - 1 : static_cast<std::int64_t>(places.size()) + index);
      if (error != std::errc() || index == 0 || at >= places.size())
        throw InputError(text.where() + ": '" + std::string(corner.substr(0, 40)) +
                         "' names no texture coordinate that stands before it");
      face.uv[k] = {static_cast<double>(places[at][0]), static_cast<double>(places[at][1])};
    }
    return face;
  }

  void find_pages(const std::filesystem::path& path) {
    TextScanner text(file_, byte_order_mark(file_), 1, '\n', '#');
    do {
      const std::string_view keyword = text.word_in_line();
      if (keyword == "v" || keyword == "f") return;
      if (keyword == "mtllib") read_materials(path, std::string(text.word_in_line()));
    } while (text.next_line());
  }
  void read_materials(const std::filesystem::path& path, const std::string& name) {
    const std::filesystem::path library = path.parent_path() / name;
    std::error_code error;
    if (!std::filesystem::is_regular_file(library, error)) {
      pages_.push_back({name, library, 0, 0});
      return;
    }
    const ReadFile file(library);
    TextScanner text(file, byte_order_mark(file), 1, '\n', '#');
    std::string material;
    do {
      const std::string_view keyword = text.word_in_line();
      if (keyword == "newmtl") material = text.word_in_line();
      if (keyword != "map_Kd") continue;
      std::string picture;  // options stand before it
      for (std::string_view word = text.word_in_line(); !word.empty(); word = text.word_in_line())
        picture = word;
      materials_[material] = static_cast<std::uint32_t>(pages_.size());
      pages_.push_back(page_beside(path, picture));
    } while (text.next_line());
  }

  ReadFile file_;
  std::uint64_t max_bytes_;
  std::map<std::string, std::uint32_t> materials_;
};

class PlyTextures : public TextureReader {
 public:
  PlyTextures(const std::filesystem::path& path, PlyHeader header) : file_(path), ply_(std::move(header)) {
    for (const std::string& comment : ply_.comments)
      if (comment.starts_with("TextureFile ")) pages_.push_back(page_beside(path, comment.substr(12)));
  }
  static bool has_coordinates(const PlyHeader& ply) {
    const int face = ply.find("face");
    return face >= 0 && ply.elements[static_cast<std::size_t>(face)].find("texcoord") >= 0;
  }

  void read(const TextureSink& sink) override {
    const std::string name = file_.path().string();
    if (ply_.encoding == PlyEncoding::kAscii)
      throw InputError(name + ": texture coordinates of PLY are read from binary files only; convert it");
    ByteWindow window(file_, ply_.data_begin, file_.size());
    const auto face = static_cast<std::size_t>(ply_.find("face"));
    for (std::size_t e = 0; e < face; ++e)
      skip_ply_elements(ply_.elements[e], ply_.big_endian(), ply_.elements[e].count, window);
    TextureBatch batch(sink);
    const PlyElement& element = ply_.elements[face];
    for (std::uint64_t f = 0; f < element.count; ++f) batch.add(face_of(element, window));
    batch.flush();
  }

 private:
  const char* take(ByteWindow& window, std::size_t bytes) const {
    const std::string_view seen = window.peek(bytes);
    if (seen.size() < bytes)
      throw InputError(file_.path().string() + ": byte " + std::to_string(window.offset()) +
                       ": the file ends within a face");
    return seen.data();
  }

  FaceTexture face_of(const PlyElement& element, ByteWindow& window) const {
    const bool swap = ply_.big_endian();
    FaceTexture face;
    bool textured = false;
    for (const PlyProperty& p : element.properties) {
      const std::size_t bytes = scalar_bytes(p.type);
      std::uint64_t count = 1;
      if (p.list) {
        count = load_integer(p.count_type, swap, take(window, scalar_bytes(p.count_type)));
        window.skip(scalar_bytes(p.count_type));
      }
      if (p.list && (p.name == "vertex_indices" || p.name == "vertex_index") && count != 3)
        refuse_polygons(file_.path().string());
      if (p.name == "texcoord" && count == 6) {
        const char* at = take(window, 6 * bytes);
        for (std::size_t k = 0; k < 6; ++k) face.uv[k / 2][k % 2] = load_double(p.type, swap, at + k * bytes);
        textured = true;
      }
      if (p.name == "texnumber")
        face.page = static_cast<std::uint32_t>(load_double(p.type, swap, take(window, bytes)));
      window.skip(count * bytes);
    }
    if (!textured) face.page = kNoPage;
    return face;
  }

  ReadFile file_;
  PlyHeader ply_;
};

class GlbTextures : public TextureReader {
 public:
  GlbTextures(const std::filesystem::path& path, std::uint64_t max_bytes)
      : file_(path), max_bytes_(max_bytes) {
    const auto word = [&](std::uint64_t at) {
      char bytes[4];
      file_.read_at(at, bytes, sizeof bytes);
      return std::uint64_t{load_scalar<std::uint32_t>(bytes)};
    };
    const std::string name = path.string();
    if (file_.size() < 20 || word(0) != 0x46546c67) throw InputError(name + ": is no binary glTF");
    require_glb_version(word(4), name);
    const std::uint64_t json = word(12);
    if (20 + json > file_.size()) throw InputError(name + ": ends within its JSON chunk");
    document_ = read_glb_document(ByteWindow(file_, 20, 20 + json), name);
    const bool has_bin = 28 + json <= file_.size();
    bin_ = 28 + json;
    buffers_ = std::make_unique<GlbBuffers>(file_, has_bin ? bin_ : 0,
                                            has_bin ? std::min(word(20 + json), file_.size() - bin_) : 0);
    try {
      find_primitives();
    } catch (const JsonError& e) {  // a wrong type somewhere in the document
      throw InputError(name + ": the glTF document is not valid (" + e.what() + ")");
    }
  }
  bool has_coordinates() const {
    return std::any_of(primitives_.begin(), primitives_.end(),
                       [](const Primitive& p) { return p.places.has_value(); });
  }

  void read(const TextureSink& sink) override {
    if (several_)
      throw InputError(
          file_.path().string() +
          ": its texture coordinates are those of several nodes or meshes; join them to one first");
    TextureBatch batch(sink);
    for (const Primitive& p : primitives_) {
      std::vector<Float2> places;
      if (p.places) {
        if (p.places->count * sizeof(Float2) > max_bytes_)
          throw ResourceError(file_.path().string() + ": its texture coordinates take " +
                              std::to_string(p.places->count * sizeof(Float2) >> 20) +
                              " MiB: give more --memory");
        GlbElements elements(*buffers_, *p.places);
        for (std::uint64_t i = 0; i < p.places->count; ++i) {
          const char* at = elements.next();
          places.push_back(
              {static_cast<float>(p.places->number(at, 0)), static_cast<float>(p.places->number(at, 1))});
        }
      }
      read_faces(p, places, batch);
    }
    batch.flush();
  }

 private:
  struct Primitive {
    std::optional<GlbAccessor> places, indices;
    std::uint64_t vertices = 0;
    std::uint32_t page = kNoPage;
  };

  void read_faces(const Primitive& p, const std::vector<Float2>& places, TextureBatch& batch) {
    std::optional<GlbElements> indices;
    if (p.indices) indices.emplace(*buffers_, *p.indices);
    const std::uint64_t corners = p.indices ? p.indices->count : p.vertices;
    for (std::uint64_t f = 0; f < corners / 3; ++f) {
      FaceTexture face;
      face.page = places.empty() ? kNoPage : p.page;
      for (std::size_t k = 0; k < 3; ++k) {
        std::uint64_t at = 3 * f + k;
        if (indices) at = load_integer(p.indices->type, false, indices->next());
        if (places.empty()) continue;
        if (at >= places.size())
          throw InputError(file_.path().string() + ": a face names vertex " + std::to_string(at) + " of " +
                           std::to_string(places.size()));
        face.uv[k] = {static_cast<double>(places[at][0]), 1.0 - static_cast<double>(places[at][1])};
      }
      batch.add(face);
    }
  }

  void find_primitives() {
    const std::string name = file_.path().string();
    const Json images = document_.value("images", Json::array());
    // Pages are what shows colours; maps of normals and the like are no pages of their own.
    std::set<std::uint32_t> colours;
    for (const Json& material : document_.value("materials", Json::array()))
      if (const auto image = colour_image(material)) colours.insert(*image);
    for (std::uint32_t i = 0; i < images.size(); ++i) {
      if (!colours.contains(i)) continue;
      TexturePage page{"image " + std::to_string(i), file_.path(), 0, 0};
      if (images[i].contains("bufferView")) {
        const Json& view =
            glb_item(document_, "bufferViews", images[i].at("bufferView").get<std::uint64_t>(), name);
        page.offset = bin_ + view.value("byteOffset", std::uint64_t{0});
        const auto bytes = view.value("byteLength", std::uint64_t{0});
        if (page.offset + bytes <= file_.size()) page.bytes = bytes;
      }
      page_of_image_[i] = static_cast<std::uint32_t>(pages_.size());
      pages_.push_back(page);
    }
    std::uint64_t placed = 0;
    for (const Json& node : document_.value("nodes", Json::array())) placed += node.contains("mesh");
    several_ = placed > 1 || document_.value("meshes", Json::array()).size() > 1;
    for (const Json& mesh : document_.value("meshes", Json::array()))
      for (const Json& primitive : mesh.value("primitives", Json::array())) {
        if (primitive.value("mode", 4) != 4) continue;
        const Json& attributes = primitive.at("attributes");
        Primitive p;
        if (attributes.contains("TEXCOORD_0")) {
          p.places = buffers_->accessor(document_, attributes.at("TEXCOORD_0").get<std::uint64_t>());
          p.places->normalized = true;
          p.page = page_of(primitive);
        }
        if (primitive.contains("indices"))
          p.indices = buffers_->accessor(document_, primitive.at("indices").get<std::uint64_t>());
        p.vertices = buffers_->accessor(document_, attributes.at("POSITION").get<std::uint64_t>()).count;
        primitives_.push_back(std::move(p));
      }
  }

  /// Whose number may be that of an image that the file does not have.
  std::optional<std::uint32_t> colour_image(const Json& material) const {
    const Json colour =
        material.value("pbrMetallicRoughness", Json::object()).value("baseColorTexture", Json());
    if (!colour.is_object() || !colour.contains("index")) return std::nullopt;
    const Json& texture =
        glb_item(document_, "textures", colour.at("index").get<std::uint64_t>(), file_.path().string());
    if (!texture.contains("source")) return std::nullopt;
    return texture.at("source").get<std::uint32_t>();
  }

  std::uint32_t page_of(const Json& primitive) const {
    if (!primitive.contains("material")) return kNoPage;
    const auto image = colour_image(glb_item(
        document_, "materials", primitive.at("material").get<std::uint64_t>(), file_.path().string()));
    if (!image) return kNoPage;
    const auto known = page_of_image_.find(*image);
    return known != page_of_image_.end() ? known->second : kUnnamedPage;
  }

  ReadFile file_;
  std::uint64_t max_bytes_, bin_ = 0;
  Json document_;
  std::unique_ptr<GlbBuffers> buffers_;
  std::vector<Primitive> primitives_;
  bool several_ = false;  ///< nodes with meshes, or meshes
  std::map<std::uint32_t, std::uint32_t> page_of_image_;
};

}  // namespace

std::unique_ptr<TextureReader> open_textures(const std::filesystem::path& mesh, std::uint64_t max_bytes) {
  if (lower_extension(mesh) == ".obj") {
    auto textures = std::make_unique<ObjTextures>(mesh, max_bytes);
    if (textures->has_coordinates()) return textures;
  } else if (lower_extension(mesh) == ".ply") {
    PlyHeader header = read_ply_header(ReadFile(mesh));
    if (PlyTextures::has_coordinates(header)) return std::make_unique<PlyTextures>(mesh, std::move(header));
  } else if (lower_extension(mesh) == ".glb") {
    auto textures = std::make_unique<GlbTextures>(mesh, max_bytes);
    if (textures->has_coordinates()) return textures;
  }
  return nullptr;
}

std::vector<TexturePage> texture_pages(const std::filesystem::path& mesh) {
  const std::string extension = lower_extension(mesh);
  if (extension == ".obj") return ObjTextures(mesh, 0).pages();
  if (extension == ".ply") return PlyTextures(mesh, read_ply_header(ReadFile(mesh))).pages();
  if (extension == ".glb") return GlbTextures(mesh, 0).pages();
  return {};
}

}  // namespace tessera
