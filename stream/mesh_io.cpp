#include "stream/mesh_io.h"

#include <algorithm>
#include <cctype>

#include "octree/error.h"
#include "stream/formats/mesh_writer_base.h"

namespace tessera {
namespace {

std::string lower_extension(const std::filesystem::path& path) {
  std::string text = path.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

std::unique_ptr<MeshWriter> create_mesh_file(const std::filesystem::path& path, const MeshHeader& header) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return create_ply_mesh(path, header);
  throw UsageError(path.string() + ": unknown mesh format '" + extension + "'; use .ply, .obj, .stl or .glb");
}

}  // namespace tessera
