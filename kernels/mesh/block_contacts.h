/// \file block_contacts.h
/// All pairs of faces of a block that meet beyond what they share (face_contact.h).
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/mesh_block.h"
#include "octree/vector.h"

namespace tessera {

/// Half open: low <= x < high on every axis; infinite where a mesh is not cut.
struct ContactCell {
  Double3 low, high;
};

/// How pairs come.
enum class ContactOrder : std::uint8_t {
  kCurve,  ///< along a curve through the middles of all faces
  kAny     ///< quicker where few faces may meet others
};

/// Calls use(i, j, contact), i < j, for the pairs whose boxes overlap from a place in the cell on: the lowest corner of what
/// their boxes have in common decides. So cells that tile space tell every pair once, if each is given all faces whose
/// boxes meet it.
/// \pre  as face_contact's of every face; less than 2^32 of them
/// \cost O(n log n) time, about 0.3 us a face of a scan, 0.1 us where it is one sheet seen along an axis; block_contacts_bytes()
void block_contacts(std::span<const ContactFace> faces, const ContactCell& cell,
                    const std::function<void(std::uint32_t, std::uint32_t, FaceContact)>& use,
                    ContactOrder order = ContactOrder::kCurve);

/// Half open, all of space.
inline constexpr ContactCell kAllSpace = {
    {-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
     -std::numeric_limits<double>::infinity()},
    {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
     std::numeric_limits<double>::infinity()}};

/// Faces of a block that may be asked about, corners named by their numbers in it: those that have an area.
/// \param number  gets their numbers; may be null
[[nodiscard]] std::vector<ContactFace> contact_faces(const MeshBlock& block,
                                                     std::vector<std::uint32_t>* number = nullptr);

/// Those of contact_faces() that may meet others: all pairs that block_contacts() finds are of these. They are few where a block is
/// one sheet over a plane, which takes O(n) time to see, and all of them elsewhere.
[[nodiscard]] std::vector<ContactFace> doubtful_faces(const MeshBlock& block,
                                                      std::vector<std::uint32_t>* number = nullptr);

/// Calls use(one, other) for the pairs of some faces of a block that meet so, but for those that meet in copies of a vertex alone.
/// Sooner than asking doubtful_faces(): where the surface ends is told by MeshBlock::face_flags, and it counts as ended where
/// others of the block lie around. \param core  1 for those faces
void core_contacts(const MeshBlock& block, std::span<const std::uint8_t> core,
                   const std::function<void(const ContactFace&, const ContactFace&)>& use);

/// How many pairs of faces of a block meet so, whatever the kind, but for those that meet in copies of a vertex alone; those
/// without an area meet none. It stops at `enough`.
/// \cost  as above, and 96 bytes a face
[[nodiscard]] std::size_t count_contacts(const MeshBlock& block, std::size_t enough = ~std::size_t{0});

/// Upper bound of what block_contacts() allocates.
[[nodiscard]] constexpr std::uint64_t block_contacts_bytes(std::uint64_t faces) {
  return faces * 56 + 4096;
}

}  // namespace tessera
