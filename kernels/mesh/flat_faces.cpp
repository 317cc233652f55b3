#include "kernels/mesh/flat_faces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <vector>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr unsigned kBorders = kFaceBorder01 | kFaceBorder12 | kFaceBorder20;

FaceExtent extent_of(const MeshBlock& block, const std::array<std::uint32_t, 3>& f) {
  return face_extent(block.position[f[0]], block.position[f[1]], block.position[f[2]]);
}

/// Bits of the edge from corner i to the next.
unsigned border_bit(std::size_t i) {
  return unsigned{kFaceBorder01} << i;
}
unsigned crease_bit(std::size_t i) {
  return unsigned{kFaceCrease01} << i;
}

bool is_island(const MeshBlock& block, std::size_t f) {
  return (block.face_flags[f] & kBorders) == kBorders && extent_of(block, block.faces[f]).is_flat();
}

/// The faces with gone == 0, and the order that they belong in.
void keep_rest(MeshBlock& block, const std::vector<std::uint8_t>& gone) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < gone.size(); ++f) {
    if (gone[f]) continue;
    block.faces[kept] = block.faces[f];
    block.face_flags[kept] = block.face_flags[f];
    if (!block.face_bound.empty()) block.face_bound[kept] = block.face_bound[f];
    ++kept;
  }
  block.faces.resize(kept);
  block.face_flags.resize(kept);
  if (!block.face_bound.empty()) block.face_bound.resize(kept);
  canonicalise(block);
}

class FlatFaceMender {
 public:
  explicit FlatFaceMender(MeshBlock& block)
      : block_(block),
        complete_(complete_stars(block)),
        at_border_(block.key.size()),
        gone_(block.faces.size()) {
    edges_.reserve(block.faces.size() * 3 / 2);
    for (std::uint32_t f = 0; f < block.faces.size(); ++f)
      for (std::size_t i = 0; i < 3; ++i) {
        add(edge(f, i), f);
        if (block.face_flags[f] & border_bit(i)) mark_border(block.faces[f][i], block.faces[f][(i + 1) % 3]);
      }
  }

  /// Turning one may free the next of a stack of them, so rounds go on as long as there is progress.
  std::uint64_t run(std::vector<std::uint32_t> flat) {
    std::uint64_t mended = 0;
    for (std::uint64_t before = ~mended; before != mended && !flat.empty();) {
      before = mended;
      std::erase_if(flat, [&](std::uint32_t f) {
        if (gone_[f] || !extent_of(block_, block_.faces[f]).is_flat()) return true;
        const bool done = mend(f);
        mended += done;
        return done && (gone_[f] || !extent_of(block_, block_.faces[f]).is_flat());
      });
    }
    if (mended > 0) keep_rest(block_, gone_);
    return mended;
  }

 private:
  using Edge = std::uint64_t;
  struct Sides {
    std::uint32_t face[2] = {kNone, kNone};
  };

  static Edge between(std::uint32_t a, std::uint32_t b) {
    return static_cast<Edge>(std::min(a, b)) << 32 | std::max(a, b);
  }
  Edge edge(std::uint32_t f, std::size_t i) const {
    return between(block_.faces[f][i], block_.faces[f][(i + 1) % 3]);
  }
  void add(Edge e, std::uint32_t f) {
    Sides& sides = edges_[e];
    sides.face[sides.face[0] == kNone ? 0 : 1] = f;
  }
  void replace(Edge e, std::uint32_t was, std::uint32_t is) {
    Sides& sides = edges_.at(e);
    (sides.face[0] == was ? sides.face[0] : sides.face[1]) = is;
  }
  std::uint32_t across(Edge e, std::uint32_t f) const {
    const Sides& sides = edges_.at(e);
    return sides.face[0] == f ? sides.face[1] : sides.face[0];
  }
  void mark_border(std::uint32_t a, std::uint32_t b) { at_border_[a] = at_border_[b] = 1; }
  float bound(std::uint32_t f) const { return block_.face_bound.empty() ? 0.0f : block_.face_bound[f]; }
  void raise_bound(std::uint32_t f, float by) {
    if (!block_.face_bound.empty()) block_.face_bound[f] = std::fmax(block_.face_bound[f], by);
  }
  /// The corner of a face that begins this edge.
  std::size_t corner_of(std::uint32_t f, Edge e) const {
    return edge(f, 0) == e ? std::size_t{0} : edge(f, 1) == e ? std::size_t{1} : std::size_t{2};
  }

