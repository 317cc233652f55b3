/// \file mesh_cuts.h
/// Where the surfaces of two closed meshes meet: points, each the one common point of a vertex, an edge or a face of the first and
/// one of the second, and segments between them. Which there are is decided on the coordinates as given, exactly; what they
/// are the same point of is a matter of names, never of distances. As neither mesh crosses itself, segments meet in points alone.
/// Source: Guigue and Devillers 2003 (face_contact.h) for the pairs; Zhou, Grinspun, Zorin, Jacobson, "Mesh Arrangements for
/// Solid Geometry", 2016.
#pragma once
#include <array>
#include <compare>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "kernels/boolean/exact_point.h"

namespace tessera {

/// Outward counter-clockwise; vertices at one position are one.
struct SolidMesh {
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

/// The vertex, edge without its ends, or face without its edges that a point lies on.
struct Carrier {
  enum class Kind : std::uint8_t { kVertex, kEdge, kFace };
  Kind kind = Kind::kVertex;
  std::uint32_t first = 0;   ///< vertex; lower end of the edge; face
  std::uint32_t second = 0;  ///< upper end of the edge

  auto operator<=>(const Carrier&) const = default;
  [[nodiscard]] static Carrier vertex(std::uint32_t v) { return {Kind::kVertex, v, 0}; }
  [[nodiscard]] static Carrier edge(std::uint32_t v, std::uint32_t w) {
    return {Kind::kEdge, v < w ? v : w, v < w ? w : v};
  }
  [[nodiscard]] static Carrier face(std::uint32_t f) { return {Kind::kFace, f, 0}; }
  /// Whether it belongs to the face or its sides.
  [[nodiscard]] bool within(std::uint32_t f, const std::array<std::uint32_t, 3>& corner) const {
    const auto has = [&](std::uint32_t v) { return v == corner[0] || v == corner[1] || v == corner[2]; };
    return kind == Kind::kFace ? first == f : kind == Kind::kEdge ? has(first) && has(second) : has(first);
  }
};

using PointPair = std::pair<std::uint32_t, std::uint32_t>;  ///< ascending

struct MeshCuts {
  /// Vertices of the first mesh, of the second, then what edges and faces have in common.
  PointTable points;
  std::uint32_t first_vertices = 0, first_faces = 0;
  /// Faces of both, the first mesh's first, by numbers of points. A vertex of the second at a position of the first has that
  /// one's number.
  std::vector<std::array<std::uint32_t, 3>> faces;
  struct Meeting {
    Carrier on_first, on_second;
  };
  std::unordered_map<std::uint32_t, Meeting> meetings;  ///< of every point that lies on both
  struct CutFace {
    std::uint32_t face = 0;
    std::vector<std::uint32_t> inner;     ///< points in it or on its edges, its corners excluded
    std::vector<PointPair> segments;      ///< in it or along its edges
    std::vector<std::uint32_t> coplanar;  ///< faces of the other mesh that overlap it
  };
  std::vector<CutFace> cut;         ///< faces that meet the other mesh, ascending
  std::vector<PointPair> segments;  ///< all, ascending
  std::uint64_t face_pairs = 0, coplanar_pairs = 0;
};

/// \pre  both closed, no face without area, neither meets itself (face_contact.h) beyond what faces share
/// \cost a tree over faces near the other mesh, and about 10 us a pair that meets
[[nodiscard]] MeshCuts find_mesh_cuts(const SolidMesh& first, const SolidMesh& second);

}  // namespace tessera
