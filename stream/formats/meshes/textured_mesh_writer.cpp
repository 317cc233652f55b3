#include "stream/formats/meshes/textured_mesh_writer.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <map>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_writer_base.h"

namespace tessera {
namespace {

bool has_suffix(const std::filesystem::path& path, std::string_view suffix) {
  std::string e = path.extension().string();
  for (char& c : e) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return e == suffix;
}

/// As the file holds it: never beyond 0 and 1.
float texture_float(double v) {
  return static_cast<float>(std::clamp(v, 0.0, 1.0));
}

class TexturedPly : public MeshWriterBase {
 public:
  TexturedPly(const std::filesystem::path& path, const MeshHeader& header,
              const std::vector<std::string>& pages, FaceTextures textures)
      : MeshWriterBase(path, header, !header.double_positions), textures_(std::move(textures)) {
    const std::string real = header.double_positions ? "double" : "float";
    std::string text = "ply\nformat binary_little_endian 1.0\n";
    for (const std::string& line : comment_lines(header)) text += "comment " + line + "\n";
    for (const std::string& page : pages) text += "comment TextureFile " + page + "\n";
    text += "element vertex " + std::to_string(header.vertices) + "\n";
    for (const char* axis : {"x", "y", "z"}) text += "property " + real + " " + axis + "\n";
    if (header.colour)
      for (const char* name : {"red", "green", "blue", "alpha"})
        text += std::string("property uchar ") + name + "\n";
    text += "element face " + std::to_string(header.faces) +
            "\nproperty list uchar uint vertex_indices\nproperty list uchar float texcoord\nproperty int "
            "texnumber\n";
    if (header.synthetic) text += "property uchar synthetic\n";
    file_.append(text + "end_header\n");
  }

 private:
  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) override {
    for (std::size_t i = 0; i < positions.size(); ++i) {
      if (header_.double_positions) {
        file_.append(positions[i].data(), sizeof(Double3));
      } else {
        const Float3 p = narrow(positions[i]);
        file_.append(p.data(), sizeof p);
      }
      if (header_.colour) file_.append(&rgba[i], 4);
    }
  }
  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) override {
    const std::vector<FaceTexture> textures = textures_(faces.size());
    for (std::size_t f = 0; f < faces.size(); ++f) {
      char record[1 + 12 + 1 + 24 + 4 + 1];
      record[0] = 3, record[13] = 6;
      std::array<std::uint32_t, 3> corners{};
      std::array<float, 6> uv{};
      for (std::size_t k = 0; k < 3; ++k) {
        corners[k] = static_cast<std::uint32_t>(faces[f][k]);
        for (std::size_t d = 0; d < 2; ++d) uv[2 * k + d] = texture_float(textures[f].uv[k][d]);
      }
      std::memcpy(record + 1, corners.data(), sizeof corners);
      std::memcpy(record + 14, uv.data(), sizeof uv);
      std::memcpy(record + 38, &textures[f].page, 4);
      if (header_.synthetic) record[42] = static_cast<char>(synthetic[f]);
      file_.append(record, header_.synthetic ? sizeof record : sizeof record - 1);
    }
  }

  FaceTextures textures_;
};

class TexturedObj : public MeshWriterBase {
 public:
  TexturedObj(const std::filesystem::path& path, const MeshHeader& header, FaceTextures textures,
              FaceNormals normals)
      : MeshWriterBase(path, header, !header.double_positions),
        textures_(std::move(textures)),
        normals_(std::move(normals)) {
    for (const std::string& line : comment_lines(header)) file_.append("# " + line + "\n");
    file_.append("mtllib " + material_path(path).filename().string() + "\n");
  }

