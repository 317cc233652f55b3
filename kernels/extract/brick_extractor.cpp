#include "kernels/extract/brick_extractor.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <span>

namespace tessera {
namespace {

constexpr std::uint32_t kNoVertex = 0xffffffffu;
/// Half the way between two vertices of one root, cells.
constexpr float kApart = 1.0f / 128;

/// Position of a cell's edge in the arrays of local edges, relative to the cell's node.
constexpr std::array<std::uint16_t, kCellEdges> make_edge_slots() {
  std::array<std::uint16_t, kCellEdges> slots{};
  for (int e = 0; e < kCellEdges; ++e) {
    slots[static_cast<std::size_t>(e)] = static_cast<std::uint16_t>(
        (e >> 2) * 729 + edge_offset(e, 0) + 9 * edge_offset(e, 1) + 81 * edge_offset(e, 2));
  }
  return slots;
}
constexpr std::array<std::uint16_t, kCellEdges> kEdgeSlot = make_edge_slots();

/// Node of each edge relative to the cell's, with 0 in place of the root's t along the edge.
constexpr std::array<Float3, kCellEdges> make_edge_bases() {
  std::array<Float3, kCellEdges> bases{};
  for (int e = 0; e < kCellEdges; ++e)
    for (int a = 0; a < 3; ++a)
      bases[static_cast<std::size_t>(e)][static_cast<std::size_t>(a)] = static_cast<float>(edge_offset(e, a));
  return bases;
}
constexpr std::array<Float3, kCellEdges> kEdgeBase = make_edge_bases();

Float3 mean_of(const LoopSamples& loop) {
  Float3 mean = {0, 0, 0};
  const auto size = static_cast<std::size_t>(loop.size);
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < size; ++i) mean[k] += loop.point[i][k];
    mean[k] /= static_cast<float>(size);
  }
  return mean;
}

}  // namespace

BrickExtractor::BrickExtractor(const DirectedField& field, const ExtractOptions& options, int level,
                               const LevelCells* cells)
    : field_(field),
      method_(options.method),
      names_(options.names),
      level_(level),
      levels_(cells),
      thresholds_(feature_thresholds(options.feature_angle_deg, options.corner_angle_deg)),
      border_(field, band_) {
  thresholds_.exact = field.creased.empty();
  thresholds_.in_faces = options.in_faces;
}

VertexKey BrickExtractor::key(const Int3& at, int type) const {
  Int3 global;
  for (std::size_t a = 0; a < 3; ++a) {
    global[a] = (corner_[a] + at[a]) * (1 << level_);
    assert(global[a] >= 0 && global[a] < 1 << kMaxCellBits);
  }
  return make_vertex_key(static_cast<std::uint32_t>(global[0]), static_cast<std::uint32_t>(global[1]),
                         static_cast<std::uint32_t>(global[2]), static_cast<std::uint32_t>(type));
}

Float3 BrickExtractor::point_in_cell(int edge, std::uint32_t root) const {
  Float3 p = kEdgeBase[static_cast<std::size_t>(edge)];
  const EdgeRoot& r = field_.roots[root];
  p[static_cast<std::size_t>(edge >> 2)] = r.t;
  return p + r.slide_offset();
}

Patch BrickExtractor::extract(const Int3& brick, ExtractReport& report) {
  report_ = &report;
  patch_ = Patch{};
  patch_.level = level_;
  any_alpha_ = 0;
  Int3 in_block;
  for (std::size_t a = 0; a < 3; ++a) {
    in_block[a] = brick[a] * kBrickCells;
    corner_[a] = field_.origin[a] + in_block[a];
    patch_.brick[a] = corner_[a] >> kBrickBits;
  }
  const bool extended = method_ == ExtractMethod::kExtendedMarchingCubes;
  band_.collect(field_, in_block, extended);
  border_.start(in_block);
  features_.clear();
  feature_edge_.clear();
  feature_vertex_.clear();
  feature_root_.clear();
  first_feature_.assign(extended ? band_.active_cells() : 0, -1);
  foreign_finer_.clear();
  finer_slot_.clear();

  emit_edge_vertices();
  patch_.faces.reserve(2 * std::size_t{band_.own_edge_vertices()});
  for (const LeafMasks& m : band_.leaves())
    if (m.any_active || (levels_ && m.own())) trace_leaf(m);
  if (extended) emit_feature_segments();
  if (!patch_.synthetic.empty()) patch_.synthetic.resize(patch_.faces.size(), 0);
  if (!patch_.border.empty()) patch_.border.resize(patch_.faces.size(), 0);
  resolve_foreign();
  std::sort(patch_.exported.begin(), patch_.exported.end());
  std::sort(patch_.safe.begin(), patch_.safe.end(),
            [](const SafeVertex& a, const SafeVertex& b) { return a.vertex < b.vertex; });
  if ((any_alpha_ >> 24) == 0) patch_.rgba.clear();
  return std::move(patch_);
}

