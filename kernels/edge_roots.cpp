#include "kernels/edge_roots.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr std::uint64_t kLowX = 0x0101010101010101ULL;  // nodes with x = 0

/// Nodes moved by one in -axis direction: bit b of word z tells of the node after it.
std::uint64_t shifted(const std::array<std::uint64_t, 8>& here, const std::array<std::uint64_t, 8>& after,
                      std::size_t axis, std::size_t z) {
  if (axis == 0) return ((here[z] >> 1) & ~(kLowX << 7)) | ((after[z] & kLowX) << 7);
  if (axis == 1) return (here[z] >> 8) | (after[z] << 56);
  return z < 7 ? here[z + 1] : after[0];
}

/// Root in [0, 1] of the cubic with values a, b and slopes ma, mb at the ends; a and b differ in sign.
/// Newton steps kept inside the bracket.
float hermite_root(float a, float b, float ma, float mb) {
  const float c3 = 2.0f * (a - b) + ma + mb, c2 = 3.0f * (b - a) - 2.0f * ma - mb;
  float low = 0.0f, high = 1.0f, t = a / (a - b);
  for (int step = 0; step < 4; ++step) {
    const float f = ((c3 * t + c2) * t + ma) * t + a;
    if ((f < 0.0f) == (a < 0.0f)) {
      low = t;
    } else {
      high = t;
    }
    const float slope = (3.0f * c3 * t + 2.0f * c2) * t + ma;
    float next = slope != 0.0f ? t - f / slope : low;
    if (!(next >= low && next <= high)) next = 0.5f * (low + high);
    t = next;
  }
  return t;
}

/// Root of a smooth stretch from the fits at the two nodes.
EdgeRoot smooth_root(const LeafFit& fit_a, std::size_t a, const LeafFit& fit_b, std::size_t b,
                     std::size_t axis) {
  EdgeRoot root;
  const float t =
      hermite_root(fit_a.value[a], fit_b.value[b], fit_a.gradient[axis][a], fit_b.gradient[axis][b]);
  Float3 n;
  for (std::size_t c = 0; c < 3; ++c) n[c] = (1.0f - t) * fit_a.gradient[c][a] + t * fit_b.gradient[c][b];
  const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  if (length > 0.0f) {
    for (std::size_t c = 0; c < 3; ++c) root.normal[c] = n[c] / length;
  } else {
    root.normal[axis] = fit_a.value[a] < 0.0f ? 1.0f : -1.0f;
  }
  root.t = std::clamp(t, kRootMargin, 1.0f - kRootMargin);
  root.offset = (t - root.t) * root.normal[axis];
  return root;
}

}  // namespace

void find_roots(const std::vector<LeafFit>& fits, DirectedField& field) {
  static constexpr std::array<std::uint64_t, 8> kNone{};
  for (std::size_t l = 0; l < field.leaves.size(); ++l) {
    BandLeaf& leaf = field.leaves[l];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Int3 after = leaf.origin;
      after[axis] += kLeafCells;
      std::int32_t next = -1;
      if (after[axis] <= field.cells[axis]) {
        const BandLeaf* found = field.leaf_at(after[0], after[1], after[2]);
        if (found) next = static_cast<std::int32_t>(found - field.leaves.data());
      }
      const BandLeaf* other = next < 0 ? nullptr : &field.leaves[static_cast<std::size_t>(next)];
      for (std::size_t z = 0; z < 8; ++z) {
        const std::uint64_t both = leaf.valid[z] & shifted(leaf.valid, other ? other->valid : kNone, axis, z);
        const std::uint64_t differ =
            leaf.inside[z] ^ shifted(leaf.inside, other ? other->inside : kNone, axis, z);
        leaf.crossing[axis][z] = both & differ;
        leaf.first_root[axis][z] = static_cast<std::uint32_t>(field.roots.size());
        for (std::uint64_t left = leaf.crossing[axis][z]; left; left &= left - 1) {
          const auto bit = static_cast<std::size_t>(std::countr_zero(left));
          const std::size_t a = bit + 64 * z;
          const std::size_t step = axis == 0 ? 1 : axis == 1 ? 8 : 64;
          const std::size_t coordinate = axis == 0 ? bit & 7 : axis == 1 ? bit >> 3 : z;
          const bool beyond = coordinate == 7;
          const LeafFit& fit_b = fits[beyond ? static_cast<std::size_t>(next) : l];
          const std::size_t b = beyond ? a - 7 * step : a + step;
          field.roots.push_back(smooth_root(fits[l], a, fit_b, b, axis));
        }
      }
    }
  }
}

}  // namespace tessera
