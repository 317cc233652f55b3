#include "kernels/mesh/block_contacts.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "kernels/mesh/face_planes.h"
#include "kernels/mesh/orientation_sign.h"
#include "octree/morton.h"

namespace tessera {
namespace {

constexpr std::size_t kLanes = 8;  ///< boxes of a bundle: compared with one in a few instructions

/// Boxes side by side, in floats rounded outwards; those that are missing meet nothing.
struct BoxBundle {
  alignas(32) std::array<std::array<float, kLanes>, 3> low, high;
  BoxBundle() {
    for (auto& axis : low) axis.fill(std::numeric_limits<float>::infinity());
    for (auto& axis : high) axis.fill(-std::numeric_limits<float>::infinity());
  }
};

struct FloatBox {
  Float3 low, high;
};

FloatBox around(const BoxBundle& boxes) {
  FloatBox b;
  for (std::size_t k = 0; k < 3; ++k) {
    b.low[k] = *std::min_element(boxes.low[k].begin(), boxes.low[k].end());
    b.high[k] = *std::max_element(boxes.high[k].begin(), boxes.high[k].end());
  }
  return b;
}

void put(BoxBundle& boxes, std::size_t lane, const FloatBox& b) {
  for (std::size_t k = 0; k < 3; ++k) boxes.low[k][lane] = b.low[k], boxes.high[k][lane] = b.high[k];
}

FloatBox lane(const BoxBundle& boxes, std::size_t l) {
  FloatBox b;
  for (std::size_t k = 0; k < 3; ++k) b.low[k] = boxes.low[k][l], b.high[k] = boxes.high[k][l];
  return b;
}

/// A bit for each box that meets this one.
unsigned meeting(const BoxBundle& boxes, const FloatBox& b) {
  __m256 apart = _mm256_setzero_ps();
#pragma GCC unroll 3
  for (std::size_t k = 0; k < 3; ++k) {
    const __m256 low = _mm256_load_ps(boxes.low[k].data()), high = _mm256_load_ps(boxes.high[k].data());
    apart = _mm256_or_ps(apart, _mm256_cmp_ps(low, _mm256_set1_ps(b.high[k]), _CMP_GT_OQ));
    apart = _mm256_or_ps(apart, _mm256_cmp_ps(high, _mm256_set1_ps(b.low[k]), _CMP_LT_OQ));
  }
  return ~static_cast<unsigned>(_mm256_movemask_ps(apart)) & 0xffu;
}

float rounded_down(double x) {
  const float f = static_cast<float>(x);
  return static_cast<double>(f) > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}

class ContactTree {
 public:
  ContactTree(std::span<const ContactFace> faces, const ContactCell& cell) : faces_(faces), cell_(cell) {
    sort();
    std::vector<BoxBundle> leaves((faces.size() + kLanes - 1) / kLanes);
    for (std::size_t i = 0; i < order_.size(); ++i)
      put(leaves[i / kLanes], i % kLanes, box(faces[order_[i]]));
    levels_.push_back(std::move(leaves));
    while (levels_.back().size() > 1) {
      const std::vector<BoxBundle>& below = levels_.back();
      std::vector<BoxBundle> next((below.size() + kLanes - 1) / kLanes);
      for (std::size_t b = 0; b < below.size(); ++b) put(next[b / kLanes], b % kLanes, around(below[b]));
      levels_.push_back(std::move(next));
    }
  }

  /// \param use  (i, j, contact) -> whether to go on
  template <class Use>
  void each_pair(const Use& use) const {
    std::vector<std::pair<std::size_t, std::size_t>> open;  // level, bundle
    FacePlanes planes;                                      // of the leaf's faces
    for (std::size_t leaf = 0; leaf < levels_[0].size(); ++leaf) {
      const FloatBox whole = around(levels_[0][leaf]);
      planes.clear();
      for (std::size_t i = leaf * kLanes; i < std::min(order_.size(), (leaf + 1) * kLanes); ++i)
        planes.add(faces_[order_[i]]);
      open.assign(1, {levels_.size() - 1, 0});
      while (!open.empty()) {
        const auto [level, bundle] = open.back();
        open.pop_back();
        if (level == 0) {
          if (!meet(leaf, planes, bundle, use)) return;
          continue;
        }
        // Leaves before this one have met it.
        const std::size_t first = first_below(leaf, level - 1);
        for (unsigned bits = meeting(levels_[level][bundle], whole); bits != 0; bits &= bits - 1) {
          const std::size_t below = bundle * kLanes + static_cast<std::size_t>(__builtin_ctz(bits));
          if (below >= first) open.emplace_back(level - 1, below);
        }
      }
    }
  }

