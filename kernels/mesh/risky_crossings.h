/// \file risky_crossings.h
/// Crossings near the few faces of a block that may have any: where vertices were moved off the lattice. All other faces lie in
/// cells of their own, where none crosses another.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "kernels/mesh/block_contacts.h"

namespace tessera {

/// A larger core than of so many cells an axis is marked by larger cells.
inline constexpr std::uint64_t kMaxRiskCells = 128;

struct RiskyMesh {
  std::vector<Double3> position;    ///< cells, or any other unit if `cell` tells how many of it are a cell
  std::vector<std::uint64_t> name;  ///< per vertex: those with one name are one
  std::vector<std::uint8_t> risky;  ///< per vertex: its faces may cross others
  std::vector<std::array<std::uint32_t, 3>> faces;
  double cell = 1.0;

  [[nodiscard]] bool is_risky(const std::array<std::uint32_t, 3>& f) const {
    return (risky[f[0]] | risky[f[1]] | risky[f[2]]) != 0;
  }
};

/// Calls use(i, j), i < j, for the pairs of faces that cross, overlap or touch in the core (block_contacts.h), a risky one among
/// them. Only faces with a corner within a cell of a risky one are compared. Faces without an area take no part.
/// \pre  as block_contacts', but faces may have no area; one that is not risky is at most a cell wide; the core is bounded
/// \cost O(n) time and n log n in what is compared; risky_crossings_bytes()
void risky_crossings(const RiskyMesh& mesh, const ContactCell& core,
                     const std::function<void(std::uint32_t, std::uint32_t)>& use);

/// Upper bound of what it allocates. \param cells  along an axis of the core, at most
[[nodiscard]] constexpr std::uint64_t risky_crossings_bytes(std::uint64_t faces, std::uint64_t cells) {
  const std::uint64_t marks = std::min(cells, kMaxRiskCells) + 1;
  return faces * (sizeof(ContactFace) + 8) + marks * marks * marks + block_contacts_bytes(faces);
}

}  // namespace tessera
