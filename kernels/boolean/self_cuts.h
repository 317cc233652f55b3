/// \file self_cuts.h
/// Where the faces of one surface meet each other beyond what they share: points and the segments between them. Which there are is
/// decided on the coordinates as given, exactly; points of quotients are the same where their quotients are, whatever faces they
/// came from, so three faces through one point are no special case.
/// Source: Zhou, Grinspun, Zorin, Jacobson, "Mesh Arrangements for Solid Geometry", 2016.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/boolean/mesh_cuts.h"

namespace tessera {

struct SelfCuts {
  PointTable points;                   ///< vertices of the mesh, then those on the cuts
  std::vector<MeshCuts::CutFace> cut;  ///< faces with points or segments of others in them, ascending
  std::vector<PointPair> segments;     ///< all, ascending; they meet in points alone
  std::uint64_t coplanar_pairs = 0;
};

/// \param mesh   vertices at one position are one
/// \param pairs  of faces that meet (face_contact.h), first below second, each once
/// \pre  the faces of pairs have an area
/// \cost about 20 us a pair, and the square of the segments of a face
[[nodiscard]] SelfCuts find_self_cuts(const SolidMesh& mesh, std::span<const PointPair> pairs);

/// Whether a point in the plane of a face lies on it or its sides. \param u, v  axes along which the face has an area
[[nodiscard]] bool lies_on_face(const PointTable& points, const std::array<std::uint32_t, 3>& face,
                                std::uint32_t point, std::size_t u, std::size_t v);
/// Two axes along which a face has an area, such that it turns counter-clockwise.
[[nodiscard]] std::array<std::size_t, 2> flat_axes(const PointTable& points,
                                                   const std::array<std::uint32_t, 3>& face);

}  // namespace tessera
