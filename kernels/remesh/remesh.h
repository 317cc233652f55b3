/// \file remesh.h
/// Isotropic remeshing of one block of mesh: triangles near equilateral with edges of a given length, on the reference.
///
/// Rounds of splits above 4/3 of the length, collapses below 4/5, flips towards valence 6 (lines: 4 on each side),
/// tangential relaxation with projection to the reference. Source: Botsch and Kobbelt, "A Remeshing Approach
/// to Multiresolution Modeling", 2004; Botsch's thesis, 3.2.3. Creases and borders are found as in decimation; their
/// vertices slide along the reference's polylines, corners stay.
///
/// As in decimation, a vertex is free if its star is complete in the block; all others keep key and position, so blocks
/// of one pass may run in any order or at once.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Edges: shorter creases that end somewhere are noise at this size.
inline constexpr double kMinCreaseEdges = 2.0;

struct RemeshOptions {
  double edge = 0.0;  ///< target length of edges, scan units, > 0; the longest where lengths adapt
  /// Above 0: lengths adapt to the curvature (sizing_field.h) between min_edge and edge.
  double sizing_tolerance = 0.0;
  double min_edge = 0.0;
  /// Above 0: edges are shorter where creases bend, so that chords keep within it; creases and corners yield no farther.
  double crease_tolerance = 0.0;
  /// Above 0: an operation must leave new faces and removed vertices within it of the reference, as far as their
  /// corners, centres and edges tell: a strong test, not the proof. Creases and borders get half of it.
  double tolerance = 0.0;
  /// And in the end edges are split where faces are beyond it, or vertices of the reference, until they are as short.
  bool refine_beyond = false;
  /// Above 0, without that: edges are split in the same way as far as this distance asks for, where a few splits do.
  double refine_within = 0.0;
  /// Edges far shorter than they should be collapse where that folds the surface no more than it is, whatever faces turn
  /// by. Not with refine_beyond: a proof would split again what gave way.
  bool collapse_needles = false;
  double max_normal_deviation_deg = 0.0;  ///< of a face against the reference at its centre; 0 = free
  double feature_angle_deg = 25.0;        ///< edges that turn by more are creases; 0 = none
  int iterations = 4;
  int relaxations = 3;          ///< in each of them
  int last_relaxations = 2;     ///< behind the last iteration: of angles and of the cells around vertices
  double angle_weight = 8.0;    ///< of angles in these, against areas; above 0
  int size_relaxations = 0;     ///< behind these: of the sum of what cells and angles are off, not of squares
  double sine_weight = 0.2;     ///< of a corner's sine of what it is off 60 degrees there, against a cell
  bool float_positions = true;  ///< new positions are rounded to float, as the file will hold them
  /// The block still is a part of the reference: creases are found, and lattices coarsened away. Later ones bear creases
  /// (kFaceCrease01).
  bool find_creases = false;
  std::size_t max_faces = 0;  ///< edges are not split beyond; a later pass goes on. At least the block's
  // Of a block without locked vertices, of which more faces than these are of no use; 0: any number is.
  std::size_t useless_faces = 0;  ///< where more come out it is not done again for what meets in it
  std::size_t hopeless_faces =
      0;  ///< where more are left after the second iteration for want of room it ends there
  std::uint64_t first_key = 0;  ///< of new vertices: this, the next, ...; above all others
  /// Above 0: faces with a smaller angle than that are worked on and nothing else is done: a pass behind all others.
  double min_angle_deg = 0.0;
  // Above 1: edges that join vertices whose mean edges differ by more are worked on and nothing else is done: a pass
  // behind all others. No step leaves more faces with an angle below kept_angle_deg, nor a sharper one among them; first
  // the same is kept with 30 and 25 degrees. With refine_beyond no point of the reference gets out of reach.
  double max_length_ratio = 0.0, kept_angle_deg = 20.0;
  /// Called every few thousand edges or vertices that were looked at; what it throws ends the work and leaves the block
  /// in no state to be used. Empty = never.
  std::function<void()> pause{};

  void validate() const;  ///< throws UsageError naming the field
};

struct RemeshReport {
  std::size_t faces_in = 0, faces_out = 0;
  std::size_t locked_vertices = 0;
  std::size_t splits = 0, collapses = 0, flips = 0, moves = 0;
  /// Why operations were refused.
  std::size_t by_link = 0, by_fold = 0, by_tolerance = 0, by_crossing = 0, by_capacity = 0;
  /// With min_angle_deg: faces below it before, and of those left, but for such between lines that meet at a smaller angle:
  /// at vertices that stay, and refused something for the tolerance in the last try.
  std::size_t sharp_in = 0, sharp_held = 0, sharp_by_tolerance = 0;
  // With max_length_ratio: edges beyond it before, and of those left: beside faces that stay, between vertices on creases
  // or borders, and refused something for the tolerance in the last try.
  std::size_t uneven_in = 0, uneven_held = 0, uneven_at_lines = 0, uneven_by_tolerance = 0;
  bool guard_spent =
      false;  ///< boxes of its needles tell too few apart: what makes faces meet was refused up to some step alone
};

/// Remeshes `block` in place.
/// \param block      any order; comes back canonical, without face_bound
/// \param reference  the original surface with all that comes within four edge lengths of the block; canonical. May be `block`,
///                   canonical then: of it only what remeshing leaves alone until its end is asked for
/// \param pinned       keys, ascending, of vertices whose faces all stay as they are
/// \pre    every edge of the block has at most two faces, oppositely directed; positions are finite
/// \post   pure function of the set of faces and the options; locked vertices unchanged; edge-manifold. If more faces of the
///         block meet others beyond what they share (face_contact.h) than before, it is done again with all that would
///         make them refused, as they will be written, as long as that is not too much to look at, and the better of both stays.
/// \throws InputError  an edge with more than two faces or with two faces of the same direction
/// \throws UsageError  from options.validate()
RemeshReport remesh(MeshBlock& block, const MeshBlock& reference, const RemeshOptions& options,
                    std::span<const std::uint64_t> pinned = {});

/// Upper bound of what remesh() allocates above its arguments. \param max_faces  RemeshOptions::max_faces
/// \param refines  RemeshOptions::refine_beyond \param evens  with max_length_ratio
[[nodiscard]] std::uint64_t remesh_bytes(std::uint64_t max_faces, std::uint64_t reference_faces, bool refines,
                                         bool evens = false);

}  // namespace tessera
