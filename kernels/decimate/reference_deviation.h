/// \file reference_deviation.h
/// The distance between the new star of a collapse and the reference below it, both ways.
///
/// Seen along the normal of the link's polygon, the new star is a graph over the polygon. The reference is
/// walked from the removed vertex across every edge that meets the polygon; if all triangles on the way face
/// the same side, the reference is a graph over the polygon too and covers it (its image is open and closed
/// in the polygon). The difference of two graphs that are linear on the overlay of their triangulations is
/// largest at an overlay vertex: a reference vertex, or where a reference edge crosses an edge of the star.
/// The vertices of the star lie on the reference.
///
/// Faces of the reference may know how far they are from what they stand for themselves (CollapseFace::bound): the
/// bound of a triangle is added to the distances at its corners and edges, also to those of lines.
///
/// Lines. Creases and borders end a side of the surface, in the reference as in the block. The walk does not
/// cross them; what is left between a line of the link and the line of the reference is as far as the vertices
/// of either line and of the reference beyond the link are from the link's line.
///
/// Rounding. ReferenceDeviation adds LinkPolygon::rounding() to what it finds.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/decimate/link_polygon.h"
#include "kernels/decimate/reference_mesh.h"

namespace tessera {

class ReferenceDeviation {
 public:
  ReferenceDeviation() = default;
  /// \param normals  for queries with a min_cosine
  explicit ReferenceDeviation(const CollapseMesh& reference, bool normals = false)
      : mesh_(reference, normals) {}
  [[nodiscard]] const ReferenceMesh& mesh() const { return mesh_; }

  struct Query {
    Double3 origin{};        ///< of the loop: position of the vertex that takes over
    std::uint32_t seed = 0;  ///< reference vertex inside the polygon or, with a flat edge, on the line there
    std::size_t flat_edge = kNoFlatEdge;  ///< as fan_deviation()
    double limit = 0.0;                   ///< give up above it
    bool cross_creases = false;           ///< walk across creases of the reference as across any edge
    bool inner_centre = false;            ///< at[0] is no part of the link but the centre of a closed fan
    bool free_corners = false;            ///< corners of the star need not lie on the reference
    /// Give up where a new face turns more against a reference triangle over it. Not where moving one corner of that
    /// by half the limit and a 32nd of the largest height of the triangles around its corners explains the turn.
    double min_cosine = -1.0;
    std::uint32_t witness =
        kNoCorner;  ///< reference vertex to look at first: Result::witness of an earlier one
  };
  enum class Answer : std::uint8_t { kWithin, kBeyond, kFolded, kNormalDeviates };
  struct Result {
    Answer answer = Answer::kBeyond;
    double deviation =
        0.0;  ///< kWithin: every point of the new star and of the reference below it lies within it
              ///< of the other
    std::uint32_t witness = kNoCorner;  ///< kBeyond: the reference vertex that is so, if it was a vertex
  };

  /// \param loop  closed link of the star or of a side of it, relative to the vertex that takes over (at[0] = 0)
  /// \return kBeyond where the deviation exceeds the limit, kFolded where the reference is no graph over the polygon
  Result measure(const LinkLoop& loop, const Query& query);

  [[nodiscard]] std::uint64_t walked() const { return walked_; }  ///< triangles looked at so far

 private:
  struct Walk;
  /// A triangle to look at, from the corner opposite the edge that led there; slots of the points of that edge, but where
  /// the walk starts.
  struct Step {
    std::uint32_t corner, next, prev;
  };
  Answer begin_walk(const Query& query, Walk& walk);
  Answer go_on(Walk& from);
  template <bool kSeed>
  Answer visit(std::uint32_t at, Walk& walk);
  bool leave(const ReferenceMesh::Face& face, std::uint32_t corner, std::uint32_t next, std::uint32_t prev,
             Walk& walk);
  bool add_point(std::uint32_t vertex, Walk& walk, std::uint32_t& slot);
  bool normal_deviates(const ReferenceMesh::Face& face, const PolygonTriangle& p, float min_cosine,
                       float limit) const;

  ReferenceMesh mesh_;
  std::uint32_t stamp_ = 0;  ///< of the walk at hand: even on faces to look at, odd on those that have been
  std::uint64_t walked_ = 0;
  // Scratch of a walk, kept for its memory; Walk says how much of points_ and steps_ is filled.
  LinkPolygon polygon_;
  std::vector<PolygonPoint> points_;
  std::vector<Step> steps_;
  std::vector<std::uint32_t> fan_;
};

}  // namespace tessera
