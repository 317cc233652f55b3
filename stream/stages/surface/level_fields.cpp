#include "stream/stages/surface/level_fields.h"

#include <map>

namespace tessera {
namespace {

/// Whether points lie in [low - halo, low + cells + halo), on a finer lattice than theirs.
class Part {
 public:
  Part(const PointBlock& points, float by, const Int3& low, const Int3& cells, int halo)
      : points_(points), by_(by) {
    for (std::size_t a = 0; a < 3; ++a) {  // exact: a few thousand cells
      offset_[a] = static_cast<float>(points.origin[a]) * by - static_cast<float>(low[a]);
      min_[a] = static_cast<float>(-halo);
      max_[a] = static_cast<float>(cells[a] + halo);
    }
  }
  bool holds(std::size_t i, Float3& p) const {
    const Float3 at = {points_.x[i], points_.y[i], points_.z[i]};
    for (std::size_t a = 0; a < 3; ++a) {
      p[a] = at[a] * by_ + offset_[a];
      if (p[a] < min_[a] || p[a] >= max_[a]) return false;
    }
    return true;
  }

 private:
  const PointBlock& points_;
  float by_;
  Float3 offset_, min_, max_;
};
NodeFilter filter(const PointBlock& block, const std::function<bool(const Int3&)>& wanted) {
  return [&block, &wanted](const Int3& leaf) {
    const Int3 first = {block.origin[0] + kLeafCells * leaf[0], block.origin[1] + kLeafCells * leaf[1],
                        block.origin[2] + kLeafCells * leaf[2]};
    LeafWords words{};
    for (int z = 0; z < 8; ++z)
      for (int b = 0; b < 64; ++b)
        if (wanted({first[0] + (b & 7), first[1] + (b >> 3), first[2] + z}))
          words[static_cast<std::size_t>(z)] |= std::uint64_t{1} << b;
    return words;
  };
}

Int3 times(const Int3& at, int by) {
  return {at[0] * by, at[1] * by, at[2] * by};
}

}  // namespace

std::size_t count_part(const PointBlock& points, const Int3& low, const Int3& cells, int halo) {
  const Part part(points, 1, low, cells, halo);
  std::size_t count = 0;
  Float3 p;
  for (std::size_t i = 0; i < points.size(); ++i) count += part.holds(i, p);
  return count;
}

PointBlock scaled_part(const PointBlock& points, float by, const Int3& low, const Int3& cells, int halo) {
  PointBlock out;
  out.origin = low;
  out.cells = cells;
  const Part part(points, by, low, cells, halo);
  for (std::size_t i = 0; i < points.size(); ++i) {
    Float3 p;
    if (!part.holds(i, p)) continue;
    out.x.push_back(p[0]), out.y.push_back(p[1]), out.z.push_back(p[2]);
    out.nx.push_back(points.nx[i]), out.ny.push_back(points.ny[i]), out.nz.push_back(points.nz[i]);
    if (!points.rgba.empty()) out.rgba.push_back(points.rgba[i]);
    if (!points.flags.empty()) out.flags.push_back(points.flags[i]);
  }
  return out;
}

/// Of what nodes and normals of the level itself see, and those of the next coarser one beside it.
int LevelFieldMaker::near_halo(int level) const {
  return (2 * (2 + field_halo() + kLeafCells) + scale(level) - 1) / scale(level);
}

/// Planes of the neighbourhoods of this level in place of those that estimation saw on the coarsest one, which decided the sides.
PointBlock LevelFieldMaker::with_own_normals(const PointBlock& points, float by, const Int3& low,
                                             const Int3& cells) const {
  Int3 first = low, size = cells;
  for (std::size_t a = 0; a < 3; ++a) first[a] -= kLeafCells, size[a] += 2 * kLeafCells;
  const PointBlock wide = scaled_part(points, by, first, size, normal_halo_cells(normals_));
  const std::vector<PointShape> shapes = estimate_shapes(wide, normals_);
  PointBlock out = scaled_part(points, by, low, cells, kLeafCells);
  for (std::size_t i = 0; i < out.size(); ++i) {
    // Samples of the surface model lie as far apart as cells of the coarsest level: they say themselves how it leans.
    if (!out.flags.empty() && (out.flags[i] & kPointSynthetic) != 0) continue;
    const Float3& n = shapes.at(i).normal;
    const float along = n[0] * out.nx[i] + n[1] * out.ny[i] + n[2] * out.nz[i];
    if (along == 0.0f) continue;  // none of them, or none there
    const float sign = along < 0.0f ? -1.0f : 1.0f;
    out.nx[i] = sign * n[0], out.ny[i] = sign * n[1], out.nz[i] = sign * n[2];
  }
  return out;
}

/// The points of a block on a level. \param low  min corner, cells of that level
PointBlock LevelFieldMaker::points_on(const PointBlock& around, int level, const Int3& low,
                                      const Int3& cells) const {
  const auto by = static_cast<float>(scale(level));
  return refines_normals_ && level + 1 < levels_ ? with_own_normals(around, by, low, cells)
                                                 : scaled_part(around, by, low, cells, kLeafCells);
}
FieldOptions LevelFieldMaker::options_on(int level, const std::function<void()>& pause) const {
  FieldOptions options = field_;
  options.noise_cells *= scale(level);
  options.pause = pause;
  return options;
}
/// Of nodes relative to a brick: well within it and far from it they are all wanted or none is.
struct LevelFieldMaker::BrickNodes {
  const std::function<bool(const Int3&)>& wanted;
  const std::function<bool(const Int3&, const Int3&)>& may_be;  ///< of a box, both ends among it
  Int3 corner;                                                  ///< of the brick, in nodes of the level
  int edge;                                                     ///< of the brick, in cells of the level
  static constexpr int kMargin = 4;

