/// \file patch_builder.h
/// The patch of one brick in the making: its vertices by their names, and faces of them.
#pragma once
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "kernels/mesh/patch.h"
#include "octree/vector.h"

namespace tessera {

/// Coordinates of a node or cell relative to the brick that owns it: there sums round as they do for the owner.
[[nodiscard]] inline Float3 in_owner(const Int3& at) {
  return {static_cast<float>(at[0] & (kBrickCells - 1)), static_cast<float>(at[1] & (kBrickCells - 1)),
          static_cast<float>(at[2] & (kBrickCells - 1))};
}

/// Whether the brick owns a cell, given relative to it.
[[nodiscard]] inline bool inside_brick(const Int3& cell) {
  for (int c : cell)
    if (c < 0 || c >= kBrickCells) return false;
  return true;
}

/// The colour of a vertex amid others; those without a colour (alpha 0) do not count.
class ColourMean {
 public:
  void add(std::uint32_t rgba) {
    if ((rgba >> 24) == 0) return;
    ++count_;
    for (std::size_t channel = 0; channel < 4; ++channel) sum_[channel] += rgba >> 8 * channel & 0xff;
  }
  [[nodiscard]] std::uint32_t value() const {
    std::uint32_t mean = 0;
    for (std::size_t channel = 0; count_ && channel < 4; ++channel)
      mean |= (sum_[channel] + count_ / 2) / count_ << 8 * channel;
    return mean;
  }

 private:
  std::array<std::uint32_t, 4> sum_{};
  std::uint32_t count_ = 0;
};

inline constexpr std::uint32_t kForeignVertex = 0x80000000u;  ///< provisional index: slot of a foreign vertex

struct BrickVertex {
  VertexKey key = 0;
  Float3 position = {0, 0, 0};  ///< cells, relative to the brick that owns it
  std::uint32_t rgba = 0;
  VertexClass kind = VertexClass::kSmooth;
  bool finer = false;  ///< of a brick of the next finer level
};

class PatchBuilder {
 public:
  /// \param corner  global cell coordinates of the brick on the lattice of its level
  /// \param names   fill Patch::name and what follows it
  /// \param finer   there are bricks of the next finer level around it
  PatchBuilder(const Int3& corner, int level, bool names, bool finer);

  /// Name of a vertex at a node or cell relative to the brick (patch.h).
  [[nodiscard]] VertexKey key(const Int3& at, int type) const;
  /// The same at a node of the next finer lattice, global.
  [[nodiscard]] VertexKey finer_key(const Int3& node, int type) const;
  [[nodiscard]] bool names() const { return names_; }

  /// The first vertices, to be given by set_own() and set_foreign().
  void start(std::size_t own, std::size_t foreign);
  void set_own(std::uint32_t index, const BrickVertex& vertex) {
    patch_.position[index] = vertex.position;
    patch_.rgba[index] = vertex.rgba;
    patch_.vertex_class[index] = vertex.kind;
    if (names_) patch_.name[index] = vertex.key;
  }
  /// Of foreign vertices all but the key is read with names only.
  void set_foreign(std::uint32_t slot, const BrickVertex& vertex) { foreign_[slot] = vertex; }
  /// The indices that faces name, provisional for a foreign one.
  std::uint32_t add_own(const BrickVertex& vertex);
  std::uint32_t add_foreign(const BrickVertex& vertex);
  /// The same slot for the same key, whichever cell names it. \pre all with `finer` are added by this
  std::uint32_t add_finer(const BrickVertex& vertex);
  /// Centre of a loop, foreign where its cell is. \param position  relative to the cell
  std::uint32_t add_centre(const Int3& cell, int number, const Float3& position, std::uint32_t rgba,
                           VertexClass kind);
  /// An own vertex that other bricks may name.
  void add_exported(VertexKey key, std::uint32_t vertex) { patch_.exported.emplace_back(key, vertex); }
  void add_safe(std::uint32_t vertex, const Float3& at) { patch_.safe.push_back({vertex, at}); }

  /// \param border  bits of its edges at which the surface ends, read with names only
  void add_face(std::uint32_t a, std::uint32_t b, std::uint32_t c, unsigned border = 0) {
    patch_.faces.push_back({a, b, c});
    if (border == 0 || !names_) return;
    patch_.border.resize(patch_.faces.size(), 0);
    patch_.border.back() = static_cast<std::uint8_t>(border);
  }
  [[nodiscard]] std::size_t faces() const { return patch_.faces.size(); }
  /// Faces from this one on are made up.
  void mark_synthetic(std::size_t first) {
    if (first == patch_.faces.size()) return;
    patch_.synthetic.resize(first, 0);
    patch_.synthetic.resize(patch_.faces.size(), 1);
  }

  /// Ends the patch: vertices of other bricks that faces name in the order of their keys, and final indices.
  Patch finish();

 private:
  void resolve_foreign();

  Patch patch_;
  Int3 corner_;
  bool names_, finer_;
  std::size_t first_own_ = 0;  ///< how many start() asked for
  std::vector<BrickVertex> foreign_;
  std::unordered_map<VertexKey, std::uint32_t> finer_slot_;
};

}  // namespace tessera
