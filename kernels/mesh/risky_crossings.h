/// \file risky_crossings.h
/// Crossings near the few faces of a block that may have any: where vertices were moved off the lattice. All other faces lie in
/// cells of their own, where none crosses another.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "kernels/mesh/block_contacts.h"

namespace tessera {

struct RiskyMesh {
  std::vector<Double3> position;    ///< cells
  std::vector<std::uint64_t> name;  ///< per vertex: those with one name are one
  std::vector<std::uint8_t> risky;  ///< per vertex: its faces may cross others
  std::vector<std::array<std::uint32_t, 3>> faces;

  bool is_risky(const std::array<std::uint32_t, 3>& f) const {
    return (risky[f[0]] | risky[f[1]] | risky[f[2]]) != 0;
  }
};

/// Calls use(i, j), i < j, for the pairs of faces that cross or overlap in the core (block_contacts.h), a risky one among
/// them. Only faces with a corner within a cell of a risky one are compared. Faces without an area take no part.
/// \pre  as block_contacts', but faces may have no area; one that is not risky is at most a cell wide; the core is bounded
/// \cost O(n) time and n log n in what is compared; risky_crossings_bytes()
void risky_crossings(const RiskyMesh& mesh, const ContactCell& core,
                     const std::function<void(std::uint32_t, std::uint32_t)>& use);

/// Upper bound of what it allocates. \param cells  of the core, and one more along each axis
constexpr std::uint64_t risky_crossings_bytes(std::uint64_t faces, std::uint64_t cells) {
  return faces * (sizeof(ContactFace) + 8) + cells + block_contacts_bytes(faces);
}

}  // namespace tessera
