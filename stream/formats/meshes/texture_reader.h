/// \file texture_reader.h
/// Texture coordinates of the faces of a mesh file, streamed, and where its pages lie: OBJ with its MTL (map_Kd), binary
/// PLY as MeshLab writes it (`texcoord`, `texnumber`, `comment TextureFile`), GLB of one node (TEXCOORD_0, baseColorTexture).
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/formats/meshes/textured_mesh_writer.h"

namespace tessera {

/// A picture, as it lies in a file.
struct TexturePage {
  std::string name;  ///< as the mesh says it; of GLB "image 0"
  std::filesystem::path file;
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;  ///< 0: it is not there
};

class TextureReader {
 public:
  static constexpr std::uint32_t kNoPage = 0xffffffffu;
  static constexpr std::uint32_t kUnnamedPage = kNoPage - 1;  ///< one that the file does not have
  virtual ~TextureReader() = default;
  /// What shows colours; maps of normals are none.
  const std::vector<TexturePage>& pages() const { return pages_; }
  /// Of all triangles, in the order of MeshReader::read_faces(), v up; page kNoPage where a face has no texture.
  /// \throws InputError for polygons, and for numbers that name nothing
  virtual void read(const std::function<void(std::span<const FaceTexture>)>& sink) = 0;

 protected:
  std::vector<TexturePage> pages_;
};

/// \param max_bytes  memory for coordinates that faces name by numbers (OBJ, GLB)
/// \returns nothing for a file without texture coordinates, and for formats that have none
/// \throws InputError as open_mesh_file(), and for texture coordinates in a form that is not read; ResourceError where
///   `max_bytes` do not hold them
std::unique_ptr<TextureReader> open_textures(const std::filesystem::path& mesh, std::uint64_t max_bytes);

/// The pages that a file names, without a look at its coordinates: none for formats that have none.
/// \throws InputError as open_mesh_file()
std::vector<TexturePage> texture_pages(const std::filesystem::path& mesh);

}  // namespace tessera
