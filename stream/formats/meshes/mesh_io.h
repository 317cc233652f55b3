/// \file mesh_io.h
/// Triangle meshes in and out, streaming: vertices first, then faces, in bounded batches.
/// More than 2^32 elements never wrap; a format that cannot hold a mesh says so before anything is written.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

using MeshFace = std::array<std::uint64_t, 3>;

/// Known before the first element is written.
struct MeshHeader {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
  bool colour = false;  ///< per-vertex rgba follows positions
  /// Positions need more than floats. All but STL, GLB and 3MF hold them as they are; these as floats from `origin`, and what that
  /// does to the mesh is checked (MeshRounding). Else positions are written as floats.
  bool double_positions = false;
  Double3 origin = {0, 0,
                    0};  ///< STL, GLB and 3MF only: what positions in the file count from (mesh_precision.h)
  bool check_rounding =
      false;  ///< with positions written as floats: they may need more, check what rounding does
  /// Faces say whether they close a hole (PLY: property uchar synthetic); other formats drop it.
  bool synthetic = false;
  /// What was subtracted from the positions (recorded as a comment where the format has one); zero when
  /// positions are in the scan's frame.
  Double3 shift = {0, 0, 0};
  std::vector<std::string> comments;  ///< provenance, one line each
  double unit = 0.0;                  ///< of the positions, metres; 0 = not known. 3MF alone tells it
};

/// What the floats of a format made of the positions.
struct MeshRounding {
  double largest = 0.0;               ///< no position was moved farther, as the file is read back
  std::uint64_t merged_vertices = 0;  ///< came to lie on one that had another position
  std::uint64_t flattened_faces = 0;  ///< had an area
  /// STL alone, which has no vertices of its own: lay exactly where another one does, and are one when it is read.
  std::uint64_t joined_vertices = 0;
  /// 3MF alone, which is for solids: an edge has no face beside it that runs along it the other way.
  bool open = false;
};

/// Writes to a file beside `path` and gives it its final name in finish(); the destructor removes what is
/// unfinished.
class MeshWriter {
 public:
  virtual ~MeshWriter() = default;
  /// Positions and, if header.colour, as many colours. Calls in vertex order; all vertices before any face.
  virtual void vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) = 0;
  /// With header.synthetic, one value per face: 1 where there is no data. Else none.
  virtual void faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic = {}) = 0;
  /// Faces from here on belong to a part of this name (OBJ: `g NAME`); other formats drop it.
  virtual void group(const std::string&) {}
  /// Flushes, syncs, renames. \throws Error when counts differ from the header; ValidationError where rounding to floats
  /// left more than one in a thousand faces without area: then no file gets the name
  virtual void finish() = 0;
  virtual std::uint64_t bytes_written() const = 0;
  /// After finish().
  virtual MeshRounding rounding() const = 0;
};

/// \throws UsageError for an extension that create_mesh_file() does not know
void require_mesh_extension(const std::filesystem::path& path);

/// Of the origin in the 80 bytes of an STL: "; tessera_origin X Y Z" behind "Tessera".
inline constexpr const char* kStlOrigin = "tessera_origin";

/// By extension: .ply (binary little endian), .obj, .stl (binary), .glb, .3mf, .vtu, .msh.
/// \throws UsageError for an unknown extension or a mesh over the format's limits (STL 2^32-1 faces and floats, GLB
///   2^32-1 bytes per buffer, 3MF 2^31-1 vertices), naming one that can hold it; ResourceError when the disk is full
std::unique_ptr<MeshWriter> create_mesh_file(const std::filesystem::path& path, const MeshHeader& header);
/// What the check of rounding takes at most beside the file's own buffer; 0 where nothing is rounded and no vertices are joined.
std::uint64_t rounding_check_bytes(const std::filesystem::path& path, bool double_positions,
                                   std::uint64_t vertices);

/// A mesh on disk, streamed through bounded buffers. Polygons are cut into triangles (polygon_triangulation.h). Both parts
/// can be read any number of times, in any order.
class MeshReader {
 public:
  virtual ~MeshReader() = default;
  /// Counts are claims of the file (polygons count once) and 0 where the format has none.
  virtual const MeshHeader& header() const = 0;
  virtual const std::string& format() const = 0;
  virtual bool shared_vertices() const { return true; }  ///< false: every face has its own three (STL)
  /// Whether a vertex stands in the file once for each of its normals and texture coordinates (glTF): borders and
  /// components are those of the mesh only once vertices of one position are joined.
  virtual bool split_vertices() const { return false; }
  /// All vertices in order, in batches. Formats without shared vertices (STL) give three per face.
  virtual void read_vertices(
      const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>& sink) = 0;
  virtual void read_faces(const std::function<void(std::span<const MeshFace>)>& sink) = 0;
  /// What the file gets wrong and was read past, one sentence each; complete when all was read.
  virtual std::vector<std::string> warnings() const { return {}; }
  /// Mean of what vertices say of their confidence (PLY: property `confidence`), once they were read; none where they do not.
  virtual std::optional<double> mean_confidence() const { return std::nullopt; }
  /// Whether faces say that they close holes (PLY: property `synthetic`).
  virtual bool has_synthetic() const { return false; }
  /// Faces with what they say, one value each; no values if has_synthetic() is false.
  virtual void read_flagged_faces(
      const std::function<void(std::span<const MeshFace>, std::span<const std::uint8_t>)>& sink) {
    read_faces([&](std::span<const MeshFace> faces) { sink(faces, {}); });
  }
};

struct MeshReadOptions {
  /// Hand out faces that name unknown vertices instead of throwing; for checks only.
  bool keep_bad_faces = false;
  /// Folder for positions of vertices that polygons need and that do not fit in memory; empty = the system's.
  std::filesystem::path temp = {};
};

/// PLY, OBJ, STL, OFF, GLB, 3MF, VTU, MSH. \throws InputError (file, offset or line, what is wrong, what to do)
std::unique_ptr<MeshReader> open_mesh_file(const std::filesystem::path& path,
                                           const MeshReadOptions& options = {});

}  // namespace tessera