/// Own points in the order of their numbers, the names under which other bricks know them, and the keys of
/// the points on the max faces.
void BrickExtractor::emit_edge_vertices() {
  const std::size_t own = band_.own_edge_vertices();
  patch_.position.resize(own);
  patch_.rgba.resize(own);
  patch_.vertex_class.resize(own);
  foreign_key_.resize(band_.foreign_edge_vertices());
  if (names_) {
    patch_.name.resize(own);
    foreign_position_.resize(foreign_key_.size());
    foreign_rgba_.resize(foreign_key_.size());
    foreign_class_.resize(foreign_key_.size());
  }
  for (const LeafMasks& m : band_.leaves()) {
    const bool is_own = m.own();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
      const int type = static_cast<int>(axis);
      for (std::size_t z = 0; z < 8; ++z) {
        std::uint32_t vertex = m.first_vertex[axis][z];
        std::uint32_t split = m.first_split[axis][z];
        for (std::uint64_t left = m.edges[axis][z]; left; left &= left - 1, ++vertex) {
          const std::uint64_t bit = left & (~left + 1);
          const int b = std::countr_zero(left);
          const Int3 node = {m.at[0] * 8 + (b & 7), m.at[1] * 8 + (b >> 3),
                             m.at[2] * 8 + static_cast<int>(z)};
          const bool is_split = (m.split[axis][z] & bit) != 0;
          const std::uint32_t second = is_split ? split++ : vertex;
          if (!is_own) {
            foreign_key_[second] = key(node, type + 3);
            foreign_key_[vertex] = key(node, type);
            if (!names_) continue;
          }
          const std::uint64_t below = m.leaf->crossing[axis][z] & (bit - 1);
          const std::uint32_t index =
              m.leaf->first_root[axis][z] + static_cast<std::uint32_t>(std::popcount(below));
          const EdgeRoot& root = field_.roots[index];
          Float3 p = in_owner(node);
          p[axis] += root.t;
          p = p + root.slide_offset();
          const Float3 shift =
              (m.leaf->moving[axis][z] & bit) ? border_.of_vertex(node, axis, index) : Float3{0, 0, 0};
          const VertexClass kind = (m.border[axis][z] & bit) ? VertexClass::kBorder : VertexClass::kSmooth;
          const std::array<std::uint32_t, 2> both = {vertex, second};
          for (const std::uint32_t each : std::span(both).first(is_split ? 2 : 1)) {
            // Of two at one place each leans to its cells, or their faces would touch.
            Float3 at = p;
            if (is_split) at[v] += each == second ? kApart : -kApart;
            const Float3 to = at + shift;
            if (!is_own) {
              foreign_position_[each] = to;
              foreign_rgba_[each] = root.rgba;
              foreign_class_[each] = kind;
              continue;
            }
            if (to != at && (patch_.safe.empty() || patch_.safe.back().vertex != each))
              patch_.safe.push_back({each, at});
            patch_.position[each] = to;
            patch_.rgba[each] = root.rgba;
            patch_.vertex_class[each] = kind;
          }
          if (!is_own) continue;
          any_alpha_ |= root.rgba;
          if (names_) {
            patch_.name[second] = key(node, type + 3);
            patch_.name[vertex] = key(node, type);
          }
          if (node[u] != 0 && node[v] != 0) continue;
          patch_.exported.emplace_back(key(node, type), vertex);
          if (is_split) patch_.exported.emplace_back(key(node, type + 3), second);
        }
      }
    }
  }
}