 private:
  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) override {
    std::string text;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      text = "v";
      for (const double x : positions[i]) put(text, decimal_value(header_, x));
      for (int shift = 0; header_.colour && shift < 24; shift += 8) {
        char digits[16];  // four decimals give the byte back exactly
        const auto end = std::to_chars(digits, std::end(digits), (rgba[i] >> shift & 255u) / 255.0,
                                       std::chars_format::fixed, 4);
        text += ' ';
        text.append(digits, end.ptr);
      }
      text += '\n';
      file_.append(text);
    }
  }

  /// Faces of one page after the other; corners at one place of a page share its coordinates.
  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    const std::vector<FaceTexture> textures = textures_(faces.size());
    const std::vector<std::array<Double3, 3>> normals =
        normals_ ? normals_() : std::vector<std::array<Double3, 3>>();
    std::map<std::uint64_t, std::uint64_t> directions;  // of vertices
    std::vector<std::size_t> order(faces.size());
    for (std::size_t f = 0; f < order.size(); ++f) order[f] = f;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return textures[a].page < textures[b].page; });
    std::map<std::array<std::uint32_t, 2>, std::uint64_t> numbers;
    std::string places, lines;
    for (const std::size_t f : order) {
      if (textures[f].page != page_) {
        file_.append(places + lines);
        places.clear(), lines.clear(), numbers.clear(), directions.clear();
        page_ = textures[f].page;
        lines = "usemtl page_" + std::to_string(page_) + "\n";
      }
      lines += 'f';
      for (std::size_t k = 0; k < 3; ++k) {
        const float u = texture_float(textures[f].uv[k][0]), v = texture_float(textures[f].uv[k][1]);
        const auto [at, fresh] = numbers.try_emplace(
            {std::bit_cast<std::uint32_t>(u), std::bit_cast<std::uint32_t>(v)}, places_ + 1);
        if (fresh) {
          ++places_;
          places += "vt";
          put(places, u), put(places, v);
          places += '\n';
        }
        put(lines, faces[f][k] + 1);
        lines += '/' + std::to_string(at->second);
        if (normals.empty()) continue;
        const auto [direction, new_direction] = directions.try_emplace(faces[f][k], directions_ + 1);
        if (new_direction) {
          ++directions_;
          places += "vn";
          for (const double c : normals[f][k]) put(places, static_cast<float>(c));
          places += '\n';
        }
        lines += '/' + std::to_string(direction->second);
      }
      lines += '\n';
      if (lines.size() + places.size() > (std::size_t{1} << 20)) {
        file_.append(places + lines);
        places.clear(), lines.clear();
      }
    }
    file_.append(places + lines);
  }

  template <class Number>
  static void put(std::string& text, Number value) {
    char digits[32];
    const auto end = std::to_chars(digits, std::end(digits), value);
    text += ' ';
    text.append(digits, end.ptr);
  }

  FaceTextures textures_;
  FaceNormals normals_;
  std::uint32_t page_ = 0xffffffffu;
  std::uint64_t places_ = 0, directions_ = 0;
};

}  // namespace

void require_textured_extension(const std::filesystem::path& path, bool normals) {
  if (!has_suffix(path, ".obj") && !has_suffix(path, ".ply") && !has_suffix(path, ".glb"))
    throw UsageError(path.string() + ": textures are written with .glb, .obj or .ply");
  if (normals && has_suffix(path, ".ply"))
    throw UsageError(path.string() + ": PLY has no normal maps; give -o a .glb or an .obj");
}

std::unique_ptr<MeshWriter> create_textured_mesh(const std::filesystem::path& path, const MeshHeader& header,
                                                 const std::vector<std::string>& pages, FaceTextures textures,
                                                 FaceNormals normals) {
  if (has_suffix(path, ".obj"))
    return std::make_unique<TexturedObj>(path, header, std::move(textures), std::move(normals));
  if (header.vertices > 0xffffffffULL)
    throw UsageError(path.string() + ": PLY indices end at 4294967295 and the mesh has " +
                     std::to_string(header.vertices) + " vertices; write .obj instead");
  return std::make_unique<TexturedPly>(path, header, pages, std::move(textures));
}

std::filesystem::path material_path(const std::filesystem::path& output) {
  if (!has_suffix(output, ".obj")) return {};
  std::filesystem::path path = output;
  return path.replace_extension(".mtl");
}

std::string material_text(const std::vector<std::string>& pages, const std::vector<std::string>& normals) {
  std::string text = "# made by tessera\n";
  for (std::size_t p = 0; p < pages.size(); ++p) {
    text += "newmtl page_" + std::to_string(p) + "\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd " +
            pages[p] + "\n";
    if (!normals.empty()) text += "norm " + normals[p] + "\n";
  }
  return text;
}

}  // namespace tessera
