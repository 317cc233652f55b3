/// \file mesh_crossings.h
/// Pairs of faces of a mesh on disk that cross, overlap or touch beyond what they share (face_contact.h), exactly. Faces are
/// dealt to cells of space that fit the cap; no number depends on the cells, the threads or the order of the faces.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "kernels/mesh/face_contact.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"

namespace tessera {

inline constexpr std::size_t kListedCrossings = 100;  ///< pairs that a report lists

struct FaceCrossing {
  FaceContact contact = FaceContact::kNone;
  Double3 place = {0, 0, 0};                    ///< middle of what the boxes of both have in common
  std::array<std::uint64_t, 2> faces = {0, 0};  ///< ascending; numbers of triangles as they are read, from 0

  bool operator==(const FaceCrossing&) const = default;
};
/// Those that cross first, then overlap, then touch; by place, then by faces.
bool operator<(const FaceCrossing& a, const FaceCrossing& b);

struct MeshCrossings {
  std::uint64_t crossing = 0, overlapping = 0, touching = 0;  ///< pairs
  std::uint64_t faces = 0;                                    ///< in at least one pair
  std::uint64_t left_out =
      0;  ///< faces that take no part: corners on one line, repeated, not finite or unknown
  std::vector<FaceCrossing> listed;  ///< the first kListedCrossings

  std::uint64_t pairs() const { return crossing + overlapping + touching; }
  std::vector<std::string> defects() const;  ///< one sentence per kind
};

struct MeshCrossingOptions {
  std::uint64_t memory_bytes = std::uint64_t{1}
                               << 30;  ///< all that is allocated, the reader and the store excluded
  std::filesystem::path temp;          ///< as VertexStore's
  int threads = 1;
  std::function<void()> check_stop;  ///< may throw StoppedError; any thread; may be empty
  /// Gets the faces of all pairs, ascending, each once; may be empty.
  std::function<void(std::span<const std::uint64_t>)> faces;
};

/// Reads the faces of the mesh once.
/// \param positions  of the vertices of `mesh`
/// \throws ResourceError when more faces meet in one place than the cap can hold, naming one that can
MeshCrossings find_crossings(MeshReader& mesh, VertexStore& positions, const MeshCrossingOptions& options);

Json to_json(const MeshCrossings& crossings);
std::string describe(const MeshCrossings& crossings);  ///< lines for people

}  // namespace tessera
