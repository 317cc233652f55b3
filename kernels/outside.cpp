#include "kernels/outside.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr float kPixelCells = 12.0f;  ///< one and a half coarse surfels: a whole surface leaves no pixel free
constexpr float kDepthCells = 12.0f;  ///< what lies this little behind the front is still the front

float dot(const Float3& a, const Float3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Float3 cross(const Float3& a, const Float3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Float3 unit(const Float3& v) {
  const float l = std::sqrt(dot(v, v));
  return {v[0] / l, v[1] / l, v[2] / l};
}

struct Seen {
  std::uint64_t pixel;
  float depth;
  std::uint32_t surfel;
};
struct Pixel {
  std::uint64_t at;
  float low, high;
};

std::uint64_t pixel_key(std::int64_t u, std::int64_t v) {
  constexpr std::int64_t kBias = std::int64_t{1} << 30;
  return (static_cast<std::uint64_t>(u + kBias) << 32) | static_cast<std::uint64_t>(v + kBias);
}

}  // namespace

std::vector<SideVotes> look_from_outside(std::span<const JobSurfel> surfels, std::size_t patches,
                                         double scale) {
  std::vector<SideVotes> votes(patches);
  std::vector<Seen> seen(surfels.size());
  std::vector<Pixel> pixels;
  for (int d = 14; d < 27; ++d) {
    const Float3 way = unit(
        {static_cast<float>(d % 3 - 1), static_cast<float>(d / 3 % 3 - 1), static_cast<float>(d / 9 - 1)});
    const Float3 side = unit(cross(way, std::fabs(way[2]) < 0.9f ? Float3{0, 0, 1} : Float3{1, 0, 0}));
    const Float3 other = cross(way, side);
    for (std::uint32_t i = 0; i < surfels.size(); ++i) {
      const Float3& p = surfels[i].position;
      const auto u = static_cast<std::int64_t>(std::floor(dot(p, side) / kPixelCells));
      const auto v = static_cast<std::int64_t>(std::floor(dot(p, other) / kPixelCells));
      seen[i] = {pixel_key(u, v), dot(p, way), i};
    }
    std::sort(seen.begin(), seen.end(), [](const Seen& l, const Seen& r) {
      return l.pixel != r.pixel ? l.pixel < r.pixel : l.surfel < r.surfel;
    });
    pixels.clear();
    for (const Seen& s : seen) {
      if (pixels.empty() || pixels.back().at != s.pixel) pixels.push_back({s.pixel, s.depth, s.depth});
      pixels.back().low = std::min(pixels.back().low, s.depth);
      pixels.back().high = std::max(pixels.back().high, s.depth);
    }
    std::size_t own = 0;
    Pixel around{};
    for (std::size_t k = 0; k < seen.size(); ++k) {
      if (k == 0 || seen[k].pixel != seen[k - 1].pixel) {
        if (k != 0) ++own;
        // The nearest of the pixel and its eight neighbours: a gap between two of them lets nothing through.
        around = pixels[own];
        for (std::uint64_t du = 0; du < 3; ++du) {
          const std::uint64_t first = seen[k].pixel + ((du - 1) << 32) - 1;
          auto it = std::lower_bound(pixels.begin(), pixels.end(), first,
                                     [](const Pixel& p, std::uint64_t key) { return p.at < key; });
          for (; it != pixels.end() && it->at <= first + 2; ++it) {
            around.low = std::min(around.low, it->low);
            around.high = std::max(around.high, it->high);
          }
        }
      }
      const JobSurfel& s = surfels[seen[k].surfel];
      const float area = std::sqrt(dot(s.area, s.area));
      if (!(area > 0.0f)) continue;
      const float cosine = dot(s.area, way) / area;
      const float c = std::fabs(cosine);
      if (c < 0.2f) continue;
      const float lean = std::sqrt(std::max(0.0f, 1.0f - c * c)) / c;
      const float own_depth = kDepthCells * (1.0f + lean);
      const float near_depth = kDepthCells * (1.0f + 2.5f * lean);
      const auto vote = static_cast<std::int64_t>(
          std::floor(scale / 17.0 * static_cast<double>(s.surfels) * static_cast<double>(c) + 0.5));
      const auto look = [&](float from, float front_own, float front_near, float sign, bool above) {
        if (from < front_own - own_depth || from < front_near - near_depth) return;
        SideVotes& v = votes[s.patch];
        (cosine * sign > 0.0f ? v.seen : v.hidden) += above ? 2 * vote : vote;
      };
      look(seen[k].depth, pixels[own].high, around.high, 1.0f, way[2] > 0.1f);
      look(-seen[k].depth, -pixels[own].low, -around.low, -1.0f, way[2] < -0.1f);
    }
  }
  return votes;
}

}  // namespace tessera