  bool operator()(const Int3& n) const {
    return wanted({n[0] - corner[0], n[1] - corner[1], n[2] - corner[2]});
  }
  /// Whether all nodes of a box have one answer; it is that of its first one.
  bool is_one(const Int3& first, int nodes) const {
    bool within = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const int low = first[a] - corner[a], high = low + nodes - 1;
      if (high < -kMargin || low > edge + kMargin) return true;
      within = within && low >= kMargin && high <= edge - kMargin;
    }
    return within;
  }
  /// Whether any node of a box may be wanted.
  bool any(const Int3& first, int nodes) const {
    Int3 low, high;
    for (std::size_t a = 0; a < 3; ++a) low[a] = first[a] - corner[a], high[a] = low[a] + nodes - 1;
    return may_be(low, high) && (!is_one(first, nodes) || (*this)(first));
  }
  LeafWords words(const Int3& first) const {
    LeafWords out{};
    if (!any(first, kLeafCells)) return out;
    if (is_one(first, kLeafCells)) {
      out.fill(~std::uint64_t{0});
      return out;
    }
    for (int z = 0; z < 8; ++z)
      for (int b = 0; b < 64; ++b)
        if ((*this)({first[0] + (b & 7), first[1] + (b >> 3), first[2] + z}))
          out[static_cast<std::size_t>(z)] |= std::uint64_t{1} << b;
    return out;
  }
};

/// The points around a leaf.
struct LevelFieldMaker::Seen {
  const PointBlock& near;    ///< those that nodes of the level and of its neighbours see
  const PointBlock& around;  ///< those that nodes of coarser levels see, too
  const std::function<void()>& pause;
};