  /// The corner at which the longest edge begins.
  std::size_t longest(std::uint32_t f) const {
    std::size_t best = 0;
    double maximum = -1.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const Double3 d = block_.position[block_.faces[f][(i + 1) % 3]] - block_.position[block_.faces[f][i]];
      if (dot(d, d) > maximum) maximum = dot(d, d), best = i;
    }
    return best;
  }

  bool mend(std::uint32_t f) {
    const std::size_t i = longest(f);
    const unsigned flags = block_.face_flags[f];
    if ((flags & kBorders) == kBorders) {
      gone_[f] = 1;
      return true;
    }
    if (flags & crease_bit(i)) return false;
    if (flags & border_bit(i)) return drop_at_border(f, i);
    const std::uint32_t g = across(edge(f, i), f);
    return g != kNone && flip(f, i, g);
  }

  ///     b                         f = (a, c, b) with a at corner i, g = (c, a, d) with c at corner j
  ///   a---c   ->   (b, a, d) and (b, d, c)
  ///     d
  bool flip(std::uint32_t f, std::size_t i, std::uint32_t g) {
    const std::array<std::uint32_t, 3> old_f = block_.faces[f], old_g = block_.faces[g];
    const unsigned flags_f = block_.face_flags[f], flags_g = block_.face_flags[g];
    const std::size_t j = corner_of(g, edge(f, i));
    const std::uint32_t a = old_f[i], c = old_f[(i + 1) % 3], b = old_f[(i + 2) % 3], d = old_g[(j + 2) % 3];
    if (b == d || edges_.contains(between(b, d)) || !(complete_[b] || complete_[d])) return false;
    const std::array<std::uint32_t, 3> new_f = {b, a, d}, new_g = {b, d, c};
    const auto flats = [&](const auto& x, const auto& y) {
      return int{extent_of(block_, x).is_flat()} + int{extent_of(block_, y).is_flat()};
    };
    if (flats(new_f, new_g) >= flats(old_f, old_g)) return false;
    // What lines the two faces had on an edge, as bits of another place.
    const auto carry = [](unsigned flags, std::size_t from, std::size_t to) {
      return (flags & border_bit(from) ? border_bit(to) : 0u) |
             (flags & crease_bit(from) ? crease_bit(to) : 0u);
    };
    const unsigned kind = flags_g & kFaceSynthetic;  // the flat one covers nothing
    replace(between(c, b), f, g);
    replace(between(a, d), g, f);
    edges_.erase(between(a, c));
    edges_[between(b, d)] = {{f, g}};
    block_.faces[f] = new_f;
    block_.faces[g] = new_g;
    block_.face_flags[f] =
        static_cast<std::uint8_t>(kind | carry(flags_f, (i + 2) % 3, 0) | carry(flags_g, (j + 1) % 3, 1));
    block_.face_flags[g] =
        static_cast<std::uint8_t>(kind | carry(flags_g, (j + 2) % 3, 1) | carry(flags_f, (i + 1) % 3, 2));
    const float larger = std::fmax(bound(f), bound(g));
    raise_bound(f, larger), raise_bound(g, larger);
    return true;
  }

  bool drop_at_border(std::uint32_t f, std::size_t i) {
    const std::uint32_t b = block_.faces[f][(i + 2) % 3];
    const Edge to_b = edge(f, (i + 1) % 3), from_b = edge(f, (i + 2) % 3);
    const std::uint32_t p = across(to_b, f), q = across(from_b, f);
    // At a vertex of the border already, two fans would be left.
    if (p == kNone || q == kNone || !complete_[b] || at_border_[b]) return false;
    gone_[f] = 1;
    edges_.erase(edge(f, i));
    for (const auto& [e, other] : {std::pair{to_b, p}, std::pair{from_b, q}}) {
      replace(e, f, kNone);
      const unsigned bit = border_bit(corner_of(other, e));
      block_.face_flags[other] =
          static_cast<std::uint8_t>((block_.face_flags[other] | bit) & ~unsigned{kFaceDone});
      raise_bound(other, bound(f));
    }
    for (const std::uint32_t v : block_.faces[f]) at_border_[v] = 1;
    return true;
  }

  MeshBlock& block_;
  std::vector<std::uint8_t> complete_, at_border_, gone_;
  std::unordered_map<Edge, Sides> edges_;
};

}  // namespace

FaceExtent face_extent(const Double3& a, const Double3& b, const Double3& c) {
  const Double3 ab = b - a, ac = c - a, bc = c - b;
  const Double3 normal = cross(ab, ac);
  return {std::sqrt(dot(normal, normal)), std::max({dot(ab, ab), dot(ac, ac), dot(bc, bc)})};
}

std::uint64_t mend_flat_faces(MeshBlock& block) {
  std::vector<std::uint32_t> flat;
  for (std::uint32_t f = 0; f < block.faces.size(); ++f)
    if (extent_of(block, block.faces[f]).is_flat()) flat.push_back(f);
  return flat.empty() ? 0 : FlatFaceMender(block).run(std::move(flat));
}

std::uint64_t drop_flat_islands(MeshBlock& block) {
  std::vector<std::uint8_t> gone;  // as a rule there is none
  std::uint64_t dropped = 0;
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    if (!is_island(block, f)) continue;
    gone.resize(block.faces.size());
    gone[f] = 1;
    ++dropped;
  }
  if (dropped > 0) keep_rest(block, gone);
  return dropped;
}

}  // namespace tessera