 private:
  /// Along a curve through the middles, so that bundles are compact.
  void sort() {
    Double3 low, high;
    low.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
    for (const ContactFace& f : faces_)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min({low[k], f.corner[0][k], f.corner[1][k], f.corner[2][k]});
        high[k] = std::max({high[k], f.corner[0][k], f.corner[1][k], f.corner[2][k]});
      }
    origin_ = low;
    double widest = 0.0;
    for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, high[k] - low[k]);
    const double scale = widest > 0.0 ? 2097151.0 / widest : 0.0;
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(faces_.size());
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      std::array<std::uint32_t, 3> at{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& c = faces_[f].corner;
        const double x = ((c[0][k] - low[k]) + (c[1][k] - low[k]) + (c[2][k] - low[k])) / 3.0 * scale;
        at[k] = static_cast<std::uint32_t>(std::clamp(x, 0.0, 2097151.0));
      }
      keys[f] = {morton_encode(at[0], at[1], at[2]), f};
    }
    std::sort(keys.begin(), keys.end());
    order_.reserve(keys.size());
    for (const auto& key : keys) order_.push_back(key.second);
  }

  /// Relative to a corner of the block, so that floats tell neighbours apart in survey coordinates too; differences round
  /// monotonically, so boxes that meet still do.
  FloatBox box(const ContactFace& f) const {
    FloatBox b;
    for (std::size_t k = 0; k < 3; ++k) {
      b.low[k] = rounded_down(std::min({f.corner[0][k], f.corner[1][k], f.corner[2][k]}) - origin_[k]);
      b.high[k] = -rounded_down(-(std::max({f.corner[0][k], f.corner[1][k], f.corner[2][k]}) - origin_[k]));
    }
    return b;
  }

  /// The first bundle of a level that holds leaf `leaf` or a later one.
  static std::size_t first_below(std::size_t leaf, std::size_t level) {
    for (; level > 0; --level) leaf /= kLanes;
    return leaf;
  }

  template <class Use>
  bool meet(std::size_t leaf, const FacePlanes& planes, std::size_t other, const Use& use) const {
    const BoxBundle &mine = levels_[0][leaf], &theirs = levels_[0][other];
    const std::size_t end = std::min(kLanes, order_.size() - other * kLanes);
    for (std::size_t l = 0; l < end; ++l) {
      unsigned bits = meeting(mine, lane(theirs, l));
      if (leaf == other) bits &= (1u << l) - 1u;
      if (bits == 0) continue;
      const std::uint32_t face = order_[other * kLanes + l];
      for (bits &= ~planes.apart(faces_[face]); bits != 0; bits &= bits - 1)
        if (!decide(order_[leaf * kLanes + static_cast<std::size_t>(__builtin_ctz(bits))], face, use))
          return false;
    }
    return true;
  }

  /// Few pairs meet, so whose they are is asked last.
  template <class Use>
  bool decide(std::uint32_t i, std::uint32_t j, const Use& use) const {
    const ContactFace &a = faces_[i], &b = faces_[j];
    const FaceContact contact = face_contact(a, b);
    if (contact == FaceContact::kNone) return true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double low = std::max(std::min({a.corner[0][k], a.corner[1][k], a.corner[2][k]}),
                                  std::min({b.corner[0][k], b.corner[1][k], b.corner[2][k]}));
      if (low < cell_.low[k] || !(low < cell_.high[k])) return true;
    }
    return use(std::min(i, j), std::max(i, j), contact);
  }

  std::span<const ContactFace> faces_;
  const ContactCell& cell_;
  Double3 origin_{};
  std::vector<std::uint32_t> order_;
  std::vector<std::vector<BoxBundle>> levels_;  ///< of the faces in that order first
};

}  // namespace

void block_contacts(std::span<const ContactFace> faces, const ContactCell& cell,
                    const std::function<void(std::uint32_t, std::uint32_t, FaceContact)>& use) {
  if (faces.size() < 2) return;
  const ContactTree tree(faces, cell);
  tree.each_pair([&](std::uint32_t i, std::uint32_t j, FaceContact contact) {
    use(i, j, contact);
    return true;
  });
}

std::vector<ContactFace> contact_faces(const MeshBlock& block, std::vector<std::uint32_t>* number) {
  std::vector<ContactFace> faces;
  faces.reserve(block.faces.size());
  if (number != nullptr) number->reserve(block.faces.size());
  for (std::uint32_t i = 0; i < block.faces.size(); ++i) {
    const auto& f = block.faces[i];
    const ContactFace face = {{block.position[f[0]], block.position[f[1]], block.position[f[2]]},
                              {f[0], f[1], f[2]}};
    if (collinear(face.corner[0], face.corner[1], face.corner[2])) continue;
    faces.push_back(face);
    if (number != nullptr) number->push_back(i);
  }
  return faces;
}

std::size_t count_contacts(const MeshBlock& block, std::size_t enough) {
  const std::vector<ContactFace> faces = contact_faces(block);
  if (faces.size() < 2) return 0;
  std::size_t pairs = 0;
  ContactTree(faces, kAllSpace).each_pair([&](std::uint32_t i, std::uint32_t j, FaceContact) {
    pairs += !meet_in_copies(faces[i], faces[j]);
    return pairs < enough;
  });
  return pairs;
}

}  // namespace tessera
