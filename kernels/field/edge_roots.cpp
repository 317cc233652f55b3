#include "kernels/field/edge_roots.h"

#include <algorithm>
#include <cmath>

#include "octree/vector.h"

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

EdgeRoot clamped_root(float t, const Float3& normal, std::size_t axis) {
  EdgeRoot root;
  root.normal = normal;
  root.t = std::clamp(t, kRootMargin, 1.0f - kRootMargin);
  root.offset = (t - root.t) * normal[axis];
  return root;
}

/// Root of a smooth stretch from the fits at the two nodes.
EdgeRoot smooth_root(const LeafFit& fit_a, std::size_t a, const LeafFit& fit_b, std::size_t b,
                     std::size_t axis) {
  const float t =
      hermite_root(fit_a.value[a], fit_b.value[b], fit_a.gradient[axis][a], fit_b.gradient[axis][b]);
  Float3 n;
  for (std::size_t c = 0; c < 3; ++c) n[c] = (1.0f - t) * fit_a.gradient[c][a] + t * fit_b.gradient[c][b];
  const float length = norm(n);
  Float3 normal = {0, 0, 0};
  if (length > 0.0f) {
    for (std::size_t c = 0; c < 3; ++c) normal[c] = n[c] / length;
  } else {
    normal[axis] = fit_a.value[a] < 0.0f ? 1.0f : -1.0f;
  }
  return clamped_root(t, normal, axis);
}

/// What one node says about its edge: its sheets, or the plane of its smooth fit.
struct EdgeEnd {
  const Sheets* sheets = nullptr;
  float value = 0.0f;
  Float3 gradient = {0, 0, 0};

  EdgeEnd(const LeafFit& fit, const std::vector<Sheets>& all, std::size_t node) {
    const std::size_t z = node >> 6;
    const std::uint64_t bit = std::uint64_t{1} << (node & 63);
    value = fit.value[node];
    for (std::size_t c = 0; c < 3; ++c) gradient[c] = fit.gradient[c][node];
    if (fit.creased[z] & bit)
      sheets =
          &all[fit.first_sheets[z] + static_cast<std::uint32_t>(std::popcount(fit.creased[z] & (bit - 1)))];
  }
  int count() const { return sheets ? sheets->count : 1; }
  /// At signed distance `along` from the node on the axis.
  SurfaceValue at(float along, std::size_t axis) const {
    if (!sheets) return {value + along * gradient[axis], gradient};
    Float3 p = {0, 0, 0};
    p[axis] = along;
    return sheets->at(p);
  }
};

constexpr int kRootSteps = 16;

/// Root beside a crease: of the two ends' surfaces, blended along the edge so that each end keeps its sign.
EdgeRoot crease_root(const EdgeEnd& a, const EdgeEnd& b, std::size_t axis) {
  // An end that knows more sheets speaks alone, if it gives the other end its sign: the other one may lie too
  // far off a face to know of it.
  const bool a_alone = a.count() > b.count() && (a.at(1.0f, axis).value < 0.0f) == (b.value < 0.0f);
  const bool b_alone = b.count() > a.count() && (b.at(-1.0f, axis).value < 0.0f) == (a.value < 0.0f);
  const auto blend = [&](float t) {
    if (a_alone) return a.at(t, axis).value;
    if (b_alone) return b.at(t - 1.0f, axis).value;
    return (1.0f - t) * a.at(t, axis).value + t * b.at(t - 1.0f, axis).value;
  };
  // Illinois: secant steps that never lose the bracket; exact once both ends lie on the active sheet. Before that a kink
  // may hold them at one end: halving gets over it.
  float low = 0.0f, high = 1.0f, f_low = blend(0.0f), f_high = blend(1.0f), t = 0.5f, width = 1.0f;
  for (int step = 0; step < kRootSteps; ++step) {
    const bool slow = step % 2 == 0 && step > 0 && high - low > 0.5f * width;
    if (step % 2 == 0) width = high - low;
    t = slow ? 0.5f * (low + high) : low + (high - low) * (f_low / (f_low - f_high));
    const float f = blend(t);
    if (std::abs(f) < 1e-6f) break;
    if ((f < 0.0f) == (f_low < 0.0f)) {
      if (step > 0) f_high *= 0.5f;
      low = t;
      f_low = f;
    } else {
      if (step > 0) f_low *= 0.5f;
      high = t;
      f_high = f;
    }
  }
  const SurfaceValue from_a = a.at(t, axis), from_b = b.at(t - 1.0f, axis);
  const Float3& na = from_a.normal;
  const Float3& nb = from_b.normal;
  // Where both ends see the same sheet, blend; else the end whose surface is nearer to the root speaks.
  const bool use_a = a_alone || (!b_alone && std::abs(from_a.value) <= std::abs(from_b.value));
  Float3 n = use_a ? na : nb;
  if (!a_alone && !b_alone && dot(na, nb) > 0.95f)
    for (std::size_t c = 0; c < 3; ++c) n[c] = (1.0f - t) * na[c] + t * nb[c];
  const float length = norm(n);
  if (length > 0.0f)
    for (float& c : n) c /= length;
  return clamped_root(t, n, axis);
}

/// Roots are kept off nodes, and with them the vertices off the surface, which tilts thin faces. Where all roots around a
/// node lie on one plane, their vertices slide onto it: they stay apart there. Beside a crease they would meet, and so
/// would those of both faces of a wall in a plane of nodes: there the edge passes one of them against the node's normal.
/// Distance from the node within which a second sheet counts, cells; least cosine between the root's and its normal.
constexpr float kSecondSheet = 0.25f;
constexpr float kSlideCosine = 0.95f;

/// \param leaves  whether the edge leaves the inside in +axis direction
bool may_slide(const EdgeEnd& near, const EdgeRoot& root, std::size_t axis, bool leaves) {
  if ((root.normal[axis] > 0.0f) != leaves) return false;
  if (near.sheets && near.sheets->passing({0, 0, 0}, kSecondSheet) > 1) return false;
  return dot(root.normal, near.gradient) > kSlideCosine;
}

}  // namespace

void find_roots(const std::vector<LeafFit>& fits, const std::vector<Sheets>& sheets, bool noisy,
                DirectedField& field) {
  static constexpr std::array<std::uint64_t, 8> kNone{};
  for (std::size_t l = 0; l < field.leaves.size(); ++l) {
    BandLeaf& leaf = field.leaves[l];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const BandLeaf* other = field.leaf_after(leaf, axis);
      const std::int32_t next = other ? static_cast<std::int32_t>(other - field.leaves.data()) : -1;
      const LeafFit* fit_after = other ? &fits[static_cast<std::size_t>(next)] : nullptr;
      for (std::size_t z = 0; z < 8; ++z) {
        const std::uint64_t both =
            fits[l].valid[z] & shifted(fits[l].valid, fit_after ? fit_after->valid : kNone, axis, z);
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
          const EdgeEnd end_a(fits[l], sheets, a), end_b(fit_b, sheets, b);
          const bool creased = end_a.sheets || end_b.sheets;
          if (noisy) field.creased.push_back(creased ? 1 : 0);
          EdgeRoot root = creased ? crease_root(end_a, end_b, axis) : smooth_root(fits[l], a, fit_b, b, axis);
          const bool leaves = (leaf.inside[z] >> bit & 1) != 0;
          root.slides = root.offset != 0.0f && may_slide(root.t < 0.5f ? end_a : end_b, root, axis, leaves);
          field.roots.push_back(root);
        }
      }
    }
  }
}

}  // namespace tessera
