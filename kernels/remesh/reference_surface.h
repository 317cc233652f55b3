/// \file reference_surface.h
/// What a remeshed block is held against: the closest point of the reference, its normal there, and its lines: creases
/// and borders as polylines between corners, along which vertices slide.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/mesh_block.h"
#include "kernels/remesh/sizing_field.h"

namespace tessera {

class ReferenceSurface {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  /// Creases are found as decimation finds them (feature_edges.h). A vertex where other than two lines meet, or one
  /// that bends by more than 45 degrees (a border: 60), is a corner. A crease that ends somewhere and is shorter than
  /// `min_line` or three edges is none, nor are creases that hang together and are shorter than twice that in all.
  /// \param reference  canonical, edge-manifold; must outlive this \param origin  subtracted from all positions
  ReferenceSurface(const MeshBlock& reference, const Double3& origin, double feature_angle_deg,
                   double min_line, const SizingOptions& sizing);

  struct Foot {
    Double3 at{};  ///< relative to the origin
    double square = 0.0;
    std::uint32_t slot =
        kNone;  ///< face of the reference, on lines a segment; kNone: nothing within the limit
  };
  /// \param hint  a face that is near, to be faster, or kNone
  [[nodiscard]] Foot closest(const Double3& p, double limit_square, std::uint32_t hint = kNone) const;
  /// The same from the foot of a point nearby: walks from its face towards p, over no line, to where no face beside is
  /// nearer. That need not be the nearest of all: farther away than the root of `trust_square` it searches.
  [[nodiscard]] Foot near(const Double3& p, double limit_square, double trust_square,
                          std::uint32_t face) const;
  /// Unit normal of the face, averaged with those across its edges that are no creases; zero for none.
  [[nodiscard]] const Float3& normal(std::uint32_t face) const { return normal_[face]; }

  /// Whether lengths differ.
  [[nodiscard]] bool is_graded() const { return graded_; }
  /// How long edges may be at a foot in a face, on a segment.
  [[nodiscard]] float length_in_face(std::uint32_t face, const Double3& p) const;
  [[nodiscard]] float length_on_line(std::uint32_t segment, const Double3& p) const;

  [[nodiscard]] std::span<const Double3> vertices() const { return at_; }  ///< relative to the origin
  [[nodiscard]] std::span<const std::array<std::uint32_t, 3>> faces() const { return face_; }

  [[nodiscard]] bool has_lines() const { return !segments_.empty(); }
  /// Foot on any line; slot is a segment.
  [[nodiscard]] Foot closest_on_lines(const Double3& p) const;
  /// Foot on the polyline of this segment, walking from it while that comes closer; stops at corners.
  [[nodiscard]] Foot slide(const Double3& p, std::uint32_t segment) const;

  /// Per vertex of the block a face that has it as a corner, by key and place; kNone where it is not in the reference.
  [[nodiscard]] std::vector<std::uint32_t> faces_at(const MeshBlock& block) const;

  /// The colour at a foot in a face; the reference has colours.
  [[nodiscard]] std::uint32_t colour(std::uint32_t face, const Double3& p) const;

  /// Which vertices of the block, by key and place, are corners that no length of edges takes away: where at least three
  /// creases that turn by more than 45 degrees meet, or a line bends, and one of them is long enough to bear an edge.
  /// What lies beside other corners alone is noise at this size.
  [[nodiscard]] std::vector<std::uint8_t> lasting_corners(const MeshBlock& block) const;

  /// Gives the vertices and edges of `block` that are in the reference too, by key, their vertex_class and bits of
  /// creases. \pre keys ascend in both
  void mark(MeshBlock& block) const;

  /// Bytes that it takes while it is made, per face of the reference.
  [[nodiscard]] static constexpr std::uint64_t bytes_per_face() {
    return ClosestFaces::bytes_per_face() + 220;
  }
  /// Bytes that it holds from then on: 57 beside the hierarchy's 136, and 170 a segment of a line, a fifth of the faces having one.
  [[nodiscard]] static constexpr std::uint64_t held_bytes_per_face() {
    return ClosestFaces::bytes_per_face() + 76;
  }

 private:
  struct Segment {
    std::array<std::uint32_t, 2> vertex{};
    std::array<std::uint32_t, 2> beyond{kNone, kNone};  ///< the segment that goes on there
    bool crease = false;                                ///< else a border
    bool strong = false;  ///< a border, or a crease that turns by more than 45 degrees
  };
  std::vector<std::uint32_t> numbers_in(const MeshBlock& block) const;
  void copy_mesh(const CollapseMesh& mesh);
  void find_lines(CollapseMesh& mesh, double feature_angle_deg, double min_line);
  void prune_twigs(double min_line, const std::vector<std::uint8_t>& goes_on);
  void prune_islands(double min_sum, const std::vector<std::uint8_t>& goes_on);
  void join_segments();
  void find_lasting_corners(double min_line);
  double length_from(std::uint32_t vertex, std::uint32_t segment, double enough) const;
  void size(const SizingOptions& sizing);
  std::vector<float> chords(const SizingOptions& sizing) const;
  float chord_length(std::uint32_t segment, std::size_t side, const SizingOptions& sizing) const;
  void walk_line(std::uint32_t vertex, std::uint32_t segment, double left, std::vector<Double3>& part) const;
  const Double3& at(std::uint32_t v) const { return at_[v]; }
  Foot on_segment(const Double3& p, std::uint32_t segment) const;

  const MeshBlock* reference_;
  ClosestFaces faces_, lines_;
  std::vector<std::uint32_t> slot_;  ///< per face, in faces_
  // Vertices and faces in Morton order: what is walked through lies together.
  std::vector<Double3> at_;            ///< relative to the origin
  std::vector<std::uint32_t> number_;  ///< per vertex, in the reference
  std::vector<std::array<std::uint32_t, 3>> face_;
  /// Per face: across the edges opposite its corners, over no line.
  std::vector<std::array<std::uint32_t, 3>> adjacent_;
  std::vector<Float3> normal_;
  std::vector<VertexClass> class_;                     ///< per vertex: smooth, crease or corner
  std::vector<std::array<std::uint32_t, 2>> creases_;  ///< lower vertex first, ascending
  std::vector<Segment> segments_;
  std::vector<std::uint8_t> lasting_;  ///< per vertex: lasting_corners()
  std::vector<float> length_;          ///< per vertex: sizing_field.h
  bool graded_ = false;
};

}  // namespace tessera
