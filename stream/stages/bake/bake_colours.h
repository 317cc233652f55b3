/// \file bake_colours.h
/// What the colours of textures come from: coloured points, handed out in any order.
#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stream/formats/points/crs.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"
#include "stream/stages/bake/texture_points.h"

namespace tessera {

class BakeColours {
 public:
  virtual ~BakeColours() = default;
  /// Hands out all points, `shift` taken off their coordinates; advances by about units().
  /// \throws as the readers do; StoppedError
  virtual void read(const Double3& shift, TaskContext& context, const TexturePointSink& sink) = 0;
  virtual std::uint64_t units() const = 0;  ///< of progress: points, faces of textures
  virtual std::uint64_t bytes() const = 0;  ///< memory of reading
  virtual bool has_normals() const { return false; }
  virtual Crs crs() const { return {}; }  ///< unknown where that of the mesh is theirs
  // After reading.
  virtual std::uint64_t left_out() const { return 0; }
  virtual std::vector<std::string> notices() const { return {}; }
};

/// What of the points of scans pages show.
struct ScanColourChoice {
  bool intensity = false;  ///< as grey, in place of their colours; reads the scans twice
  bool normals = false;    ///< of the points too
};
/// \throws InputError for scans without what is chosen, and as open_measured_scans()
std::unique_ptr<BakeColours> colours_of_scans(const std::vector<std::filesystem::path>& scans,
                                              const ScanColourChoice& choice);
/// Colours of one, directions of the vertices of a mesh.
std::unique_ptr<BakeColours> with_directions(std::unique_ptr<BakeColours> colours, MeshStore mesh);
/// Vertices of a mesh, with their normals. \param colourless  white where it has no colours \throws InputError else
std::unique_ptr<BakeColours> colours_of_store(MeshStore mesh, bool colourless = false);

}  // namespace tessera
