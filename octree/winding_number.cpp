#include "octree/winding_number.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "octree/leaf_queries.h"

namespace tessera {
namespace {

constexpr float kInverseFourPi = 0.07957747154594767f;

/// A far cell as the inner loop wants it: centre relative to the leaf's corner, constants folded in.
struct FarCell {
  float x, y, z;       ///< cells
  float inverse_edge;  ///< 1 / edge of the cell; exact
  std::array<float, 3> first;
  std::array<float, 5> second;  ///< times -3, twice off the diagonal
  std::array<float, 7> third;   ///< times 15 and the number of permutations
};
struct NearPoint {
  float x, y, z, mx, my, mz;
};

/// What the queries of one leaf see, in key order.
struct PointLists {
  std::vector<FarCell> far;
  std::vector<NearPoint> near;
};

class PointListBuilder {
 public:
  PointListBuilder(const MultipoleTree& far, const MultipoleTree* near, PointLists& out)
      : far_(far), near_(near), out_(out), finest_(finest_bits(far, near)) {}

  /// \param cell  coordinates of the leaf on the finest level
  void build(const Int3& cell) {
    cell_ = cell;
    out_.far.clear();
    out_.near.clear();
    const MultipoleTree::Level& top = far_.level(far_.top_bits());
    visit(far_, far_.top_bits(), 0, top.cells.size());
  }

 private:
  void visit(const MultipoleTree& tree, int bits, std::size_t begin, std::size_t end) {
    const MultipoleTree::Level& level = tree.level(bits);
    const int shift = bits - finest_;
    for (std::size_t c = begin; c < end; ++c) {
      const Multipole& m = level.cells[c];
      const auto at = morton_decode(m.key);
      bool adjacent = true;
      for (std::size_t a = 0; a < 3; ++a)
        adjacent &= std::abs(static_cast<std::int32_t>(at[a]) - (cell_[a] >> shift)) <= 1;
      if (!adjacent) {
        add(m, bits);
      } else if (bits > tree.leaf_bits()) {
        visit(tree, bits - 1, level.first_child[c], level.first_child[c + 1]);
      } else if (&tree == &far_ && near_) {
        const auto [first, last] = near_children(*near_, m.key);
        visit(*near_, near_->top_bits() - 1, first, last);
      } else {
        assert(level.first_child[c + 1] - level.first_child[c] == m.points &&
               "adjacent leaves have their dipoles");
        for (std::size_t i = level.first_child[c]; i < level.first_child[c + 1]; ++i) add(tree.dipoles()[i]);
      }
    }
  }

  void add(const Multipole& m, int bits) {
    const Float3 p = relative_to_leaf(m.centre, cell_, finest_);
    const auto& s = m.second;
    const auto& t = m.third;
    out_.far.push_back(
        {p[0],
         p[1],
         p[2],
         1.0f / static_cast<float>(std::int64_t{1} << bits),
         m.first,
         {-3.0f * s[0], -3.0f * s[1], -6.0f * s[2], -6.0f * s[3], -6.0f * s[4]},
         {15.0f * t[0], 15.0f * t[1], 45.0f * t[2], 45.0f * t[3], 15.0f * t[4], 15.0f * t[5], 90.0f * t[6]}});
  }
  void add(const Dipole& d) {
    const Float3 p = relative_to_leaf(d.q, cell_, finest_);
    out_.near.push_back({p[0], p[1], p[2], d.moment[0], d.moment[1], d.moment[2]});
  }

