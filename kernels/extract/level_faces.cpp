// Faces of the cells at which finer bricks begin (level_cells.h). They hold no features: every loop is triangulated, or a
// fan around its middle.
#include "kernels/extract/brick_extractor.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoLevelVertex = 0xffffffffu;

}  // namespace

bool BrickExtractor::other_level(const Int3& cell) const {
  return levels_ && levels_->step_of(cell) != 0;
}

void BrickExtractor::trace_level_cells(const LeafMasks& m) {
  for (std::size_t z = 0; z < 8; ++z)
    for (std::uint64_t left = m.cells[z] & m.leaf->quiet[z]; left; left &= left - 1) {
      const int b = std::countr_zero(left);
      const Int3 cell = {m.at[0] * 8 + (b & 7), m.at[1] * 8 + (b >> 3), m.at[2] * 8 + static_cast<int>(z)};
      int number = 0;
      for (const LevelLoop& loop : levels_->trace(cell, band_)) emit_level_loop(cell, number++, loop);
    }
}

/// Provisional index of a vertex that finer bricks own.
std::uint32_t BrickExtractor::finer_vertex(const LevelPoint& point, const LevelCells::Name& name) {
  const Int3 node = levels_->finer_node(point.node);
  Int3 finest;
  for (std::size_t a = 0; a < 3; ++a) finest[a] = node[a] * (1 << (level_ - 1));
  const VertexKey key =
      make_vertex_key(static_cast<std::uint32_t>(finest[0]), static_cast<std::uint32_t>(finest[1]),
                      static_cast<std::uint32_t>(finest[2]), static_cast<std::uint32_t>(name.type));
  const auto [found, is_new] = finer_slot_.emplace(key, static_cast<std::uint32_t>(foreign_key_.size()));
  if (!is_new) return found->second | kForeignVertex;
  foreign_key_.push_back(key);
  foreign_finer_.resize(foreign_key_.size(), 0);
  foreign_finer_.back() = 1;
  if (names_) {
    const EdgeRoot& root = levels_->finer_root(point.node, point.axis);
    Float3 p = in_owner(node);
    p[static_cast<std::size_t>(point.axis)] += root.t;
    foreign_position_.push_back(p + root.slide_offset());
    foreign_rgba_.push_back(root.rgba);
    foreign_class_.push_back(name.border ? VertexClass::kBorder : VertexClass::kSmooth);
  }
  return found->second | kForeignVertex;
}

void BrickExtractor::emit_level_loop(const Int3& cell, int number, const LevelLoop& loop) {
  if (loop.size() < 3) return;
  ++report_->loops;
  std::vector<std::uint32_t> vertex;
  ColourMean colour;
  std::vector<Float3> point;
  for (const LevelPoint& p : loop) {
    if (p.finer) {
      const EdgeRoot& root = levels_->finer_root(p.node, p.axis);
      Float3 at = root.slide_offset();
      at[static_cast<std::size_t>(p.axis)] += root.t;
      for (std::size_t a = 0; a < 3; ++a)
        at[a] = 0.5f * (at[a] + static_cast<float>(p.node[a] - 2 * cell[a]));
      vertex.push_back(finer_vertex(p, levels_->finer_name(p.node, p.axis, cell, band_)));
      point.push_back(at);
      colour.add(root.rgba);
      continue;
    }
    const std::size_t slot = static_cast<std::size_t>(
        (p.edge >> 2) * static_cast<int>(kLocalNodes) + (cell[0] & 7) + edge_offset(p.edge, 0) +
        9 * ((cell[1] & 7) + edge_offset(p.edge, 1)) + 81 * ((cell[2] & 7) + edge_offset(p.edge, 2)));
    std::uint32_t v = local_vertex_[slot];
    if (v != kNoLevelVertex && (v & (kForeignVertex | kSplitVertex)) == kSplitVertex)
      v = split_pairs_[v & ~kSplitVertex][p.edge >> 1 & 1 ? 0 : 1];
    vertex.push_back(v);
    point.push_back(point_in_cell(p.edge, local_root_[slot]));
    colour.add(field_.roots[local_root_[slot]].rgba);
  }
  const std::size_t size = loop.size();
  const auto triangles = triangulate_level_loop(loop, point);
  for (const auto& t : triangles) {
    unsigned border = 0;
    for (std::size_t e = 0; e < 3; ++e)
      if (t[(e + 1) % 3] == (t[e] + 1) % size && loop[t[e]].ends) border |= 1u << e;
    add_face(vertex[t[0]], vertex[t[1]], vertex[t[2]], names_ ? border : 0u);
  }
  if (!triangles.empty()) return;
  Float3 mean = {0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    for (const Float3& p : point) mean[k] += p[k];
    mean[k] /= static_cast<float>(size);
  }
  // More loops than a key has types for: the cell has eight places on the finest lattice.
  const std::uint32_t centre = static_cast<std::uint32_t>(patch_.position.size());
  Float3 p = in_owner(cell);
  for (std::size_t k = 0; k < 3; ++k) p[k] += mean[k];
  patch_.position.push_back(p);
  patch_.rgba.push_back(colour.value());
  patch_.vertex_class.push_back(VertexClass::kSmooth);
  if (names_) {
    const int octant = number >> 2;
    patch_.name.push_back(key(cell, 6 + (number & 3)) +
                          make_vertex_key(static_cast<std::uint32_t>(octant & 1),
                                          static_cast<std::uint32_t>(octant >> 1 & 1),
                                          static_cast<std::uint32_t>(octant >> 2), 0));
  }
  for (std::size_t i = 0; i < size; ++i)
    add_face(vertex[i], vertex[i + 1 == size ? 0 : i + 1], centre, names_ && loop[i].ends ? 1u : 0u);
}

}  // namespace tessera