/// Spreads the numbers of the points and roots around a leaf into 9^3 arrays, so that cells find theirs by a
/// load.
void BrickExtractor::fill_local_edges(const LeafMasks& m) {
  split_pairs_.clear();
  at_border_ = false;
  for (int d = 0; d < 8; ++d) {
    const Int3 p = {m.at[0] + (d & 1), m.at[1] + (d >> 1 & 1), m.at[2] + (d >> 2)};
    const LeafMasks* n = band_.at(p[0], p[1], p[2]);
    if (!n) continue;
    at_border_ = at_border_ || n->leaf->any_moving;
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
          const std::size_t at = axis * kLocalNodes + base + 81 * z + 9 * (b >> 3) + (b & 7);
          local_root_[at] =
              n->leaf->first_root[axis][z] + static_cast<std::uint32_t>(std::popcount(crossing & (bit - 1)));
          if (!(edges & bit)) {
            local_vertex_[at] = kNoVertex;
            continue;
          }
          const std::uint32_t vertex =
              n->first_vertex[axis][z] + static_cast<std::uint32_t>(std::popcount(edges & (bit - 1)));
          const std::uint32_t whose = n->own() ? 0 : kForeignVertex;
          if (split & bit) {
            local_vertex_[at] = kSplitVertex | static_cast<std::uint32_t>(split_pairs_.size());
            const std::uint32_t second =
                n->first_split[axis][z] + static_cast<std::uint32_t>(std::popcount(split & (bit - 1)));
            split_pairs_.push_back({vertex | whose, second | whose});
          } else {
            local_vertex_[at] = vertex | whose;
          }
        }
      }
    }
  }
}

void BrickExtractor::trace_leaf(const LeafMasks& m) {
  fill_local_edges(m);
  const auto inside = band_.corner_words(m, &LeafMasks::inside);
  const LeafWords boundary = names_ && m.own() ? band_.boundary_cells(m) : LeafWords{};
  for (std::size_t z = 0; z < 8; ++z) {
    for (std::uint64_t left = m.active[z]; left; left &= left - 1) {
      const int b = std::countr_zero(left);
      unsigned pattern = 0;
      for (std::size_t c = 0; c < 8; ++c)
        pattern |= static_cast<unsigned>(inside[z + (c >> 2)][c & 3] >> b & 1) << c;
      trace_cell(m, b & 7, b >> 3, static_cast<int>(z), pattern, (boundary[z] >> b & 1) != 0);
    }
  }
  if (levels_ && m.own()) trace_level_cells(m);
}

void BrickExtractor::trace_cell(const LeafMasks& m, int x, int y, int z, unsigned pattern, bool at_boundary) {
  const Int3 cell = {m.at[0] * 8 + x, m.at[1] * 8 + y, m.at[2] * 8 + z};
  const bool own = inside_brick(cell);
  const auto is_of = [&](const LeafWords& cells) {
    return (cells[static_cast<std::size_t>(z)] >> (x + 8 * y) & 1) != 0;
  };
  const bool closing = is_of(m.leaf->closing);
  const std::size_t faces_before = patch_.faces.size();
  CellLoops traced;
  const CellLoops* loops = &unambiguous_loops(pattern);
  if (ambiguous_faces(pattern)) {
    std::array<float, 8> value;
    for (int c = 0; c < 8; ++c) {
      const Int3 n = {x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)};
      const BandLeaf& l =
          *band_.at(m.at[0] + (n[0] >> 3), m.at[1] + (n[1] >> 3), m.at[2] + (n[2] >> 3))->leaf;
      value[static_cast<std::size_t>(c)] = l.value(BandLeaf::node(n[0], n[1], n[2]));
    }
    traced = trace_loops(pattern, joined_faces(pattern, value));
    loops = &traced;
  }
  const std::size_t node = static_cast<std::size_t>(x + 9 * y + 81 * z);
  std::size_t first = 0;
  for (int number = 0; number < loops->count; ++number) {
    const std::uint8_t* edge = &loops->edge[first];
    const std::size_t size = loops->length[static_cast<std::size_t>(number)];
    first += size;
    std::array<std::uint32_t, kCellEdges> vertex, root;
    samples_.size = static_cast<int>(size);
    samples_.edge = edge;
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t e = edge[i];
      const std::size_t at = node + kEdgeSlot[e];
      root[i] = local_root_[at];
      vertex[i] = local_vertex_[at];
      if (vertex[i] != kNoVertex && (vertex[i] & (kForeignVertex | kSplitVertex)) == kSplitVertex)
        vertex[i] =
            split_pairs_[vertex[i] & ~kSplitVertex][e >> 1 & 1 ? 0 : 1];  // offset 1 along v: cell A or B
      samples_.point[i] = point_in_cell(static_cast<int>(e), root[i]);
    }
    if (own) ++report_->loops;
    // Beside a border that cuts cells there are no features: their samples would lie beyond it.
    const bool cut = at_border_ && border_.triangulate(edge, root.data(), size, triangles_);
    if (cut) {
      if (own)
        emit_plain_loop(cell, number, vertex.data(), root.data(), at_boundary ? boundary_segments(cell) : 0);
      continue;
    }
    if (method_ == ExtractMethod::kExtendedMarchingCubes && !closing &&
        keep_feature_loop(cell, number, vertex.data(), root.data())) {
      std::int32_t& first_of_cell = first_feature_[m.cell_rank(x, y, z)];
      if (first_of_cell < 0) first_of_cell = static_cast<std::int32_t>(features_.size() - 1);
    } else if (own) {
      triangulate_loop(samples_, triangles_);
      emit_plain_loop(cell, number, vertex.data(), root.data(), at_boundary ? boundary_segments(cell) : 0);
    }
  }
  if ((!closing && !is_of(m.leaf->unseen)) || patch_.faces.size() == faces_before) return;
  patch_.synthetic.resize(faces_before, 0);
  patch_.synthetic.resize(patch_.faces.size(), 1);
}

