#include "stream/formats/meshes/mesh_io.h"

#include <algorithm>
#include <utility>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/read_file.h"
#include "stream/files/unpacked_bytes.h"
#include "stream/formats/meshes/mesh_arrays.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/meshes/mesh_writer_base.h"
#include "stream/formats/meshes/rounding_check.h"

namespace tessera {
namespace {

/// What the first line says that is neither blank nor a comment; without a byte order mark.
std::string_view first_line(std::string_view start) {
  if (start.starts_with("\xef\xbb\xbf")) start.remove_prefix(3);
  for (;;) {
    start.remove_prefix(std::min(start.find_first_not_of(" \t\r\n\v\f"), start.size()));
    const std::string_view line = start.substr(0, start.find_first_of("\r\n"));
    if (!line.starts_with("#")) return line;
    start.remove_prefix(line.size());
  }
}

/// OFF, COFF, STOFF, ... as the first word, comments above it passed over.
bool begins_with_off(std::string_view start) {
  const std::string_view line = first_line(start);
  const std::size_t off = line.find("OFF");
  return off != std::string_view::npos &&
         line.substr(0, off).find_first_not_of("STCN4n") == std::string_view::npos;
}

bool begins_with_solid(std::string_view start) {
  constexpr std::string_view kSolid = "solid";
  const std::string_view line = first_line(start).substr(0, kSolid.size());
  return std::equal(line.begin(), line.end(), kSolid.begin(), kSolid.end(),
                    [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
}

}  // namespace

void require_mesh_extension(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  for (const char* known : {".ply", ".obj", ".stl", ".glb", ".3mf", ".vtu", ".msh"}) {
    if (extension == known) return;
  }
  throw UsageError(path.string() + ": unknown mesh format '" + extension +
                   "'; use .ply, .obj, .stl, .glb, .3mf, .vtu or .msh");
}

std::unique_ptr<MeshWriter> create_mesh_file(const std::filesystem::path& path, const MeshHeader& header) {
  if (MadeMesh* made = made_arrays(path)) return collect_mesh(*made, header);
  require_mesh_extension(path);
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return create_ply_mesh(path, header);
  if (extension == ".obj") return create_obj_mesh(path, header);
  if (extension == ".stl") return create_stl_mesh(path, header);
  if (extension == ".3mf") return create_threemf_mesh(path, header);
  if (extension == ".vtu") return create_vtu_mesh(path, header);
  if (extension == ".msh") return create_msh_mesh(path, header);
  return create_glb_mesh(path, header);
}

std::uint64_t rounding_check_bytes(const std::filesystem::path& path, bool double_positions,
                                   std::uint64_t vertices) {
  return lower_extension(path) == ".stl" || (double_positions && holds_floats_only(path))
             ? RoundingCheck::bytes(vertices)
             : 0;
}

std::unique_ptr<MeshReader> open_mesh_file(const std::filesystem::path& path,
                                           const MeshReadOptions& options) {
  if (const MeshArrays* given = given_arrays(path)) return given->open();
  if (std::filesystem::is_directory(path))
    throw InputError(path.string() + ": a folder; a mesh file is needed here");
  ReadFile file(path);
  if (file.size() == 0) throw InputError(path.string() + ": the file is empty");
  const auto head = [&] {
    std::string bytes(static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), 4096)), '\0');
    file.read_at(0, bytes.data(), bytes.size());
    return bytes;
  };
  std::string start = head();
  if (packed_format(start) == "UTF-16") {
    file = ReadFile::unpacked(path);
    if (file.size() == 0) throw InputError(path.string() + ": the file is empty");
    start = head();
  }
  if (start.starts_with("ply")) return open_ply_mesh(std::move(file), options);
  if (start.starts_with("glTF")) return open_glb_mesh(std::move(file), options);
  if (start.starts_with("PK\x03\x04")) return open_threemf_mesh(std::move(file), options);
  if (start.starts_with("$MeshFormat")) return open_msh_mesh(std::move(file), options);
  const std::string extension = lower_extension(path);
  if (extension == ".vtu" || first_line(start).starts_with("<VTKFile"))
    return open_vtu_mesh(std::move(file), options);
  if (extension == ".obj") return open_obj_mesh(std::move(file), options);
  if (extension == ".off" || begins_with_off(start)) return open_off_mesh(std::move(file), options);
  if (extension == ".stl" || begins_with_solid(start)) return open_stl_mesh(std::move(file), options);
  throw InputError(path.string() +
                   ": not a mesh that Tessera reads; convert it to PLY, OBJ, STL, OFF, GLB or 3MF");
}

}  // namespace tessera
