#include "kernels/extract/edge_vertices.h"

#include <bit>

namespace tessera {
namespace {

/// Half the way between two vertices of one root, cells.
constexpr float kApart = 1.0f / 128;

/// A crossed edge of valid cells.
struct CrossedEdge {
  Int3 node;
  std::size_t axis;
  std::uint32_t root;
  std::uint32_t vertex, second;  ///< the same unless it is split
  bool border, moves;
  bool split() const { return second != vertex; }
};

template <class Use>
void each_edge(const LeafMasks& m, const Use& use) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t z = 0; z < 8; ++z) {
      std::uint32_t vertex = m.first_vertex[axis][z], split = m.first_split[axis][z];
      for (std::uint64_t left = m.edges[axis][z]; left; left &= left - 1, ++vertex) {
        const std::uint64_t bit = left & (~left + 1);
        const int b = std::countr_zero(left);
        use(CrossedEdge{{m.at[0] * 8 + (b & 7), m.at[1] * 8 + (b >> 3), m.at[2] * 8 + static_cast<int>(z)},
                        axis,
                        m.leaf->first_root[axis][z] +
                            static_cast<std::uint32_t>(std::popcount(m.leaf->crossing[axis][z] & (bit - 1))),
                        vertex,
                        (m.split[axis][z] & bit) != 0 ? split++ : vertex,
                        (m.border[axis][z] & bit) != 0,
                        (m.leaf->moving[axis][z] & bit) != 0});
      }
    }
}

/// Kept and named by other bricks: not on the max faces, at the min faces.
bool is_exported(const CrossedEdge& e) {
  return e.node[(e.axis + 1) % 3] == 0 || e.node[(e.axis + 2) % 3] == 0;
}

}  // namespace

void emit_edge_vertices(const DirectedField& field, const BrickBand& band, BorderShift& border,
                        PatchBuilder& patch) {
  patch.start(band.own_edge_vertices(), band.foreign_edge_vertices());
  const auto emit = [&](const CrossedEdge& e, bool own) {
    const int type = static_cast<int>(e.axis);
    const EdgeRoot& root = field.roots[e.root];
    Float3 p = in_owner(e.node);
    p[e.axis] += root.t;
    p = p + root.slide_offset();
    const Float3 shift = e.moves ? border.of_vertex(e.node, e.axis, e.root) : Float3{0, 0, 0};
    const VertexClass kind = e.border ? VertexClass::kBorder : VertexClass::kSmooth;
    const std::array<std::uint32_t, 2> both = {e.vertex, e.second};
    for (std::size_t i = 0; i < (e.split() ? 2u : 1u); ++i) {
      // Of two at one place each leans to its cells, or their faces would touch.
      Float3 at = p;
      if (e.split()) at[(e.axis + 2) % 3] += i == 1 ? kApart : -kApart;
      const bool exported = own && is_exported(e);
      const VertexKey key = patch.names() || exported ? patch.key(e.node, i == 1 ? type + 3 : type) : 0;
      const BrickVertex vertex{key, at + shift, root.rgba, kind};
      if (!own) {
        patch.set_foreign(both[i], vertex);
        continue;
      }
      patch.set_own(both[i], vertex);
      if (vertex.position != at) patch.add_safe(both[i], at);
      if (exported) patch.add_exported(key, both[i]);
    }
  };
  const auto name = [&](const CrossedEdge& e) {
    const int type = static_cast<int>(e.axis);
    patch.set_foreign(e.second, {.key = patch.key(e.node, type + 3)});
    patch.set_foreign(e.vertex, {.key = patch.key(e.node, type)});
  };
  for (const LeafMasks& m : band.leaves()) {
    const bool own = m.own();
    each_edge(m, [&](const CrossedEdge& e) { own || patch.names() ? emit(e, own) : name(e); });
  }
}

Float3 mean_point(const TracedLoop& loop) {
  Float3 mean = {0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < loop.size(); ++i) mean[k] += loop.samples.point[i][k];
    mean[k] /= static_cast<float>(loop.size());
  }
  return mean;
}

std::uint32_t mean_colour(const DirectedField& field, const TracedLoop& loop) {
  ColourMean colour;
  for (std::size_t i = 0; i < loop.size(); ++i) colour.add(field.roots[loop.root[i]].rgba);
  return colour.value();
}

TracedLoop LeafEdges::loop(const DirectedField& field, const Int3& cell, int number, const std::uint8_t* edge,
                           std::size_t size) const {
  TracedLoop loop;
  loop.cell = cell;
  loop.number = number;
  loop.samples.size = static_cast<int>(size);
  loop.samples.edge = edge;
  for (std::size_t i = 0; i < size; ++i) {
    loop.root[i] = root(cell, edge[i]);
    loop.vertex[i] = vertex(cell, edge[i]);
    loop.samples.point[i] = point_in_cell(edge[i], field.roots[loop.root[i]]);
  }
  return loop;
}

void LeafEdges::collect(const BrickBand& band, const LeafMasks& m) {
  pairs_.clear();
  moving_ = false;
  for (int d = 0; d < 8; ++d) {
    const Int3 p = {m.at[0] + (d & 1), m.at[1] + (d >> 1 & 1), m.at[2] + (d >> 2)};
    const LeafMasks* n = band.at(p[0], p[1], p[2]);
    if (!n) continue;
    moving_ = moving_ || n->leaf->any_moving;
    std::uint64_t window = ~std::uint64_t{0};
    if (d & 1) window &= 0x0101010101010101ULL;
    if (d & 2) window &= 0xff;
    if (m.at[0] < 0 && !(d & 1)) window &= 0x8080808080808080ULL;  // of the halo, only the cells at the brick
    if (m.at[1] < 0 && !(d & 2)) window &= 0xff00000000000000ULL;
    const std::size_t first_z = m.at[2] < 0 && !(d & 4) ? 7 : 0;
    const std::size_t last_z = d & 4 ? 0 : 7;
    const std::size_t base = static_cast<std::size_t>(8 * (d & 1) + 72 * (d >> 1 & 1) + 648 * (d >> 2));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (d >> axis & 1) continue;  // starts beyond the leaf's cells
      for (std::size_t z = first_z; z <= last_z; ++z) {
        const std::uint64_t crossing = n->leaf->crossing[axis][z];
        const std::uint64_t edges = n->edges[axis][z];
        const std::uint64_t split = n->split[axis][z];
        for (std::uint64_t left = crossing & window; left; left &= left - 1) {
          const std::uint64_t bit = left & (~left + 1);
          const auto b = static_cast<std::size_t>(std::countr_zero(left));
          const std::size_t at = axis * kNodes + base + 81 * z + 9 * (b >> 3) + (b & 7);
          root_[at] =
              n->leaf->first_root[axis][z] + static_cast<std::uint32_t>(std::popcount(crossing & (bit - 1)));
          if (!(edges & bit)) {
            vertex_[at] = kNone;
            continue;
          }
          const std::uint32_t vertex =
              n->first_vertex[axis][z] + static_cast<std::uint32_t>(std::popcount(edges & (bit - 1)));
          const std::uint32_t whose = n->own() ? 0 : kForeignVertex;
          if (split & bit) {
            vertex_[at] = kSplitVertex | static_cast<std::uint32_t>(pairs_.size());
            const std::uint32_t second =
                n->first_split[axis][z] + static_cast<std::uint32_t>(std::popcount(split & (bit - 1)));
            pairs_.push_back({vertex | whose, second | whose});
          } else {
            vertex_[at] = vertex | whose;
          }
        }
      }
    }
  }
}

}  // namespace tessera
