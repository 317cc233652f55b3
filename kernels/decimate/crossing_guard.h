/// \file crossing_guard.h
/// Keeps edits of a mesh from making it cross itself: whether faces that an edit makes would meet others beyond the edges and
/// corners that they share (face_contact.h), exactly.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/face_boxes.h"
#include "kernels/mesh/face_contact.h"

namespace tessera {

class CrossingGuard {
 public:
  /// \param mesh  outlives it
  explicit CrossingGuard(const CollapseMesh& mesh) : mesh_(mesh) {}

  /// Looks at all faces of the mesh anew: at first, and when they have got other numbers.
  void build();

  /// Whether the faces `made` meet more of the mesh without `gone`, and of each other, than the faces `gone` do now. So a place
  /// that crosses already may be edited, as long as it does not get worse.
  /// \param made     corners are numbers of vertices of the mesh, at positions that need not be theirs yet
  /// \param outline  vertices around the faces made, in order, where they are a disk and lie where the mesh has them; else empty
  bool adds_contact(std::span<const std::uint32_t> gone, std::span<const ContactFace> made,
                    std::span<const std::uint32_t> outline);

  /// These faces have changed in the mesh, or died.
  void update(std::span<const std::uint32_t> faces);

  /// A face of the mesh as it is.
  ContactFace contact_face(std::uint32_t f) const;

 private:
  class Outline;
  FaceBoxes::Box box_of(std::uint32_t f) const;
  std::size_t contacts(std::span<const std::uint32_t> gone, std::span<const ContactFace> faces,
                       const Outline& outline);

  const CollapseMesh& mesh_;
  FaceBoxes boxes_;
  // Of the edit at hand.
  std::vector<ContactFace> before_;
  std::vector<FaceBoxes::Box> box_;
};

}  // namespace tessera
