/// \file reference_deviation.h
/// The distance between the new star of a collapse and the reference below it, both ways.
///
/// Seen along the normal of the rim's polygon, the new star is a graph over the polygon. The reference is
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
/// cross them; what is left between a line of the rim and the line of the reference is as far as the vertices
/// of either line and of the reference beyond the rim are from the rim's line.
///
/// Rounding. Coordinates are taken relative to the star and then rounded to float, so with R the largest of
/// the polygon, u = 2^-24, a height is off by less than 16 u R; ReferenceDeviation adds that.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/decimate/collapse_deviation.h"
#include "kernels/decimate/collapse_mesh.h"

namespace tessera {

class ReferenceDeviation {
 public:
  ReferenceDeviation() = default;
  /// \param normals  for queries with a min_cosine
  explicit ReferenceDeviation(const CollapseMesh& reference, bool normals = false);

  struct Query {
    Double3 origin{};        ///< of the loop: position of the vertex that takes over
    std::uint32_t seed = 0;  ///< reference vertex inside the polygon or, with a flat edge, on the line there
    std::size_t flat_edge = kNoFlatEdge;  ///< as fan_deviation()
    double limit = 0.0;                   ///< give up above it
    bool cross_creases = false;           ///< walk across creases of the reference as across any edge
    bool inner_centre = false;            ///< at[0] is no part of the rim but the centre of a closed fan
    bool free_corners = false;            ///< corners of the star need not lie on the reference
    /// Give up where a new face turns more against a reference triangle over it. Not where moving one corner of that
    /// by half the limit and a 32nd of the largest height of the triangles around its corners explains the turn.
    double min_cosine = -1.0;
    std::uint32_t witness = kNoCorner;  ///< reference vertex to look at first, as failed_at() named it
  };
  enum class Answer : std::uint8_t { kWithin, kBeyond, kFolded, kNormalDeviates };

  /// \param loop  closed rim of the star or of a side of it, relative to the vertex that takes over (at[0] =
  /// 0);
  /// \param[out] deviation  every point of the new star and of the reference below it lies within it of the other
  /// \return kBeyond where the gap exceeds the limit, kFolded where the reference is no graph over the polygon
  Answer measure(const LinkLoop& loop, const Query& query, double& deviation);

  /// The reference vertex at which the last measure() gave up, kNoCorner where it was at none.
  std::uint32_t failed_at() const { return failed_at_; }

  /// Follows the line of the reference that runs through u both ways to v and to q, where two lines end or meet too.
  /// \param[out] deviation  every point of the line and of the straight edge from v to q lies within it of the other
  /// \return false where the gap exceeds the limit or the line does not lead there
  bool measure_line(std::uint32_t u, std::uint32_t v, std::uint32_t q, double limit, double& deviation) const;

  std::uint64_t walked() const { return walked_; }  ///< triangles looked at so far

 private:
  struct alignas(32) Face {
    std::uint32_t vertex[3], stamp, opposite[3], lines;  ///< lines: as CollapseFace::state; bound
  };
  struct alignas(32) Vertex {
    Double3 at{};
    std::uint32_t stamp, slot;
  };
  struct Point {
    float x, y, z;
    float deviation;              ///< to the polygon's graph or, beyond a line of the rim, to that; 0 outside
    bool inside;                  ///< of the polygon, or between a line of the rim and that of the reference
    std::uint8_t sector;          ///< of the polygon, 0 outside
    std::uint64_t spokes, links;  ///< bit j: left of spoke j, of rim edge j
  };

  /// A triangle to look at, from the corner opposite the edge that led there; slots of the points of that edge.
  struct Step {
    std::uint32_t corner, next, prev;
  };

  bool next_on_line(std::uint32_t at, std::uint32_t from, std::uint32_t& next) const;
  bool set_polygon(const LinkLoop& loop, bool inner_centre);
  std::size_t following(std::size_t i) const { return i + 1 < size_ ? i + 1 : closes_to_; }
  std::uint64_t sector_bits(const Point& p) const {
    return p.spokes & ~(p.spokes >> 1 | (p.spokes >> closes_to_ & 1u) << (size_ - 1)) & p.links & sectors_;
  }
  bool corners_above(const Point* const* corner);
  void classify(Point& p) const;
  bool place(std::uint32_t vertex, std::uint32_t& slot);
  bool meets_polygon(const Point& a, const Point& b) const;
  bool cross_edges(const Point& a, const Point& b, float own);
  bool beyond_line(Point& p);
  bool near_line(const Point& p, float own);
  bool is_line(std::uint32_t c) const {
    return (faces_[c >> 2].lines >> (c & 3u) & (kStateBorder | kStateCrease)) != 0;
  }
  bool seed_faces(std::uint32_t seed, std::size_t flat_edge);
  bool normal_deviates(const Face& face, const Point* const* corner) const;

  std::vector<Face> faces_;
  std::vector<Vertex> vertices_;
  std::vector<std::uint32_t> corner_;  ///< of vertices
  std::vector<float> width_;  ///< per vertex: largest height of the triangles there; for queries of normals
  std::vector<Point> points_;
  std::vector<Step> steps_;
  std::vector<std::uint32_t> fan_;
  std::uint32_t stamp_ = 0;
  std::uint32_t failed_at_ = kNoCorner;
  std::uint64_t walked_ = 0;

  // The polygon at hand: at[j], the edge from there to the next, the plane of the face (0, j, j + 1).
  static constexpr std::size_t kLanes = 8, kPadded = 64;
  std::size_t size_ = 0, groups_ = 0, closes_to_ = 0;
  std::uint64_t sectors_ = 0, all_ = 0,
                inner_spokes_ = 0;  ///< bits of faces, of corners, of edges between two faces
  alignas(32) std::array<float, kPadded> x_{}, y_{}, z_{}, edge_x_{}, edge_y_{}, edge_c_{};
  std::array<float, kPadded> edge_z_{};
  std::array<float, kPadded> slope_x_{}, slope_y_{}, face_cosine_{};
  std::uint64_t lines_ = 0, ends_ = 0, covered_ = 0;
  float min_cosine_ = -1.0f;
  Double3 ex_{}, ey_{}, n_{}, origin_{};
  /// Columns: what x, y and z add to the coordinates in the plane.
  alignas(16) std::array<float, 12> frame_{};
  float deviation_ = 0.0f, limit_ = 0.0f, radius_ = 0.0f;
};

}  // namespace tessera
