#include "kernels/decimate/block_clustering.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "kernels/decimate/cluster_vertex.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/key_table.h"
#include "octree/morton.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoFace = ~std::uint32_t{0};
constexpr std::uint8_t kAllBorders = kFaceBorder01 | kFaceBorder12 | kFaceBorder20;

/// Faces that become the same one, or that join the same two cells.
struct CellFace {
  std::array<std::uint32_t, 3> cell{};  ///< ascending; the last ones repeat where there are fewer
  std::uint32_t face = 0;
  auto operator<=>(const CellFace&) const = default;
};

bool same_cells(const CellFace& a, const CellFace& b) {
  return a.cell == b.cell;
}

/// A face of the result: the cells that it joins, or the face of the input that it is.
struct Survivor {
  std::array<std::uint32_t, 3> cell{};  ///< counter-clockwise
  std::uint32_t face = 0;
};

class BlockClustering {
 public:
  BlockClustering(const MeshBlock& near, std::span<const std::uint8_t> core, const ClusterGrid& grid,
                  bool floats)
      : near_(near), core_(core), grid_(grid), floats_(floats) {
    find_cells();
    place_vertices();
    sort_faces();
  }

  ClusteredBlock result() {
    ClusteredBlock out;
    join_cells();
    keep_uncovered(pairs_);
    keep_uncovered(singles_);
    std::sort(kept_.begin(), kept_.end());
    for (const CellFace& kept : kept_) out.faces_kept += core_[kept.face] != 0;
    bound_core();
    out.bound = bound_;
    write(out.block);
    return out;
  }

 private:
  const Double3& corner(std::uint32_t f, std::size_t k) const { return near_.position[near_.faces[f][k]]; }
  std::uint32_t cell(std::uint32_t f, std::size_t k) const { return cell_of_[near_.faces[f][k]]; }
  Double3 wide_normal(std::uint32_t f) const {
    return cross(corner(f, 1) - corner(f, 0), corner(f, 2) - corner(f, 0));
  }
  bool touched(const CellFace& a) const {
    return touched_[a.cell[0]] != 0 && touched_[a.cell[1]] != 0 && touched_[a.cell[2]] != 0;
  }

  void find_cells() {
    KeyTable table;
    cell_of_.reserve(near_.position.size());
    for (const Double3& p : near_.position) cell_of_.push_back(table.add(grid_.key(p)).first);
    cell_key_.assign(table.keys().begin(), table.keys().end());
    touched_.assign(cell_key_.size(), 0);
    for (std::uint32_t f = 0; f < near_.faces.size(); ++f)
      for (std::size_t k = 0; core_[f] != 0 && k < 3; ++k) touched_[cell(f, k)] = 1;
  }

