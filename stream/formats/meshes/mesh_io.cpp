#include "stream/formats/meshes/mesh_io.h"

#include <algorithm>
#include <utility>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/read_file.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/meshes/mesh_writer_base.h"

namespace tessera {
namespace {

/// OFF, COFF, NOFF, ... as the first word.
bool begins_with_off(std::string_view start) {
  const std::size_t word = start.find_first_not_of(" \t\r\n");
  if (word == std::string_view::npos) return false;
  const std::size_t off = start.find("OFF", word);
  return off != std::string_view::npos &&
         start.substr(word, off - word).find_first_not_of("STCN4n") == std::string_view::npos;
}

}  // namespace

void require_mesh_extension(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  for (const char* known : {".ply", ".obj", ".stl", ".glb"}) {
    if (extension == known) return;
  }
  throw UsageError(path.string() + ": unknown mesh format '" + extension + "'; use .ply, .obj, .stl or .glb");
}

std::unique_ptr<MeshWriter> create_mesh_file(const std::filesystem::path& path, const MeshHeader& header) {
  require_mesh_extension(path);
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return create_ply_mesh(path, header);
  if (extension == ".obj") return create_obj_mesh(path, header);
  if (extension == ".stl") return create_stl_mesh(path, header);
  return create_glb_mesh(path, header);
}

std::unique_ptr<MeshReader> open_mesh_file(const std::filesystem::path& path,
                                           const MeshReadOptions& options) {
  ReadFile file(path);
  if (std::filesystem::is_directory(path))
    throw InputError(path.string() + ": a folder; a mesh file is needed here");
  if (file.size() == 0) throw InputError(path.string() + ": the file is empty");
  std::string start(static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), 512)), '\0');
  file.read_at(0, start.data(), start.size());
  if (start.starts_with("ply")) return open_ply_mesh(std::move(file), options);
  if (start.starts_with("glTF")) return open_glb_mesh(std::move(file), options);
  const std::string extension = lower_extension(path);
  if (extension == ".obj") return open_obj_mesh(std::move(file), options);
  if (begins_with_off(start)) return open_off_mesh(std::move(file), options);
  if (extension == ".stl" || start.starts_with("solid")) return open_stl_mesh(std::move(file), options);
  throw InputError(path.string() +
                   ": not a mesh that Tessera reads; convert it to PLY, OBJ, STL, OFF or GLB");
}

}  // namespace tessera
