/// \file textured_mesh_writer.h
/// Meshes with texture coordinates of the corners of their faces, on several pages: OBJ with an MTL beside it, PLY as MeshLab
/// reads it (`comment TextureFile`, a list `texcoord` and a number `texnumber` per face), GLB with the pages inside.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/output_file.h"
#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

struct FaceTexture {
  std::uint32_t page = 0;
  std::array<Double2, 3> uv{};  ///< of the corners, from 0 to 1, v up
};
/// Gives the textures of the faces that are written next, as many as asked for.
using FaceTextures = std::function<std::vector<FaceTexture>(std::size_t faces)>;
/// Of the faces that came last: unit normals of their corners.
using FaceNormals = std::function<std::vector<std::array<Double3, 3>>()>;

/// \throws UsageError for an extension other than .obj, .ply and .glb
/// \param normals  with normal maps: nor for .ply
void require_textured_extension(const std::filesystem::path& path, bool normals = false);

/// .obj or .ply. \param pages  names of the pictures, as the file shall say them \param normals  of .obj alone, or empty
std::unique_ptr<MeshWriter> create_textured_mesh(const std::filesystem::path& path, const MeshHeader& header,
                                                 const std::vector<std::string>& pages, FaceTextures textures,
                                                 FaceNormals normals = {});

/// "site.mtl" for "site.obj", empty for other formats.
std::filesystem::path material_path(const std::filesystem::path& output);
/// \param normals  names of normal maps, as many as pages, or none
std::string material_text(const std::vector<std::string>& pages,
                          const std::vector<std::string>& normals = {});

/// Binary glTF 2.0 of one primitive and one unlit material a page. Axes and origin as of other GLB files.
class TexturedGlb {
 public:
  struct Page {
    std::uint64_t vertices = 0, faces = 0;  ///< > 0
    Float3 min{}, max{};                    ///< of file_position()
    std::filesystem::path image;            ///< PNG, or JPEG if it ends in .jpg
    std::filesystem::path normals;          ///< PNG of a normal map (normal_map.h), of all pages or none
  };
  /// Of a vertex, in the axes of the mesh: unit, orthogonal to each other; bitangents are right-handed.
  struct Frame {
    Double3 normal{}, tangent{};
  };
  static Float3 file_position(const Double3& p, const Double3& origin);

  /// \param header  origin, shift and comments alone count
  /// \throws UsageError where the file would be longer than GLB can be
  TexturedGlb(const std::filesystem::path& path, const MeshHeader& header, std::vector<Page> pages);
  /// All vertices of all pages in order, before any face. \param uv  v up
  /// \param frames  as many with normal maps, else none
  void vertices(std::span<const Double3> positions, std::span<const Double2> uv,
                std::span<const Frame> frames = {});
  /// Numbers count from the first vertex of the page.
  void faces(std::span<const std::array<std::uint32_t, 3>> faces);
  /// Returns the bytes of the file. \throws ResourceError when the disk is full
  std::uint64_t finish();

 private:
  std::string document(std::uint64_t& bin) const;
  bool has_normals() const { return !pages_.empty() && !pages_.front().normals.empty(); }
  std::uint64_t vertex_bytes() const;
  Double3 origin_, shift_;
  std::vector<std::string> comments_;
  std::vector<Page> pages_;
  std::uint64_t vertices_ = 0, faces_ = 0;
  std::unique_ptr<OutputFile> file_;
};

}  // namespace tessera
