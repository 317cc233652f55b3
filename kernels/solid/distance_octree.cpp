#include "kernels/solid/distance_octree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr int kKept = kBrickCells;  ///< edge of the cubes whose values are kept while their cells are made
constexpr int kSteps = 8;           ///< of a cell between two of its corners: where it is looked at
constexpr std::uint64_t kMaxNodes = std::uint64_t{1} << 32;

double interpolate(const std::array<float, 8>& v, double x, double y, double z) {
  const auto along = [&](std::size_t c, std::size_t step, double t) {
    return double{v[c]} * (1.0 - t) + double{v[c + step]} * t;
  };
  const double low = along(0, 1, x) * (1.0 - y) + along(2, 1, x) * y;
  const double high = along(4, 1, x) * (1.0 - y) + along(6, 1, x) * y;
  return low * (1.0 - z) + high * z;
}

Int3 child_corner(const Int3& corner, int child, int half) {
  return {corner[0] + (child & 1) * half, corner[1] + (child >> 1 & 1) * half,
          corner[2] + (child >> 2) * half};
}

}  // namespace

class OctreeBuilder {
 public:
  OctreeBuilder(double tolerance, const std::function<double(const Int3&)>& distance,
                const std::function<void()>& pause)
      : tolerance_(tolerance - kBetweenNodes), distance_(distance), pause_(pause) {}

  DistanceOctree build(const Int3& corner, int edge) {
    levels_.resize(static_cast<std::size_t>(std::bit_width(static_cast<unsigned>(edge))));
    visit(corner, edge, 0);
    DistanceOctree tree(corner, edge);
    for (Level& level : levels_) {
      for (const bool halved : level.halved) {
        if (tree.nodes_ % 64 == 0) tree.halved_.push_back(0);
        tree.halved_.back() |= static_cast<std::uint64_t>(halved) << (tree.nodes_ % 64);
        ++tree.nodes_;
      }
      tree.cells_.insert(tree.cells_.end(), level.cells.begin(), level.cells.end());
      level = {};
    }
    tree.count();
    return tree;
  }

 private:
  /// Nodes of one level come in the order of their parents, whatever is visited between them.
  struct Level {
    std::vector<bool> halved;
    std::vector<std::array<float, 8>> cells;
  };

  float value(const Int3& node) {
    if (kept_.empty()) return static_cast<float>(distance_(node));
    float& known = kept_[static_cast<std::size_t>(node[0] - kept_corner_[0]) +
                         (kKept + 1) * (static_cast<std::size_t>(node[1] - kept_corner_[1]) +
                                        (kKept + 1) * static_cast<std::size_t>(node[2] - kept_corner_[2]))];
    if (std::isnan(known)) known = static_cast<float>(distance_(node));
    return known;
  }

  bool is_within(const Int3& corner, int edge, const std::array<float, 8>& v) {
    if (edge == 1) return true;
    const int step = std::max(1, edge / kSteps), steps = edge / step;
    const auto off = [&](int x, int y, int z) {
      const Int3 node = {corner[0] + x * step, corner[1] + y * step, corner[2] + z * step};
      const double n = steps;
      return std::fabs(interpolate(v, x / n, y / n, z / n) - double{value(node)}) > tolerance_;
    };
    if (off(steps / 2, steps / 2, steps / 2)) return false;  // most often it shows in the middle
    for (int z = 0; z <= steps; ++z)
      for (int y = 0; y <= steps; ++y)
        for (int x = 0; x <= steps; ++x)
          if (off(x, y, z)) return false;
    return true;
  }

