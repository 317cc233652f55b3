/// \file crossing_guard.h
/// Keeps edits of a mesh from making it cross itself: whether faces that an edit makes would meet others beyond the edges and
/// corners that they share (face_contact.h), exactly.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/sheet_marks.h"
#include "kernels/mesh/face_boxes.h"
#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/face_planes.h"

namespace tessera {

/// Pairs of faces of a mesh as it is that meet so.
[[nodiscard]] std::size_t count_contacts(const CollapseMesh& mesh);

class CrossingGuard {
 public:
  /// \param mesh  outlives it
  explicit CrossingGuard(const CollapseMesh& mesh) : mesh_(mesh) {}

  /// From now on collapses in a sheet are answered without a search. \pre all edits are collapses until renew()
  void use_sheets() { by_sheets_ = true; }

  /// To be called at first, and when there are new faces or they have got other numbers: all are looked at anew once an edit
  /// is asked about, so that edits before cost nothing.
  /// \param order  kGiven where numbers of faces that are near each other are, too
  void renew(FaceBoxes::Order order) { order_ = order, built_ = marked_ = by_sheets_ = false; }

  // Whether the faces that an edit makes meet more of the mesh, and of each other, than those that it takes away do, but in copies of a vertex that no edit has put there: a place
  // that crosses already may be edited as long as it does not get worse. Once the edit is done, accept() takes it over.

  /// The collapse of the star's centre into star.ring[at].
  bool collapse_adds(const Star& star, std::size_t at);
  /// The same, and that one goes to another place. \param other  its star
  bool collapse_adds(const Star& star, std::size_t at, const Star& other, const Double3& to);
  /// The star's centre goes to another place.
  bool move_adds(const Star& star, const Double3& to);
  /// The flip of the edge opposite a corner.
  bool flip_adds(std::uint32_t corner);
  void accept();
  /// The same for a collapse of this star as it was asked about, quicker: its boxes are known.
  void accept_collapse(const Star& star);
  /// A collapse of this star that was not asked about. Its faces get the box of all of them until renew().
  void accept_unasked(const Star& star);

  /// Whether the faces that the edit last asked about makes meet any: where it adds none, some that were there before.
  bool made_meet() const { return made_meet_; }
  /// Whether a face meets others as the mesh is.
  bool meets(std::uint32_t face);

  /// Faces whose boxes met those of edits, in all: what it costs. Some thirty an edit, thousands among needles.
  [[nodiscard]] std::uint64_t looked_at() const { return looked_at_; }

 private:
  class Outline;
  void build();
  ContactFace contact_face(std::uint32_t f) const;
  FaceBoxes::Box box_of(std::uint32_t f) const;
  void prefetch_corners(std::uint32_t f) const;
  void begin(std::uint32_t removed);
  void take_star(const Star& star, std::uint32_t other_end, std::uint32_t name, const Double3& to);
  bool in_sheet(const Star& star);
  void tell_sheets(const Star& star);
  bool adds(const Outline& outline);
  static constexpr std::size_t kAll = ~std::size_t{0};
  std::size_t contacts(std::span<const ContactFace> faces, std::span<const FaceBoxes::Box> boxes,
                       const Outline& outline, std::size_t enough);
  void find_boxes(std::span<const ContactFace> faces, std::vector<FaceBoxes::Box>& boxes) const;

  const CollapseMesh& mesh_;
  FaceBoxes boxes_;  ///< as the mesh is, where built_
  FaceBoxes::Order order_ = FaceBoxes::Order::kGiven;
  bool built_ = false;
  SheetMarks sheets_;  ///< where marked_
  bool by_sheets_ = false, marked_ = false;
  std::uint64_t looked_at_ = 0;
  // Of the edit at hand.
  static constexpr std::uint64_t kNobody = ~std::uint64_t{0};
  std::uint32_t removed_ = kNoCorner;     ///< the vertex that goes: all of its faces are in gone_
  std::uint64_t moved_ = kNobody;         ///< the vertex that lies elsewhere in what is left
  std::vector<std::uint32_t> gone_;       ///< faces that it takes away or changes
  std::vector<ContactFace> made_;         ///< what it leaves of them: corners are numbers of vertices
  std::vector<std::uint32_t> made_face_;  ///< of a star: which it leaves
  std::vector<FaceBoxes::Box> made_box_;
  bool made_meet_ = false;
  bool leaves_sheets_ = false;  ///< what is certain stays so
  std::vector<ContactFace> before_;
  std::vector<FaceBoxes::Box> before_box_;
  std::vector<Double3> ring_;
  std::vector<FacePlanes> planes_;  ///< of the faces that are asked about
};

}  // namespace tessera