  const MultipoleTree& far_;
  const MultipoleTree* near_;
  PointLists& out_;
  int finest_;
  Int3 cell_ = {0, 0, 0};
};

/// Sums of eight queries.
struct PackSums {
  Pack value = _mm256_setzero_ps();
  Pack gx = _mm256_setzero_ps(), gy = _mm256_setzero_ps(), gz = _mm256_setzero_ps();
};

/// With R from query to centre in cell edges: (m.R - 3 R.B.R / r^2 + 15 C(R,R,R) / r^4) / r^3.
template <bool kGradient>
void add_far(const std::vector<FarCell>& cells, Pack qx, Pack qy, Pack qz, PackSums& sums) {
  const Pack one = all(1.0f), three = all(3.0f);
  for (const FarCell& c : cells) {
    const Pack scale = all(c.inverse_edge);
    const Pack x = (all(c.x) - qx) * scale, y = (all(c.y) - qy) * scale, z = (all(c.z) - qz) * scale;
    const Pack xx = x * x, yy = y * y, zz = z * z;
    const Pack s = one / (xx + yy + zz);
    const Pack s3 = s * _mm256_sqrt_ps(s);
    const Pack xz2 = xx - zz, yz2 = yy - zz, xy = x * y;
    const Pack p = all(c.first[0]) * x + all(c.first[1]) * y + all(c.first[2]) * z;
    const Pack q = all(c.second[0]) * xz2 + all(c.second[1]) * yz2 + all(c.second[2]) * xy +
                   z * (all(c.second[3]) * x + all(c.second[4]) * y);
    // x (x^2 - 3 z^2), y (y^2 - 3 z^2), y (x^2 - z^2), x (y^2 - z^2), z (3 x^2 - z^2) / 1, z (3 y^2 - z^2),
    // xyz
    const Pack t = x * (all(c.third[0]) * (xx - three * zz) + all(c.third[3]) * yz2) +
                   y * (all(c.third[1]) * (yy - three * zz) + all(c.third[2]) * xz2) +
                   z * (all(c.third[4]) * (three * xx - zz) + all(c.third[5]) * (three * yy - zz) +
                        all(c.third[6]) * xy);
    sums.value += s3 * (p + s * (q + s * t));
    if constexpr (kGradient) {
      const Pack two = all(2.0f), six = all(6.0f);
      const Pack radial = s * (three * p + s * (all(5.0f) * q + s * (all(7.0f) * t)));
      const Pack q_x = two * all(c.second[0]) * x + all(c.second[2]) * y + all(c.second[3]) * z;
      const Pack q_y = two * all(c.second[1]) * y + all(c.second[2]) * x + all(c.second[4]) * z;
      const Pack q_z =
          all(c.second[3]) * x + all(c.second[4]) * y - two * z * (all(c.second[0]) + all(c.second[1]));
      const Pack t_x = all(c.third[0]) * three * xz2 + all(c.third[3]) * yz2 + two * all(c.third[2]) * xy +
                       z * (six * all(c.third[4]) * x + all(c.third[6]) * y);
      const Pack t_y = all(c.third[1]) * three * yz2 + all(c.third[2]) * xz2 + two * all(c.third[3]) * xy +
                       z * (six * all(c.third[5]) * y + all(c.third[6]) * x);
      const Pack t_z = -z * (six * (all(c.third[0]) * x + all(c.third[1]) * y) +
                             two * (all(c.third[2]) * y + all(c.third[3]) * x)) +
                       all(c.third[4]) * three * xz2 + all(c.third[5]) * three * yz2 + all(c.third[6]) * xy;
      // The query moves against R, and R is in edges.
      const Pack by = -s3 * scale;
      sums.gx += by * (all(c.first[0]) + s * (q_x + s * t_x) - radial * x);
      sums.gy += by * (all(c.first[1]) + s * (q_y + s * t_y) - radial * y);
      sums.gz += by * (all(c.first[2]) + s * (q_z + s * t_z) - radial * z);
    }
  }
}

template <bool kGradient>
void add_near(const std::vector<NearPoint>& points, Pack qx, Pack qy, Pack qz, PackSums& sums) {
  const Pack core2 = all(kDipoleCore * kDipoleCore), one = all(1.0f);
  for (const NearPoint& n : points) {
    const Pack x = all(n.x) - qx, y = all(n.y) - qy, z = all(n.z) - qz;
    const Pack mx = all(n.mx), my = all(n.my), mz = all(n.mz);
    const Pack r2 = x * x + y * y + z * z;
    const Pack s = one / _mm256_max_ps(r2, core2);
    const Pack s3 = s * _mm256_sqrt_ps(s);
    const Pack p = mx * x + my * y + mz * z;
    sums.value += s3 * p;
    if constexpr (kGradient) {
      const Pack radial = _mm256_and_ps(all(3.0f) * s * p, _mm256_cmp_ps(r2, core2, _CMP_GT_OQ));
      sums.gx -= s3 * (mx - radial * x);
      sums.gy -= s3 * (my - radial * y);
      sums.gz -= s3 * (mz - radial * z);
    }
  }
}

}  // namespace

void WindingField::evaluate(std::span<const Int3> queries, std::span<float> value,
                            std::span<Float3> gradient) const {
  assert(value.size() == queries.size() && (gradient.empty() || gradient.size() == queries.size()));
  PointLists lists;
  PointListBuilder builder(far_, near_, lists);
  const auto begin_leaf = [&](const Int3& leaf) { builder.build(leaf); };
  const auto eight = [&](std::size_t at, std::size_t count, Pack qx, Pack qy, Pack qz) {
    PackSums far, near;
    if (gradient.empty()) {
      add_far<false>(lists.far, qx, qy, qz, far);
      add_near<false>(lists.near, qx, qy, qz, near);
    } else {
      add_far<true>(lists.far, qx, qy, qz, far);
      add_near<true>(lists.near, qx, qy, qz, near);
    }
    alignas(32) std::array<std::array<float, kLanes>, 4> sum;
    const Pack unit = all(kInverseFourPi);
    _mm256_store_ps(sum[0].data(), unit * (far.value + near.value));
    _mm256_store_ps(sum[1].data(), unit * (far.gx + near.gx));
    _mm256_store_ps(sum[2].data(), unit * (far.gy + near.gy));
    _mm256_store_ps(sum[3].data(), unit * (far.gz + near.gz));
    for (std::size_t i = 0; i < count; ++i) {
      value[at + i] = sum[0][i];
      if (!gradient.empty()) gradient[at + i] = {sum[1][i], sum[2][i], sum[3][i]};
    }
  };
  for_each_eight(queries, finest_bits(far_, near_), begin_leaf, eight);
}

}  // namespace tessera
