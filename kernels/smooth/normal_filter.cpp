#include "kernels/smooth/normal_filter.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Share of the area around a face whose normals must be like its own.
constexpr float kMinSupport = 0.2F;

/// The faces at a vertex that are neighbours by it.
std::span<const std::uint32_t> joined_at(const FaceCorners& corners, std::uint32_t v) {
  const std::span<const std::uint32_t> star = corners.at(v);
  return star.size() <= kMaxStar ? star : std::span<const std::uint32_t>();
}

/// Calls sink(g) for every face that shares a vertex with f, once for each vertex shared, f itself left out.
template <typename Sink>
void for_each_neighbour(const MeshBlock& block, const FaceCorners& corners, std::uint32_t f, Sink&& sink) {
  for (const std::uint32_t v : block.faces[f])
    for (const std::uint32_t corner : joined_at(corners, v))
      if (corner >> 2 != f) sink(corner >> 2);
}

/// The faces within `rings` of those wanted, ascending.
std::vector<std::uint32_t> faces_around(const MeshBlock& block, std::span<const std::uint8_t> wanted,
                                        int rings) {
  std::vector<std::uint8_t> in(wanted.begin(), wanted.end()), at(block.position.size(), 0);
  for (int ring = 0; ring < rings; ++ring) {
    for (std::size_t f = 0; f < in.size(); ++f)
      if (in[f] != 0)
        for (const std::uint32_t v : block.faces[f]) at[v] = 1;
    for (std::size_t f = 0; f < in.size(); ++f)
      for (const std::uint32_t v : block.faces[f]) in[f] |= at[v];
  }
  std::vector<std::uint32_t> out;
  for (std::size_t f = 0; f < in.size(); ++f)
    if (in[f] != 0) out.push_back(static_cast<std::uint32_t>(f));
  return out;
}

/// 1 / (2 sigma^2) for the squared difference of unit normals.
float inverse_range(double angle_deg) {
  const double range = 2.0 * sin_cos(angle_deg * (kPi / 360.0)).sin;
  return static_cast<float>(0.5 / (range * range));
}

float alike(const Float3& p, const Float3& q, float inverse) {
  const float a = p[0] - q[0], b = p[1] - q[1], c = p[2] - q[2];
  return bell((a * a + b * b + c * c) * inverse);
}

/// Fixed scratch of the rounds on normals.
class NormalRounds {
 public:
  /// \param some  whose normals change, ascending; nullptr: all
  NormalRounds(const MeshBlock& block, const FaceCorners& corners, const std::vector<std::uint32_t>* some)
      : block_(block),
        corners_(corners),
        some_(some),
        area_(block.faces.size(), 0.0F),
        normals_(block.faces.size() + 1, Float3{0, 0, 0}),
        next_(block.faces.size() + 1, Float3{0, 0, 0}),
        stamp_(block.faces.size(), 0) {
    std::vector<Double3> centre(block.faces.size());
    for (std::size_t f = 0; f < block.faces.size(); ++f) {
      const auto& face = block.faces[f];
      const Double3 &p = block.position[face[0]], &q = block.position[face[1]], &r = block.position[face[2]];
      centre[f] = (p + q + r) * (1.0 / 3.0);
      const Double3 area = triangle_normal(p, q, r);
      const double doubled = norm(area);
      if (!(doubled > 0.0)) continue;
      area_[f] = static_cast<float>(0.5 * doubled);
      normals_[f] = narrow(area * (1.0 / doubled));
    }
    next_ = normals_;
    weigh(centre);
  }

  void average(float inverse) {
    const float* weight = weight_.data();
    for_faces([&](std::uint32_t f) {
      const __m128 n = components(f);
      __m128 sum = _mm_mul_ps(_mm_set1_ps(area_[f]), n);
      for_each_neighbour(block_, corners_, f, [&](std::uint32_t g) {
        const __m128 k = components(g), apart = _mm_sub_ps(k, n);
        const __m128 square = _mm_mul_ps(apart, apart);
        const float x = _mm_cvtss_f32(square), y = _mm_cvtss_f32(_mm_movehdup_ps(square)),
                    z = _mm_cvtss_f32(_mm_movehl_ps(square, square));
        const float w = *weight++ * bell((x + y + z) * inverse);
        sum = _mm_add_ps(sum, _mm_mul_ps(_mm_set1_ps(w), k));
      });
      alignas(16) float s[4];
      _mm_store_ps(s, sum);
      const float size = std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
      next_[f] = size > 0.0F ? Float3{s[0] / size, s[1] / size, s[2] / size} : normals_[f];
    });
    normals_.swap(next_);
  }

  /// A normal like hardly any around, a face that noise turned over, mixes with none and would stay for ever: it
  /// becomes that of the neighbour whose normal most others are like.
  void replace_isolated(float inverse) {
    std::fill(stamp_.begin(), stamp_.end(), 0u);
    for_faces([&](std::uint32_t f) {
      next_[f] = normals_[f];
      near_.clear();
      for_each_neighbour(block_, corners_, f, [&](std::uint32_t g) {
        if (stamp_[g] == f + 1) return;
        stamp_[g] = f + 1;
        near_.push_back(g);
      });
      float all = 0.0F;
      for (const std::uint32_t g : near_) all += area_[g];
      if (support(normals_[f], inverse) >= kMinSupport * all) return;
      float maximum = -1.0F;
      for (const std::uint32_t g : near_)
        if (const float s = support(normals_[g], inverse); s > maximum) {
          maximum = s;
          next_[f] = normals_[g];
        }
    });
    normals_.swap(next_);
  }

