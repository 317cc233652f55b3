/// \file mesh_check.h
/// What is true of a mesh on disk: topology, orientation, shape. Streaming: corners are partitioned by vertex range,
/// so the mesh may exceed the cap many times. No number depends on the cap or on the order of faces.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stream/check/mesh_cleanliness.h"
#include "stream/check/mesh_crossings.h"
#include "stream/check/mesh_quality.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

struct MeshCheckOptions {
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  ///< all that the check allocates, the reader excluded
  std::filesystem::path temp;  ///< folder for spilled data; empty = the system's temporary folder
  bool weld =
      false;  ///< merge vertices of equal position first; always where files have them several times (STL, glTF)
  bool crossings = false;    ///< search for pairs of faces that cross, too
  bool cleanliness = false;  ///< measure sharp edges and borders, too
  bool quality = false;      ///< measure angles between faces and the thickness of walls, too
  int threads = 1;           ///< for these
  /// May throw StoppedError; called every few milliseconds, from any thread; may be empty.
  std::function<void()> check_stop;
};

/// One connected part: faces joined through shared vertices. Faces with a repeated or unknown index belong to none.
struct MeshComponent {
  std::uint64_t vertices = 0;
  std::uint64_t edges = 0;
  std::uint64_t faces = 0;
  std::uint64_t boundary_edges = 0;
  std::uint64_t defects = 0;  ///< non-manifold edges and vertices, edges of inconsistent orientation

  std::int64_t euler() const {
    return static_cast<std::int64_t>(vertices) - static_cast<std::int64_t>(edges) +
           static_cast<std::int64_t>(faces);
  }
  /// Closed, manifold, consistently oriented: encloses volume and has a genus.
  bool solid() const { return boundary_edges == 0 && defects == 0; }
  std::int64_t genus() const { return (2 - euler()) / 2; }  ///< \pre solid()
  bool operator==(const MeshComponent&) const = default;
};

/// A chain of boundary edges. Closed when it returns to its start through manifold vertices only.
struct BoundaryLoop {
  std::uint64_t edges = 0;
  bool closed = false;
  bool operator==(const BoundaryLoop&) const = default;
};

/// Bounds of the aspect classes: longest edge over shortest altitude, times sqrt(3)/2: 1 for equilateral.
inline constexpr std::array<double, 7> kAspectBounds = {1.5, 2, 3, 5, 10, 100, 1000};
inline constexpr std::size_t kListedParts = 16;  ///< largest components and loops that a report lists

struct MeshCheck {
  std::string format;
  bool welded = false;              ///< vertices were merged by position before the check
  std::uint64_t file_vertices = 0;  ///< read, before welding
  /// By the header, polygons count once; 0 when it does not say.
  std::uint64_t declared_vertices = 0, declared_faces = 0;

  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
  std::uint64_t edges = 0;
  std::uint64_t unreferenced_vertices = 0;
  std::uint64_t nonfinite_vertices = 0;
  std::uint64_t bad_index_faces = 0;   ///< name a vertex that does not exist; left out of all below
  std::uint64_t degenerate_faces = 0;  ///< repeat an index; left out of edges and components
  std::uint64_t zero_area_faces = 0;   ///< three different vertices on a line, to 1e-12 of the longest edge
  std::uint64_t duplicate_faces = 0;   ///< same three vertices as an earlier face, either orientation

  std::uint64_t boundary_edges = 0;        ///< one face
  std::uint64_t nonmanifold_edges = 0;     ///< more than two
  std::uint64_t inconsistent_edges = 0;    ///< two faces that run along it in the same direction
  std::uint64_t nonmanifold_vertices = 0;  ///< the faces around it are not one fan or one disk

  std::uint64_t boundary_loops = 0;
  std::uint64_t open_loops = 0;             ///< end at a non-manifold edge
  std::vector<BoundaryLoop> largest_loops;  ///< by edges, at most kListedParts

  std::uint64_t components = 0;
  std::uint64_t solid_components = 0;
  std::int64_t total_genus = 0;                   ///< of the solid ones
  std::vector<MeshComponent> largest_components;  ///< by faces, at most kListedParts

  Double3 min = {0, 0, 0}, max = {0, 0, 0};  ///< of finite vertices, in the frame of the file
  bool has_shape = false;  ///< what follows is known: the extent is finite, below 1e100, above 0
  double area = 0;
  double volume = 0;  ///< signed; negative when faces point inwards; 0 unless solid()
  double min_edge = 0, mean_edge = 0, max_edge = 0;  ///< mean over the sides of all faces
  /// Last: beyond, zero area excluded.
  std::array<std::uint64_t, kAspectBounds.size() + 1> aspect_histogram = {};
  double min_angle_deg = 0, max_angle_deg = 0;  ///< of faces with an area; 0 without any
  double max_edge_ratio = 0;                    ///< longest to shortest edge of a face with an area
  std::optional<MeshQuality> quality;           ///< where it was asked for, and has_shape
  std::optional<MeshCrossings> crossings;       ///< where they were asked for
  std::optional<MeshCleanliness> cleanliness;   ///< likewise

  /// Every component is closed, manifold and consistently oriented.
  bool solid() const { return components > 0 && solid_components == components; }
  /// One sentence per kind of defect; empty for a sound mesh. Boundaries are no defect of a scan.
  std::vector<std::string> defects() const;
};

/// Reads the mesh: its vertices once, its faces twice, and once more for crossings. For quality faces wait on disk, about 250
/// bytes each, where they do not fit.
/// \param mesh  opened with MeshReadOptions::keep_bad_faces, else the first bad face throws
/// \throws InputError from the reader; ResourceError when the cap cannot hold the work, naming one that can
MeshCheck check_mesh(MeshReader& mesh, const MeshCheckOptions& options);

Json to_json(const MeshCheck& check);
std::string describe(const MeshCheck& check);  ///< lines for people

}  // namespace tessera