/// What the next coarser level, and those above it, say where the points are too sparse for this one.
/// \param points  of a block of the level  \param wanted  nodes of the level that may ask
/// \param requested  leaves of the coarser lattice that have such nodes around them, by their first node
std::unique_ptr<CoarserFits> LevelFieldMaker::coarser_fits(const PointBlock& around, const PointBlock& points,
                                                           int level, const Wanted& wanted,
                                                           const Wanted& requested,
                                                           const std::function<void()>& pause) const {
  if (level + 1 == levels_ || points.size() == 0) return nullptr;
  Int3 corner;
  for (std::size_t a = 0; a < 3; ++a) corner[a] = ((points.origin[a] - 1) >> 1) & -kLeafCells;
  const auto first_of = [&corner](const Int3& leaf) {
    return Int3{corner[0] + kLeafCells * leaf[0], corner[1] + kLeafCells * leaf[1],
                corner[2] + kLeafCells * leaf[2]};
  };
  auto out = std::make_unique<CoarserFits>(
      CoarserFits{SparseNodes(points, [&](const Int3& leaf) { return requested(first_of(leaf)); }), {}});
  const SparseNodes& sparse = out->sparse;
  if (!sparse.any()) return nullptr;
  const Wanted above = [&](const Int3& node) {
    Int3 local;
    for (std::size_t a = 0; a < 3; ++a) {
      local[a] = node[a] - sparse.origin()[a];
      if (local[a] < -1 || local[a] > sparse.cells()[a] + 1) return false;
    }
    if (sparse.depth(local) < -kBoundaryMargin) return false;
    for (int d = 0; d < 27; ++d)
      if (wanted({2 * node[0] + d % 3 - 1, 2 * node[1] + d / 3 % 3 - 1, 2 * node[2] + d / 9 - 1}))
        return true;
    return false;
  };
  const PointBlock coarse = points_on(around, level + 1, sparse.origin(), sparse.cells());
  const NodeFilter nodes = filter(coarse, above);
  std::map<Int3, LeafWords> known;  // a leaf is asked for twice
  const NodeFilter once = [&](const Int3& leaf) {
    const Int3 first = first_of(leaf);
    bool beyond = false;
    for (std::size_t a = 0; a < 3; ++a) beyond = beyond || leaf[a] < -1 || leaf[a] > sparse.cells()[a] / 8;
    if (beyond || !requested(first)) return LeafWords{};
    const auto [at, fresh] = known.try_emplace(leaf);
    if (fresh) at->second = nodes(leaf);
    return at->second;
  };
  const auto further = coarser_fits(
      around, coarse, level + 1, above,
      [&](const Int3& first) {
        for (int d = 0; d < 27; ++d) {
          Int3 leaf;
          for (std::size_t a = 0; a < 3; ++a)
            leaf[a] = ((2 * first[a] - 1 - corner[a]) >> kLeafBits) + (a == 0   ? d % 3
                                                                       : a == 1 ? d / 3 % 3
                                                                                : d / 9);
          if (once(leaf) != LeafWords{}) return true;
        }
        return false;
      },
      pause);
  out->band = fit_field(coarse, options_on(level + 1, pause), once, further.get());
  return out;
}

/// The field of a block on a level. \param low  min corner, cells of that level
DirectedField LevelFieldMaker::evaluate(const Seen& seen, int level, const Int3& low, int cells,
                                        const Wanted& wanted, const MayBe& may_be) const {
  const PointBlock points = points_on(seen.near, level, low, {cells, cells, cells});
  const BrickNodes nodes{wanted,
                         may_be,
                         {low[0] + kLevelMargin, low[1] + kLevelMargin, low[2] + kLevelMargin},
                         cells - 2 * kLevelMargin};
  const Wanted global = [&](const Int3& n) { return nodes(n); };
  const auto coarser = coarser_fits(
      seen.around, points, level, global,
      [&](const Int3& first) {
        const Int3 fine = {2 * first[0] - 1, 2 * first[1] - 1, 2 * first[2] - 1};
        return nodes.any(fine, 2 * kLeafCells + 1);
      },
      seen.pause);
  return evaluate_field(
      points, options_on(level, seen.pause),
      [&](const Int3& leaf) {
        return nodes.words(
            {low[0] + kLeafCells * leaf[0], low[1] + kLeafCells * leaf[1], low[2] + kLeafCells * leaf[2]});
      },
      coarser.get());
}

LevelFields LevelFieldMaker::fields_of(const Int3& leaf, int level, const LevelSurroundings& around,
                                       const PointBlock& points, const std::function<void()>& pause) const {
  const auto before = [&](int cells) {  // a leaf of nodes before the brick, so many cells along it
    Int3 at = times(leaf, cells);
    for (int& c : at) c -= kLevelMargin;
    return at;
  };
  // The wide surroundings are for coarser levels alone: most of the time nobody asks.
  const int e = edge(level);
  PointBlock near;
  if (scale(level) > 1) near = scaled_part(points, 1, times(leaf, e), {e, e, e}, near_halo(level));
  const Seen seen{scale(level) > 1 ? near : points, points, pause};
  LevelFields fields;
  fields.noisy = field_.noise_cells * scale(level) > kExactNoise;
  fields.own = evaluate(
      seen, level, before(kBrickCells), kOwnLevelCells, [&](const Int3& n) { return wanted_own(around, n); },
      [](const Int3&, const Int3&) { return true; });
  if (around.has(-1))
    fields.finer = evaluate(
        seen, level - 1, before(2 * kBrickCells), kFinerLevelCells,
        [&](const Int3& n) { return wanted_finer(around, n); },
        [&](const Int3& l, const Int3& h) { return may_want_finer(around, l, h); });
  if (around.has(1))
    fields.coarser = evaluate(
        seen, level + 1, before(kBrickCells / 2), kCoarserLevelCells,
        [&](const Int3& n) { return wanted_coarser(around, n); },
        [&](const Int3& l, const Int3& h) { return may_want_coarser(around, l, h); });
  return fields;
}

}  // namespace tessera