  std::vector<Float3> result() && {
    normals_.pop_back();
    return std::move(normals_);
  }

 private:
  template <typename Use>
  void for_faces(Use&& use) const {
    if (some_ != nullptr)
      for (const std::uint32_t f : *some_) use(f);
    else
      for (std::uint32_t f = 0; f < area_.size(); ++f) use(f);
  }

  /// A normal and one number more, which nobody looks at.
  __m128 components(std::uint32_t f) const { return _mm_loadu_ps(normals_[f].data()); }

  /// Area and nearness of every neighbour of every face, in the order of for_each_neighbour().
  void weigh(const std::vector<Double3>& centre) {
    std::size_t count = 0;
    for_faces([&](std::uint32_t f) {
      for (const std::uint32_t v : block_.faces[f])
        if (const std::size_t m = joined_at(corners_, v).size(); m > 0) count += m - 1;
    });
    weight_.resize(count);
    std::size_t at = 0;
    std::vector<double> square;
    for_faces([&](std::uint32_t f) {
      square.clear();
      double sum = 0.0;
      for_each_neighbour(block_, corners_, f, [&](std::uint32_t g) {
        square.push_back(squared_distance(centre[g], centre[f]));
        sum += std::sqrt(square.back());
      });
      const double mean = square.empty() ? 0.0 : sum / static_cast<double>(square.size());
      const float per_width = mean > 0.0 ? static_cast<float>(0.5 / (mean * mean)) : 0.0F;
      std::size_t k = 0;
      for_each_neighbour(block_, corners_, f, [&](std::uint32_t g) {
        weight_[at++] = area_[g] * bell(static_cast<float>(square[k++]) * per_width);
      });
    });
  }

  /// Area of the neighbours whose normals are like this one.
  float support(const Float3& n, float inverse) const {
    float sum = 0.0F;
    for (const std::uint32_t g : near_) sum += area_[g] * alike(normals_[g], n, inverse);
    return sum;
  }

  const MeshBlock& block_;
  const FaceCorners& corners_;
  const std::vector<std::uint32_t>* some_;
  std::vector<float> area_, weight_;
  std::vector<Float3> normals_, next_;  ///< m and one more, so that four numbers can be read of each
  std::vector<std::uint32_t> stamp_, near_;
};

}  // namespace

int normal_rings(const NormalFilterOptions& options) {
  return options.normal_rounds + (options.normal_rounds >= 4 ? 2 : 0);
}

int filter_rings(const NormalFilterOptions& options) {
  return normal_rings(options) + options.vertex_rounds;
}

std::vector<Float3> filter_normals(const MeshBlock& block, const FaceCorners& corners,
                                   const NormalFilterOptions& options, std::span<const std::uint8_t> wanted) {
  // What is as far as all rings is read but as it is.
  const std::vector<std::uint32_t> some =
      wanted.empty() ? std::vector<std::uint32_t>() : faces_around(block, wanted, normal_rings(options) - 1);
  NormalRounds rounds(block, corners, wanted.empty() ? nullptr : &some);
  // Raw normals are off by as much as creases are sharp: begin with a wide range, and draw it in.
  const int quarter = options.normal_rounds / 4;
  for (int round = 0; round < options.normal_rounds; ++round) {
    const double wider = round < quarter ? 1.5 : round < 2 * quarter ? 1.25 : 1.0;
    rounds.average(inverse_range(wider * options.range_angle_deg));
    if (round + 1 == quarter || round + 1 == 2 * quarter)
      rounds.replace_isolated(inverse_range(wider * options.range_angle_deg));
  }
  return std::move(rounds).result();
}

std::uint64_t normal_bytes(std::uint64_t faces) {
  // Centres, areas, two sets of normals, stamps; fifteen weights a face, as many as corners of other faces at its three
  // vertices on a regular mesh, half as many again where degrees differ.
  return (24 + 4 + 24 + 4 + 4 * 23) * faces;
}

std::vector<Double3> filter_by_normals(const MeshBlock& block, const FaceCorners& corners,
                                       const NormalFilterOptions& options) {
  const std::vector<Float3> normals = filter_normals(block, corners, options);
  std::vector<Double3> now = block.position, next = block.position;
  for (int round = 0; round < options.vertex_rounds; ++round) {
    for (std::uint32_t v = 0; v < now.size(); ++v) {
      const auto star = corners.at(v);
      if (star.empty()) continue;
      const Double3 here = now[v];
      Double3 move{};
      for (const std::uint32_t corner : star) {
        const std::uint32_t f = corner >> 2;
        const auto& face = block.faces[f];
        const Double3 to_centre =
            ((now[face[0]] - here) + (now[face[1]] - here) + (now[face[2]] - here)) * (1.0 / 3.0);
        const Double3 n = {normals[f][0], normals[f][1], normals[f][2]};
        move = move + n * dot(n, to_centre);
      }
      move = move * (1.0 / static_cast<double>(star.size()));
      next[v] = here + move;
    }
    now.swap(next);
  }
  return now;
}

}  // namespace tessera
