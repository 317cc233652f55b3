/// \file mesh_quality.h
/// What decides whether a mesher of volumes or a solver gets on with a surface: angles between faces and the thickness of walls,
/// of a mesh of any size. Faces come in any order; what does not fit the memory waits on disk; no number depends on either.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "octree/lattice.h"
#include "stream/files/json.h"

namespace tessera {

inline constexpr std::uint64_t kWallSamples = 65536;  ///< about so many, half by area and half by faces

struct MeshQuality {
  /// Angles between two faces at an edge, through the inside, degrees: 180 is flat, 0 a knife's edge, 360 a slit.
  struct Dihedral {
    std::uint64_t edges = 0;  ///< of two faces that run opposite ways along it, both with an area
    double min = 0, max = 0;
    Double3 min_at = {0, 0, 0}, max_at = {0, 0, 0};  ///< middles of the edges
  };
  /// Diameters of the balls of wall_balls.h.
  struct Walls {
    std::uint64_t samples = 0, facing = 0;         ///< taken, and those that have another side
    double thinnest = 0, percent = 0, median = 0;  ///< percent: that of one sample in a hundred is no thicker
    Double3 thinnest_at = {0, 0, 0};               ///< on the surface
  };
  Dihedral dihedral;
  Walls walls;
};

struct MeshQualityOptions {
  std::uint64_t memory_bytes = std::uint64_t{1} << 28;  ///< while faces come; `walls_bytes` after that
  std::uint64_t walls_bytes = std::uint64_t{1} << 28;
  std::filesystem::path temp;
  int threads = 1;
  std::function<void()> check_stop;  ///< may throw StoppedError; may be empty
};

class MeshQualityPass {
 public:
  /// \param faces  how many come at most; \param centre  of the mesh
  MeshQualityPass(std::uint64_t faces, const Double3& centre, const MeshQualityOptions& options);
  ~MeshQualityPass();
  /// A face with an area. Corners finite; edges are known by the positions of their ends.
  /// \param flip  the face runs (a, c, b)
  void add(const Double3& a, const Double3& b, const Double3& c, bool flip);
  /// Once, after all faces. \param area  of all faces; \param inwards  faces point inwards: sides are swapped
  MeshQuality finish(double area, bool inwards);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

Json to_json(const MeshQuality& quality);
/// Lines of a name and what is said of it.
std::vector<std::pair<std::string, std::string>> quality_lines(const MeshQuality& quality);

}  // namespace tessera
