/// \file hole_filling.h
/// Closes one boundary loop of a mesh by a smooth patch.
/// Sources: Barequet, Sharir, "Filling gaps in the boundary of a polyhedron", 1995, and Liepa, "Filling holes
/// in meshes", 2003 (least largest dihedral angle, then least area; refinement to the density of the rim;
/// fairing of second order); Bergou, Wardetzky, Harmon, Zorin, Grinspun, "A quadratic bending model for
/// inextensible surfaces", 2006 (the thin-plate energy, which meets the rim tangentially through the faces
/// beyond it).
///
/// Passes: triangulate the loop (hole_triangulation.h); split and flip (hole_mesh.h) until edges are as long
/// as those of the rim; relax; minimise the bending of all inner edges and of the rim.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// A loop of n >= 3 border edges, in the order in which the faces of the filling run along it: against the
/// faces of the mesh. Lengths in any unit; positions near the origin keep the arithmetic exact enough.
struct HoleLoop {
  std::vector<Double3> position;    ///< n
  std::vector<Double3> opposite;    ///< n: third vertex of the mesh's face at the edge from i to i + 1
  std::vector<std::uint32_t> rgba;  ///< n, or empty
  /// Edges of the mesh between vertices of the loop that do not follow each other, low < high, ascending.
  std::vector<std::array<std::uint32_t, 2>> taken;
};

inline constexpr std::uint32_t kMaxHoleEdges = 1000;  ///< the triangulation takes the cube of it in time
/// New vertices of the filling of n edges, at most; larger holes get longer edges inside.
[[nodiscard]] constexpr std::uint64_t max_hole_vertices(std::uint64_t n) {
  return n * n / 6 < 12'000 ? n * n / 6 : 12'000;
}
/// The most that fill_hole() allocates: the triangulation's table, or the system of the fairing.
[[nodiscard]] constexpr std::uint64_t hole_bytes(std::uint64_t n, std::uint64_t max_vertices = 12'000) {
  return 64 * n * n + 5000 * std::min(max_hole_vertices(n), max_vertices) + (1u << 20);
}

enum class HoleOutcome : std::uint8_t {
  kFilled,
  kTaken,  ///< every triangulation needs an edge that the mesh has already, or a face without area
  kWide,   ///< wider than allowed
  kSharp,  ///< two faces that meet in the patch or at its rim turn farther than allowed
  kOuter,  ///< the mesh lies within the loop, or the patch would fold back over the rim's faces: this is the
           ///< outer border of a piece, not a hole in it
};

inline constexpr std::size_t kHoleOutcomes = 5;

struct HoleFilling {
  HoleOutcome outcome = HoleOutcome::kFilled;
  double width = 0.0;       ///< 4 area / length of the rim: the diameter of a disk, twice the width of a slit
  double min_cosine = 1.0;  ///< between the normals of faces that meet in the patch or at its rim
  /// false: the bending could not be minimised (a degenerate patch); it is a membrane then.
  bool fair = true;
  std::vector<Double3> position;    ///< new vertices, none on the rim
  std::vector<std::uint32_t> rgba;  ///< theirs, or empty
  /// Counter-clockwise from outside; indices below n are the loop's, others n + new vertex. Canonical: a pure
  /// function of the loop.
  std::vector<std::array<std::uint32_t, 3>> faces;
};

enum class HoleShape : std::uint8_t {
  kSmooth,  ///< meets the rim tangentially: least dihedral angles, then least bending
  kMembrane,  ///< least area, every vertex amid its neighbours: stays within the rim where a smooth patch would bulge
};

struct HoleLimits {
  double width = std::numeric_limits<double>::infinity();  ///< HoleFilling::width at most
  double min_cosine = -1.0;                                ///< HoleFilling::min_cosine at least
  std::uint64_t vertices = 12'000;                         ///< new ones at most
  HoleShape shape = HoleShape::kSmooth;
  bool outer = false;  ///< also what looks like the outer border of a piece
};

/// \pre 3 <= n <= kMaxHoleEdges, no two neighbours of the loop at one place
/// \post filled: the faces together are a disk bounded by the loop; no inner edge is in `taken`
[[nodiscard]] HoleFilling fill_hole(const HoleLoop& loop, const HoleLimits& limits = {});

/// Fills one loop to several limits: triangulations, and the smooth patch, are made once.
class HoleFiller {
 public:
  /// \pre as of fill_hole(); the loop stays as it is while this is used
  explicit HoleFiller(const HoleLoop& loop);
  ~HoleFiller();
  /// What fill_hole() makes of the loop.
  [[nodiscard]] HoleFilling fill(const HoleLimits& limits);

 private:
  struct Made;
  const HoleLoop& loop_;
  std::unique_ptr<Made> made_;
};

}  // namespace tessera
