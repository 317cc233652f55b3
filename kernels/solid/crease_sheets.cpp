#include "kernels/solid/crease_sheets.h"

#include <algorithm>
#include <tuple>

namespace tessera {
namespace {

constexpr double kOneSheet = 0.906;       ///< cosine of 25 degrees
constexpr double kMinShare = 1.0 / 50.0;  ///< of the area around a vertex

struct Facet {
  Double3 area_vector;  ///< as long as its area, doubled
  double area;
  bool operator<(const Facet& o) const {
    return std::tie(o.area, o.area_vector[0], o.area_vector[1], o.area_vector[2]) <
           std::tie(area, area_vector[0], area_vector[1], area_vector[2]);
  }
};

}  // namespace

CreaseSheets::CreaseSheets(const MeshBlock& block) : first_(block.position.size() + 1, 0) {
  std::vector<std::uint32_t> start(block.position.size() + 1, 0), around(3 * block.faces.size());
  for (const auto& f : block.faces)
    for (const std::uint32_t v : f) ++start[v + 1];
  for (std::size_t v = 0; v < block.position.size(); ++v) start[v + 1] += start[v];
  std::vector<std::uint32_t> fill(start.begin(), start.end() - 1);
  for (std::uint32_t f = 0; f < block.faces.size(); ++f)
    for (const std::uint32_t v : block.faces[f]) around[fill[v]++] = f;

  std::vector<Facet> facets;
  std::vector<std::uint32_t> faces;
  std::vector<Double3> seed, sum;
  for (std::size_t v = 0; v < block.position.size(); ++v) {
    facets.clear(), seed.clear(), sum.clear(), faces.clear();
    double all = 0.0;
    // Beside a crease one ring may have nothing but slivers on a side.
    for (std::uint32_t i = start[v]; i < start[v + 1]; ++i)
      for (const std::uint32_t u : block.faces[around[i]])
        faces.insert(faces.end(), around.begin() + start[u], around.begin() + start[u + 1]);
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    for (const std::uint32_t face : faces) {
      const auto& f = block.faces[face];
      const Double3 area_vector =
          triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]);
      facets.push_back({area_vector, norm(area_vector)});
    }
    std::sort(facets.begin(), facets.end());
    for (const Facet& f : facets) all += f.area;
    for (const Facet& f : facets) {
      if (!(f.area > 0.0)) break;
      const Double3 normal = f.area_vector / f.area;
      std::size_t best = seed.size();
      double maximum = kOneSheet;
      for (std::size_t s = 0; s < seed.size(); ++s)
        if (const double c = dot(seed[s], normal); c > maximum) maximum = c, best = s;
      if (best < seed.size()) {
        sum[best] = sum[best] + f.area_vector;
      } else if (f.area >= kMinShare * all) {
        seed.push_back(normal);
        sum.push_back(f.area_vector);
      }
    }
    if (sum.size() > 1)
      for (const Double3& s : sum) normal_.push_back(unit_or_zero(s));
    first_[v + 1] = static_cast<std::uint32_t>(normal_.size());
  }
}

}  // namespace tessera
