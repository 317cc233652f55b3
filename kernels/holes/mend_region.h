/// \file mend_region.h
/// Faces of a block that are to be taken out, part by part as disks: what crossing_mend.h fills anew.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Faces that were taken out and hang together, and their outline as a filling runs along it.
struct MendDisk {
  std::vector<std::uint32_t> faces;  ///< ascending
  /// Vertices. A hole of the mesh amid the faces is part of it: the loop goes there and back along a bridge, whose two vertices
  /// are in it twice.
  std::vector<std::uint32_t> loop;
};

/// What lies around faces of a block. \pre edges have at most two faces; the block outlives it
class MendRegion {
 public:
  using Corners = std::array<std::uint32_t, 3>;
  using Edge = std::array<std::uint32_t, 2>;  ///< from, to
  static constexpr std::uint32_t kNoFace = ~std::uint32_t{0};

  /// \param whole  a box in which the block has all faces of the mesh
  MendRegion(const MeshBlock& block, const ContactCell& whole);

  std::span<const std::uint32_t> faces_at(std::uint32_t v) const {
    return {at_.data() + start_[v], start_[v + std::size_t{1}] - start_[v]};
  }
  const Corners& corners(std::uint32_t f) const { return block_.faces[f]; }
  static Edge edge(const Corners& f, std::size_t k) { return {f[k], f[(k + 1) % 3]}; }
  /// The face across an edge, whichever way it runs; kNoFace at a border.
  std::uint32_t across(std::uint32_t f, const Edge& e) const;

  bool is_within(const Double3& p) const;
  /// All faces at the corners are here: an edge of one face is a border.
  bool is_known(const std::vector<std::uint32_t>& region) const;
  /// With all faces at its corners. \param region  ascending, as all of them
  void grow(std::vector<std::uint32_t>& region) const;
  /// Faces that share edges, part by part, in the order of their first faces.
  std::vector<std::vector<std::uint32_t>> parts_of(const std::vector<std::uint32_t>& region) const;

  /// The parts as disks. The region widens by islands amid it, of at most 200 faces, and by what is around vertices in which its
  /// outline meets itself; holes of the mesh amid it stay holes. None where a part is no disk then, or too large.
  std::optional<std::vector<MendDisk>> disks_of(std::vector<std::uint32_t>& region, std::size_t max_faces,
                                                std::size_t max_loop) const;

 private:
  using Loops = std::vector<std::vector<std::uint32_t>>;
  Loops loops_of(const std::vector<std::uint32_t>& part, std::vector<std::uint32_t>& pinched) const;
  bool part_to_loops(const std::vector<std::uint32_t>& part, Loops& loops,
                     std::vector<std::uint32_t>& more) const;
  std::vector<std::uint32_t> island_beyond(const std::vector<std::uint32_t>& loop,
                                           const std::vector<std::uint32_t>& part) const;
  bool is_border(const std::vector<std::uint32_t>& loop) const;
  bool bridge(Loops& loops, const std::vector<std::uint32_t>& part) const;
  bool is_planar(const std::vector<std::uint32_t>& part, const Loops& loops) const;

  const MeshBlock& block_;
  const ContactCell whole_;
  std::vector<std::uint32_t> start_, at_;  ///< faces at each vertex
};

/// Ascending, each once.
template <class T>
void sort_unique(std::vector<T>& list) {
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
}

}  // namespace tessera
