#include "stream/formats/meshes/uv_mesh_writer.h"

#include <charconv>
#include <cstring>
#include <string>

#include "octree/error.h"
#include "stream/files/output_file.h"
#include "stream/formats/meshes/mesh_writer_base.h"

namespace tessera {
namespace {

constexpr std::size_t kUvLineBytes = 160;

bool is_obj(const std::filesystem::path& path) {
  const std::string e = path.extension().string();
  return e == ".obj" || e == ".OBJ";
}
bool is_ply(const std::filesystem::path& path) {
  const std::string e = path.extension().string();
  return e == ".ply" || e == ".PLY";
}

/// One line of text, numbers as the shortest decimals that read back the same.
class Line {
 public:
  Line(OutputFile& file, std::string_view head) : file_(file), to_(file.reserve(kUvLineBytes)), begin_(to_) {
    std::memcpy(to_, head.data(), head.size());
    to_ += head.size();
  }
  template <class Number>
  Line& put(Number value) {
    *to_++ = ' ';
    to_ = std::to_chars(to_, begin_ + kUvLineBytes, value).ptr;
    return *this;
  }
  /// v/vt of one corner.
  Line& corner(std::uint32_t index) {
    put(index);
    *to_++ = '/';
    to_ = std::to_chars(to_, begin_ + kUvLineBytes, index).ptr;
    return *this;
  }
  void end() {
    *to_++ = '\n';
    file_.commit(static_cast<std::size_t>(to_ - begin_));
  }

 private:
  OutputFile& file_;
  char* to_;
  char* begin_;
};

void write_obj(OutputFile& file, const MeshHeader& header, std::span<const Double3> positions,
               std::span<const std::array<double, 2>> uv,
               std::span<const std::array<std::uint32_t, 3>> faces) {
  for (const std::string& line : comment_lines(header)) file.append("# " + line + "\n");
  for (const Double3& p : positions) {
    Line line(file, "v");
    for (const double x : p) line.put(decimal_value(header, x));
    line.end();
  }
  for (const auto& t : uv) Line(file, "vt").put(static_cast<float>(t[0])).put(static_cast<float>(t[1])).end();
  for (const auto& f : faces) Line(file, "f").corner(f[0] + 1).corner(f[1] + 1).corner(f[2] + 1).end();
}

template <typename Real>
void write_ply(OutputFile& file, const MeshHeader& header, std::span<const Double3> positions,
               std::span<const std::array<double, 2>> uv,
               std::span<const std::array<std::uint32_t, 3>> faces) {
  const std::string real = sizeof(Real) == 8 ? "double" : "float";
  file.append("ply\nformat binary_little_endian 1.0\n");
  for (const std::string& line : comment_lines(header)) file.append("comment " + line + "\n");
  file.append("element vertex " + std::to_string(positions.size()) + "\n");
  for (const char* axis : {"x", "y", "z"}) file.append("property " + real + " " + axis + "\n");
  file.append("property float s\nproperty float t\nelement face " + std::to_string(faces.size()) +
              "\nproperty list uchar uint vertex_indices\nend_header\n");
  for (std::size_t v = 0; v < positions.size(); ++v) {
    const std::array<Real, 3> p = {static_cast<Real>(positions[v][0]), static_cast<Real>(positions[v][1]),
                                   static_cast<Real>(positions[v][2])};
    const std::array<float, 2> t = {static_cast<float>(uv[v][0]), static_cast<float>(uv[v][1])};
    file.append(&p, sizeof p);
    file.append(&t, sizeof t);
  }
  for (const auto& f : faces) {
    const char three = 3;
    file.append(&three, 1);
    file.append(&f, sizeof f);
  }
}

}  // namespace

void require_uv_extension(const std::filesystem::path& path) {
  if (!is_obj(path) && !is_ply(path))
    throw UsageError(path.string() + ": texture coordinates are written to .obj or .ply only");
}

void write_uv_mesh(const std::filesystem::path& path, const MeshHeader& header,
                   std::span<const Double3> positions, std::span<const std::array<double, 2>> uv,
                   std::span<const std::array<std::uint32_t, 3>> faces) {
  require_uv_extension(path);
  OutputFile file(path);
  if (is_obj(path)) {
    write_obj(file, header, positions, uv, faces);
  } else if (header.double_positions) {
    write_ply<double>(file, header, positions, uv, faces);
  } else {
    write_ply<float>(file, header, positions, uv, faces);
  }
  file.finish();
}

}  // namespace tessera