  /// Only cells that core faces touch are complete.
  void place_vertices() {
    std::vector<std::uint32_t> slot(cell_key_.size(), 0);
    std::vector<ClusterVertex> sums;
    for (std::size_t c = 0; c < slot.size(); ++c)
      if (touched_[c] != 0) {
        slot[c] = static_cast<std::uint32_t>(sums.size());
        sums.emplace_back();
      }
    for (std::uint32_t f = 0; f < near_.faces.size(); ++f) {
      const Double3 wide = wide_normal(f);
      const double square = dot(wide, wide), area = std::sqrt(square);
      const Double3 normal = area > 0.0 ? wide * (1.0 / area) : Double3{};
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t c = cell(f, k);
        if (touched_[c] == 0) continue;
        ClusterVertex& sum = sums[slot[c]];
        const Double3 center = grid_.center(cell_key_[c]);
        sum.quadric += plane_quadric(normal, corner(f, 0) - center, square);
        // Corners of faces without area still say where the cell is occupied.
        const double weight = std::max(area, 0x1p-40 * grid_.cell * grid_.cell);
        sum.add(corner(f, k) - center, weight);
        const std::uint32_t rgba = near_.rgba.empty() ? 0 : near_.rgba[near_.faces[f][k]];
        if (rgba >> 24 != 0) sum.add_colour(rgba, weight);
      }
    }
    vertex_.resize(cell_key_.size());
    rgba_.resize(cell_key_.size());
    for (std::size_t c = 0; c < slot.size(); ++c) {
      if (touched_[c] == 0) continue;
      const ClusterVertex& sum = sums[slot[c]];
      vertex_[c] = grid_.center(cell_key_[c]) + sum.position(grid_.cell);
      if (floats_)
        for (double& x : vertex_[c]) x = static_cast<double>(static_cast<float>(x));
      rgba_[c] = sum.colour_weight > 0.0 ? sum.rgba() : 0;
    }
  }

  void sort_faces() {
    for (std::uint32_t f = 0; f < near_.faces.size(); ++f) {
      CellFace a{{cell(f, 0), cell(f, 1), cell(f, 2)}, f};
      std::sort(a.cell.begin(), a.cell.end());
      if (a.cell[0] == a.cell[1]) a.cell[1] = a.cell[2];
      if (a.cell[0] == a.cell[1])
        singles_.push_back(a);
      else
        (a.cell[1] == a.cell[2] ? pairs_ : triples_).push_back(a);
    }
    for (auto* faces : {&triples_, &pairs_, &singles_}) std::sort(faces->begin(), faces->end());
  }

  template <class Use>
  static void each_group(const std::vector<CellFace>& faces, const Use& use) {
    for (auto first = faces.begin(); first != faces.end();) {
      auto end = first;
      while (end != faces.end() && same_cells(*end, *first)) ++end;
      use(std::span<const CellFace>(first, end));
      first = end;
    }
  }

  /// Faces between three cells, turned as most of their area is.
  void join_cells() {
    covered_.assign(cell_key_.size(), false);
    kept_at_.assign(cell_key_.size(), kNoFace);
    each_group(triples_, [&](std::span<const CellFace> group) {
      const auto& c = group.front().cell;
      for (std::size_t k = 0; k < 3; ++k) {
        covered_[c[k]] = true;
        edges_.push_back({std::min(c[k], c[(k + 1) % 3]), std::max(c[k], c[(k + 1) % 3])});
      }
      const std::uint32_t winner = group.front().face;
      if (!touched(group.front()) || core_[winner] == 0) return;
      double turn = 0.0;
      for (const CellFace& a : group) {
        const std::size_t at = cell(a.face, 0) == c[0] ? 0 : cell(a.face, 1) == c[0] ? 1 : 2;
        turn += (cell(a.face, (at + 1) % 3) == c[1] ? 1.0 : -1.0) * norm(wide_normal(a.face));
      }
      joined_.push_back({turn >= 0.0 ? c : std::array{c[0], c[2], c[1]}, winner});
    });
    std::sort(edges_.begin(), edges_.end());
  }

  std::size_t faces_at(std::uint32_t a, std::uint32_t b) const {
    const auto range =
        std::equal_range(edges_.begin(), edges_.end(), std::array{std::min(a, b), std::max(a, b)});
    return static_cast<std::size_t>(range.second - range.first);
  }

  /// The largest face of each group that no face between three cells covers. \pre pairs come before single cells
  void keep_uncovered(const std::vector<CellFace>& faces) {
    each_group(faces, [&](std::span<const CellFace> group) {
      const std::uint32_t a = group.front().cell[0], b = group.front().cell[1];
      if (touched_[a] == 0 && touched_[b] == 0) return;  // not all of its faces may be here
      if (a == b ? covered_[a] || kept_at_[a] != kNoFace : faces_at(a, b) > 0) return;
      std::uint32_t largest = group.front().face;
      double area = norm(wide_normal(largest));
      for (const CellFace& face : group)
        if (const double other = norm(wide_normal(face.face)); other > area) {
          area = other;
          largest = face.face;
        }
      kept_.push_back({group.front().cell, largest});
      for (const std::uint32_t c : {a, b})
        if (kept_at_[c] == kNoFace) kept_at_[c] = largest;
    });
  }

  /// The kept face that stands for a collapsed one; kNoFace where vertices of cells do.
  std::uint32_t stand_in(const CellFace& face) const {
    const std::uint32_t a = face.cell[0], b = face.cell[1];
    if (a == b) return covered_[a] ? kNoFace : kept_at_[a];
    if (faces_at(a, b) > 0) return kNoFace;
    return std::lower_bound(kept_.begin(), kept_.end(), CellFace{{a, b, b}, 0})->face;
  }

  void bound_core() {
    for (const auto* faces : {&triples_, &pairs_, &singles_})
      for (const CellFace& face : *faces) {
        if (core_[face.face] == 0) continue;
        const std::uint32_t kept = faces == &triples_ ? kNoFace : stand_in(face);
        for (std::size_t k = 0; k < 3; ++k) {
          const Double3& p = corner(face.face, k);
          double nearest = 0.0;
          if (kept == kNoFace) {
            nearest = norm(p - vertex_[cell(face.face, k)]);
          } else {
            // Corner by corner to one in the same cell: so are all points between.
            nearest = INFINITY;
            for (std::size_t j = 0; j < 3; ++j)
              if (cell(kept, j) == cell(face.face, k)) nearest = std::min(nearest, norm(p - corner(kept, j)));
          }
          bound_ = std::max(bound_, nearest);
        }
      }
    bound_ *= 1.0 + 0x1p-40;
  }

  void write(MeshBlock& out) {
    const bool colour = !near_.rgba.empty();
    std::vector<std::uint32_t> number(cell_key_.size(), kNoFace);
    for (const Survivor& s : joined_) {
      std::array<std::uint32_t, 3> face{};
      std::uint8_t flags = near_.face_flags[s.face] & kFaceSynthetic;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t c = s.cell[k];
        if (number[c] == kNoFace) {
          number[c] = static_cast<std::uint32_t>(out.key.size());
          out.key.push_back(cell_key_[c]);
          out.position.push_back(vertex_[c]);
          out.vertex_class.push_back(VertexClass::kSmooth);
          if (colour) out.rgba.push_back(rgba_[c]);
        }
        face[k] = number[c];
        if (faces_at(c, s.cell[(k + 1) % 3]) == 1) flags |= static_cast<std::uint8_t>(kFaceBorder01 << k);
      }
      out.faces.push_back(face);
      out.face_flags.push_back(flags);
    }
    std::vector<std::uint32_t> copied(near_.key.size(), kNoFace);
    for (const CellFace& kept : kept_) {
      const std::uint32_t f = kept.face;
      if (core_[f] == 0) continue;
      std::array<std::uint32_t, 3> face{};
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = near_.faces[f][k];
        if (copied[v] == kNoFace) {
          copied[v] = static_cast<std::uint32_t>(out.key.size());
          out.key.push_back(near_.key[v]);
          out.position.push_back(near_.position[v]);
          out.vertex_class.push_back(near_.vertex_class[v]);
          if (colour) out.rgba.push_back(near_.rgba[v]);
        }
        face[k] = copied[v];
      }
      out.faces.push_back(face);
      out.face_flags.push_back((near_.face_flags[f] & kFaceSynthetic) | kAllBorders);
    }
    canonicalise(out);
  }

  const MeshBlock& near_;
  std::span<const std::uint8_t> core_;
  ClusterGrid grid_;
  bool floats_;
  std::vector<std::uint32_t> cell_of_;   ///< per vertex: number of its cell
  std::vector<std::uint64_t> cell_key_;  ///< per cell
  std::vector<std::uint8_t> touched_;    ///< per cell: a core face has a corner there
  std::vector<bool> covered_;            ///< per cell: by a face between three cells
  std::vector<Double3> vertex_;
  std::vector<std::uint32_t> rgba_;
  std::vector<CellFace> triples_, pairs_, singles_;
  std::vector<std::array<std::uint32_t, 2>> edges_;  ///< of faces between three cells, ascending
  std::vector<Survivor> joined_;
  std::vector<CellFace> kept_;          ///< with the cells whose collapsed faces they stand for
  std::vector<std::uint32_t> kept_at_;  ///< per cell: a face kept there
  double bound_ = 0.0;
};

}  // namespace

std::uint64_t ClusterGrid::key(const Double3& p) const {
  constexpr double kLast = static_cast<double>((1u << kClusterBits) - 1);
  std::array<std::uint32_t, 3> at{};
  for (std::size_t k = 0; k < 3; ++k)
    at[k] = static_cast<std::uint32_t>(std::clamp(std::floor((p[k] - low[k]) / cell), 0.0, kLast));
  return static_cast<std::uint64_t>(tag) << 3 * kClusterBits | morton_encode(at[0], at[1], at[2]);
}

Double3 ClusterGrid::center(std::uint64_t key) const {
  const auto at = morton_decode(key & ((std::uint64_t{1} << 3 * kClusterBits) - 1));
  Double3 out;
  for (std::size_t k = 0; k < 3; ++k) out[k] = low[k] + (static_cast<double>(at[k]) + 0.5) * cell;
  return out;
}

ClusteredBlock cluster_block(const MeshBlock& near, std::span<const std::uint8_t> core,
                             const ClusterGrid& grid, bool floats) {
  return BlockClustering(near, core, grid, floats).result();
}

}  // namespace tessera
