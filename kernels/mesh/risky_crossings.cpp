#include "kernels/mesh/risky_crossings.h"

#include <algorithm>
#include <cstddef>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

/// Boxes of the core that lie within a cell of a marked face; what lies beyond the core counts to the outermost ones.
class RiskCells {
 public:
  RiskCells(const ContactCell& core, double cell) : low_(core.low), cell_(cell) {
    double width = 0.0;
    for (std::size_t a = 0; a < 3; ++a) width = std::max(width, core.high[a] - core.low[a]);
    per_edge_ = 1.0 / std::max(cell, width / static_cast<double>(kMaxRiskCells));
    for (std::size_t a = 0; a < 3; ++a)
      size_[a] = static_cast<std::size_t>((core.high[a] - core.low[a]) * per_edge_) + 1;
    marked_.resize(size_[0] * size_[1] * size_[2]);
  }
  void mark(const RiskyMesh& mesh, const std::array<std::uint32_t, 3>& f) {
    std::array<std::size_t, 3> from{}, to{};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [low, high] =
          std::minmax({mesh.position[f[0]][a], mesh.position[f[1]][a], mesh.position[f[2]][a]});
      from[a] = cell(a, low - cell_), to[a] = cell(a, high + cell_);
    }
    for (std::size_t z = from[2]; z <= to[2]; ++z)
      for (std::size_t y = from[1]; y <= to[1]; ++y)
        for (std::size_t x = from[0]; x <= to[0]; ++x) marked_[slot(x, y, z)] = 1;
  }
  bool holds(const Double3& p) const {
    return marked_[slot(cell(0, p[0]), cell(1, p[1]), cell(2, p[2]))] != 0;
  }

 private:
  std::size_t cell(std::size_t axis, double x) const {
    return static_cast<std::size_t>(
        std::clamp((x - low_[axis]) * per_edge_, 0.0, static_cast<double>(size_[axis] - 1)));
  }
  std::size_t slot(std::size_t x, std::size_t y, std::size_t z) const {
    return x + size_[0] * (y + size_[1] * z);
  }
  Double3 low_;
  double cell_, per_edge_ = 1.0;
  std::array<std::size_t, 3> size_{};
  std::vector<std::uint8_t> marked_;
};

}  // namespace

void risky_crossings(const RiskyMesh& mesh, const ContactCell& core,
                     const std::function<void(std::uint32_t, std::uint32_t)>& use) {
  RiskCells cells(core, mesh.cell);
  bool any = false;
  for (const auto& f : mesh.faces)
    if (mesh.is_risky(f)) cells.mark(mesh, f), any = true;
  if (!any) return;
  std::vector<std::uint8_t> near(mesh.position.size());
  for (std::size_t v = 0; v < near.size(); ++v) near[v] = cells.holds(mesh.position[v]);
  std::vector<ContactFace> compared;
  std::vector<std::uint32_t> number;
  for (std::size_t k = 0; k < mesh.faces.size(); ++k) {
    const auto& f = mesh.faces[k];
    if ((near[f[0]] | near[f[1]] | near[f[2]]) == 0) continue;
    const ContactFace face = {{mesh.position[f[0]], mesh.position[f[1]], mesh.position[f[2]]},
                              {mesh.name[f[0]], mesh.name[f[1]], mesh.name[f[2]]}};
    if (collinear(face.corner[0], face.corner[1], face.corner[2])) continue;
    compared.push_back(face);
    number.push_back(static_cast<std::uint32_t>(k));
  }
  block_contacts(compared, core, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
    if (mesh.is_risky(mesh.faces[number[i]]) || mesh.is_risky(mesh.faces[number[j]]))
      use(number[i], number[j]);
  });
}

}  // namespace tessera