  void visit(const Int3& corner, int edge, std::size_t level) {
    if (pause_ && edge >= 8) pause_();
    if (edge == kKept) {
      kept_corner_ = corner;
      kept_.assign((kKept + 1) * (kKept + 1) * (kKept + 1), std::numeric_limits<float>::quiet_NaN());
    }
    std::array<float, 8> v;
    for (int c = 0; c < 8; ++c) v[static_cast<std::size_t>(c)] = value(child_corner(corner, c, edge));
    const bool done = is_within(corner, edge, v);
    levels_[level].halved.push_back(!done);
    if (done) {
      levels_[level].cells.push_back(v);
    } else {
      for (int child = 0; child < 8; ++child)
        visit(child_corner(corner, child, edge / 2), edge / 2, level + 1);
    }
    if (edge == kKept) kept_.clear();
  }

  double tolerance_;
  const std::function<double(const Int3&)>& distance_;
  const std::function<void()>& pause_;
  std::vector<Level> levels_;
  std::vector<float> kept_;
  Int3 kept_corner_{};
};

DistanceOctree::DistanceOctree(const Int3& corner, int edge, std::vector<std::uint64_t> halved,
                               std::uint64_t nodes, std::vector<std::array<float, 8>> cells)
    : corner_(corner), edge_(edge), nodes_(nodes), halved_(std::move(halved)), cells_(std::move(cells)) {
  if (edge_ < 1 || !std::has_single_bit(static_cast<unsigned>(edge_)) || nodes_ == 0 || nodes_ >= kMaxNodes ||
      halved_.size() != (nodes_ + 63) / 64)
    throw InputError("a cube of cells is no octree");
  count();
  std::uint64_t parents = 0;
  for (const std::uint64_t word : halved_) parents += static_cast<std::uint64_t>(std::popcount(word));
  // Cells of the lattice are not halved.
  std::uint64_t first = 0, size = 1;
  for (int e = edge_; size > 0; e /= 2) {
    std::uint64_t below = 0;
    for (std::uint64_t n = first; n < std::min(nodes_, first + size); ++n) below += is_halved(n) ? 8 : 0;
    if (e == 0) throw InputError("a cube of cells is no octree");
    first += size;
    size = below;
  }
  if (first != nodes_ || 8 * parents + 1 != nodes_ || cells_.size() != nodes_ - parents)
    throw InputError("a cube of cells is no octree");
}

void DistanceOctree::count() {
  before_.clear();
  std::uint64_t sum = 0;
  for (const std::uint64_t word : halved_) {
    before_.push_back(sum);
    sum += static_cast<std::uint64_t>(std::popcount(word));
  }
}

double DistanceOctree::at(const Double3& p) const {
  Double3 in;
  for (std::size_t k = 0; k < 3; ++k) in[k] = (p[k] - corner_[k]) / edge_;
  std::uint64_t node = 0;
  for (;;) {
    const std::uint64_t parents =
        before_[node / 64] + static_cast<std::uint64_t>(
                                 std::popcount(halved_[node / 64] & ((std::uint64_t{1} << (node % 64)) - 1)));
    if (!is_halved(node)) return interpolate(cells_[node - parents], in[0], in[1], in[2]);
    node = 8 * parents + 1;
    for (std::size_t k = 0; k < 3; ++k) {
      in[k] *= 2.0;
      if (in[k] < 1.0) continue;
      in[k] -= 1.0;
      node += std::uint64_t{1} << k;
    }
  }
}

std::vector<std::uint64_t> DistanceOctree::sizes() const {
  std::vector<std::uint64_t> out(static_cast<std::size_t>(std::bit_width(static_cast<unsigned>(edge_))), 0);
  std::uint64_t first = 0, size = 1;
  for (std::size_t level = out.size(); size > 0 && level-- > 0;) {
    std::uint64_t parents = 0;
    for (std::uint64_t n = first; n < first + size; ++n) parents += is_halved(n) ? 1 : 0;
    out[level] = size - parents;
    first += size;
    size = 8 * parents;
  }
  return out;
}

DistanceOctree build_distance_octree(const Int3& corner, int edge, double tolerance,
                                     const std::function<double(const Int3&)>& distance,
                                     const std::function<void()>& pause) {
  return OctreeBuilder(tolerance, distance, pause).build(corner, edge);
}

}  // namespace tessera