void BrickExtractor::emit_plain_loop(const Int3& cell, int number, const std::uint32_t* vertex,
                                     const std::uint32_t* root, unsigned boundary) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(triangles_.count); ++i) {
    const auto& t = triangles_.triangle[i];
    unsigned border = 0;
    for (std::size_t e = 0; boundary != 0 && e < 3; ++e)
      if (t[(e + 1) % 3] == (t[e] + 1) % samples_.size) border |= (boundary >> t[e] & 1u) << e;
    add_face(vertex[t[0]], vertex[t[1]], vertex[t[2]], border);
  }
  if (triangles_.count > 0) return;
  const std::uint32_t centre =
      add_centre(cell, number, mean_of(samples_), VertexClass::kSmooth, root, samples_.size);
  const auto size = static_cast<std::size_t>(samples_.size);
  for (std::size_t i = 0; i < size; ++i)
    add_face(vertex[i], vertex[i + 1 == size ? 0 : i + 1], centre, boundary >> i & 1u);
}

/// Bit i: the surface ends at the segment from point i of the loop at work to the next.
unsigned BrickExtractor::boundary_segments(const Int3& cell) const {
  unsigned boundary = 0;
  const auto size = static_cast<std::size_t>(samples_.size);
  for (std::size_t i = 0; i < size; ++i) {
    const int face = common_face(samples_.edge[i], samples_.edge[i + 1 == size ? 0 : i + 1]);
    Int3 across = cell;
    across[static_cast<std::size_t>(face >> 1)] += face & 1 ? 1 : -1;
    if (!band_.takes_part(across)) boundary |= 1u << i;
  }
  return boundary;
}

bool BrickExtractor::keep_feature_loop(const Int3& cell, int number, const std::uint32_t* vertex,
                                       const std::uint32_t* root) {
  const auto size = static_cast<std::size_t>(samples_.size);
  bool close = true;  // the common case, without copying anything
  for (std::size_t i = 1; i < size; ++i)
    close &= dot(field_.roots[root[0]].normal, field_.roots[root[i]].normal) > thresholds_.quick_dot;
  if (close) return false;
  if (!field_.creased.empty() &&
      std::none_of(root, root + size, [this](std::uint32_t r) { return field_.creased[r] != 0; }))
    return false;
  for (std::size_t i = 0; i < size; ++i) {
    const EdgeRoot& r = field_.roots[root[i]];
    samples_.normal[i] = r.normal;
    samples_.offset[i] = r.slides ? 0.0f : r.offset;
  }
  const FeatureSample sample = sample_feature(samples_, thresholds_);
  if (sample.kind == FeatureKind::kNone) return false;
  const bool own = inside_brick(cell);
  if (sample.kind == FeatureKind::kRejected) {
    if (own) ++report_->rejected_samples;
    return false;
  }
  const bool corner = sample.kind == FeatureKind::kCorner;
  if (own) ++(corner ? report_->corner_samples : report_->crease_samples);
  FeatureLoop loop;
  loop.cell = cell;
  loop.number = static_cast<std::uint8_t>(number);
  loop.size = static_cast<std::uint8_t>(size);
  loop.first = static_cast<std::uint32_t>(feature_edge_.size());
  loop.position = sample.position;
  const VertexClass kind = !sample.on_feature ? VertexClass::kSmooth
                           : corner           ? VertexClass::kCorner
                                              : VertexClass::kCrease;
  loop.centre = add_centre(cell, number, sample.position, kind, root, samples_.size);
  if (own) patch_.safe.push_back({loop.centre, in_owner(cell) + mean_of(samples_)});
  if (own && (cell[0] == kBrickCells - 1 || cell[1] == kBrickCells - 1 || cell[2] == kBrickCells - 1))
    patch_.exported.emplace_back(key(cell, 6 + number), loop.centre);
  feature_edge_.insert(feature_edge_.end(), samples_.edge, samples_.edge + size);
  feature_vertex_.insert(feature_vertex_.end(), vertex, vertex + size);
  feature_root_.insert(feature_root_.end(), root, root + size);
  features_.push_back(loop);
  return true;
}

