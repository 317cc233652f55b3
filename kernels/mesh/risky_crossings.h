/// \file risky_crossings.h
/// Crossings near the few faces of a block that may have any: where vertices were moved off the lattice. All other faces lie in
/// cells of their own, where none crosses another.
#pragma once
#include <cstdint>
#include <functional>
#include <span>

#include "kernels/mesh/block_contacts.h"

namespace tessera {

/// Calls use(i, j), i < j, for the pairs of faces that cross or overlap in the core (block_contacts.h), a risky one among
/// them. Only faces that share a unit cell with a risky one are compared. Faces without an area take no part.
/// \param risky  per face
/// \pre  block_contacts', but faces may have no area; the core is bounded
/// \cost O(n) time and n log n in what is compared; risky_crossings_bytes()
void risky_crossings(std::span<const ContactFace> faces, std::span<const std::uint8_t> risky,
                     const ContactCell& core, const std::function<void(std::uint32_t, std::uint32_t)>& use);

/// Upper bound of what it allocates. \param cells  of the core
constexpr std::uint64_t risky_crossings_bytes(std::uint64_t faces, std::uint64_t cells) {
  return faces * (sizeof(ContactFace) + 5) + cells + block_contacts_bytes(faces);
}

}  // namespace tessera