std::uint32_t BrickExtractor::add_centre(const Int3& cell, int number, const Float3& position,
                                         VertexClass kind, const std::uint32_t* root, int size) {
  const bool own = inside_brick(cell);
  if (!own) {
    foreign_key_.push_back(key(cell, 6 + number));
    if (!names_) return static_cast<std::uint32_t>(foreign_key_.size() - 1) | kForeignVertex;
  }
  Float3 p = in_owner(cell);
  for (std::size_t a = 0; a < 3; ++a) p[a] += position[a];
  ColourMean colour;
  for (int i = 0; i < size; ++i) colour.add(field_.roots[root[i]].rgba);
  if (!own) {
    foreign_position_.push_back(p);
    foreign_rgba_.push_back(colour.value());
    foreign_class_.push_back(kind);
    return static_cast<std::uint32_t>(foreign_key_.size() - 1) | kForeignVertex;
  }
  if (names_) patch_.name.push_back(key(cell, 6 + number));
  patch_.position.push_back(p);
  patch_.rgba.push_back(colour.value());
  patch_.vertex_class.push_back(kind);
  return static_cast<std::uint32_t>(patch_.position.size() - 1);
}

/// Lists the vertices of other bricks that faces name, and gives the faces their final indices.
void BrickExtractor::resolve_foreign() {
  std::vector<std::uint32_t> faces;
  std::vector<std::pair<VertexKey, std::uint32_t>> named;
  std::vector<std::uint32_t> rank(foreign_key_.size(), kNoVertex);
  for (std::size_t f = 0; f < patch_.faces.size(); ++f) {
    const PatchFace& face = patch_.faces[f];
    if (!((face[0] | face[1] | face[2]) & kForeignVertex)) continue;
    faces.push_back(static_cast<std::uint32_t>(f));
    for (const std::uint32_t v : face) {
      if (!(v & kForeignVertex)) continue;
      const std::uint32_t slot = v & ~kForeignVertex;
      assert(slot < rank.size());
      if (rank[slot] != kNoVertex) continue;
      rank[slot] = 0;
      named.emplace_back(foreign_key_[slot], slot);
    }
  }
  std::sort(named.begin(), named.end());
  const auto own = static_cast<std::uint32_t>(patch_.position.size());
  for (std::size_t i = 0; i < named.size(); ++i) {
    patch_.foreign.push_back(named[i].first);
    if (levels_) {
      const std::uint32_t slot = named[i].second;
      patch_.foreign_finer.push_back(slot < foreign_finer_.size() ? foreign_finer_[slot] : std::uint8_t{0});
    }
    if (names_) {
      patch_.foreign_position.push_back(foreign_position_[named[i].second]);
      patch_.foreign_rgba.push_back(foreign_rgba_[named[i].second]);
      patch_.foreign_class.push_back(foreign_class_[named[i].second]);
    }
    rank[named[i].second] = own + static_cast<std::uint32_t>(i);
  }
  for (const std::uint32_t f : faces)
    for (std::uint32_t& v : patch_.faces[f])
      if (v & kForeignVertex) v = rank[v & ~kForeignVertex];
}

}  // namespace tessera
