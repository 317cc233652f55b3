#include "kernels/mesh/mesh_block_ops.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "octree/lists.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoFace = 0xffffffffu;

using FaceCorners = std::array<std::uint32_t, 3>;

/// Turns the smallest index first; bits of borders and creases belong to edges and turn along.
void rotate_corners(FaceCorners& f, std::uint8_t& flags) {
  constexpr unsigned kFirst = kFaceBorder01 | kFaceCrease01, kSecond = kFaceBorder12 | kFaceCrease12,
                     kThird = kFaceBorder20 | kFaceCrease20;
  const unsigned rest = flags & ~(kFirst | kSecond | kThird);
  if (f[1] < f[0] && f[1] < f[2]) {
    f = {f[1], f[2], f[0]};
    flags = static_cast<std::uint8_t>(rest | (flags & (kSecond | kThird)) >> 1 | (flags & kFirst) << 2);
  } else if (f[2] < f[0] && f[2] < f[1]) {
    f = {f[2], f[0], f[1]};
    flags = static_cast<std::uint8_t>(rest | (flags & (kFirst | kSecond)) << 1 | (flags & kThird) >> 2);
  }
}

/// Sorts what consists of ascending runs, as lists of keys of neighbouring patches do: runs are merged pair by pair,
/// each time only where they overlap.
template <class Value>
void sort_runs(std::vector<Value>& values) {
  std::vector<std::size_t> bounds = {0};
  for (std::size_t i = 1; i < values.size(); ++i)
    if (values[i] < values[i - 1]) bounds.push_back(i);
  bounds.push_back(values.size());
  const auto at = [&](std::size_t i) { return values.begin() + static_cast<std::ptrdiff_t>(i); };
  while (bounds.size() > 2) {
    std::vector<std::size_t> next = {0};
    for (std::size_t k = 0; k + 2 < bounds.size(); k += 2) {
      const auto middle = at(bounds[k + 1]);
      const auto low = std::upper_bound(at(bounds[k]), middle, *middle);
      const auto high = std::lower_bound(middle, at(bounds[k + 2]), *(middle - 1));
      if (low != middle && high != middle) std::inplace_merge(low, middle, high);
      next.push_back(bounds[k + 2]);
    }
    if (bounds.size() % 2 == 0) next.push_back(bounds.back());
    bounds.swap(next);
  }
}

/// By key(value): lists that are short as a rule, though a hub's may have millions.
template <class Value, class Key>
void sort_few(std::span<Value> values, const Key& key) {
  constexpr std::size_t kFew = 24;
  if (values.size() > kFew) {
    std::sort(values.begin(), values.end(), [&](Value a, Value b) { return key(a) < key(b); });
    return;
  }
  std::array<std::uint64_t, kFew> keys;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Value value = values[i];
    const std::uint64_t of_value = key(value);
    std::size_t j = i;
    for (; j > 0 && of_value < keys[j - 1]; --j) values[j] = values[j - 1], keys[j] = keys[j - 1];
    values[j] = value, keys[j] = of_value;
  }
}

/// Ascending faces: a counting sort by first corner, then the few of each first corner.
void sort_faces(MeshBlock& block, std::vector<std::uint8_t>* tag) {
  const std::size_t m = block.faces.size();
  if (std::is_sorted(block.faces.begin(), block.faces.end())) return;
  Lists<std::uint32_t> by_first = make_lists<std::uint32_t>(block.key.size(), [&](const auto& put) {
    for (std::uint32_t i = 0; i < m; ++i) put(block.faces[i][0], i);
  });
  const auto others = [&](std::uint32_t f) {
    return std::uint64_t{block.faces[f][1]} << 32 | block.faces[f][2];
  };
  for (std::size_t v = 0; v < by_first.size(); ++v) sort_few(by_first[v], others);
  const auto permute = [&](auto& values) {
    std::remove_reference_t<decltype(values)> sorted(m);
    for (std::size_t i = 0; i < m; ++i) sorted[i] = values[by_first.item[i]];
    values = std::move(sorted);
  };
  permute(block.faces);
  permute(block.face_flags);
  if (!block.face_bound.empty()) permute(block.face_bound);
  if (tag) permute(*tag);
}

/// Vertices `from` (indices of `in`) to the end of `out`.
void append_vertices(const MeshBlock& in, std::span<const std::uint32_t> from, MeshBlock& out) {
  const auto take = [&](const auto& values, auto& to) {
    if (values.empty()) return;
    to.reserve(to.size() + from.size());
    for (const std::uint32_t v : from) to.push_back(values[v]);
  };
  take(in.key, out.key);
  take(in.position, out.position);
  take(in.vertex_class, out.vertex_class);
  take(in.rgba, out.rgba);
}

/// `faces` (indices of `in`) with the vertices that they use, in the order of `in`. `local` holds kNoFace for
/// every vertex of `in`, before and after.
MeshBlock gather(const MeshBlock& in, std::span<const std::uint32_t> faces,
                 std::vector<std::uint32_t>& local) {
  std::vector<std::uint32_t> used;
  for (const std::uint32_t f : faces) {
    for (const std::uint32_t v : in.faces[f]) {
      if (local[v] != kNoFace) continue;
      local[v] = 0;
      used.push_back(v);
    }
  }
  constexpr std::size_t kSweep = 16;  // vertices passed in the time that one takes to sort
  if (used.size() * kSweep > local.size()) {
    std::size_t count = 0;
    for (std::uint32_t v = 0; v < local.size(); ++v)
      if (local[v] != kNoFace) used[count++] = v;
  } else {
    std::sort(used.begin(), used.end());
  }
  for (std::uint32_t i = 0; i < used.size(); ++i) local[used[i]] = i;
  MeshBlock out;
  append_vertices(in, used, out);
  out.faces.reserve(faces.size());
  out.face_flags.reserve(faces.size());
  for (const std::uint32_t f : faces) {
    const FaceCorners& c = in.faces[f];
    out.faces.push_back({local[c[0]], local[c[1]], local[c[2]]});
    out.face_flags.push_back(in.face_flags[f]);
  }
  if (!in.face_bound.empty()) {
    out.face_bound.reserve(faces.size());
    for (const std::uint32_t f : faces) out.face_bound.push_back(in.face_bound[f]);
  }
  for (const std::uint32_t v : used) local[v] = kNoFace;
  return out;
}

}  // namespace

void canonicalise(MeshBlock& block, std::vector<std::uint8_t>* tag) {
  const std::size_t n = block.key.size();
  std::vector<std::uint32_t> local(n, kNoFace);
  for (const FaceCorners& f : block.faces)
    for (const std::uint32_t v : f) local[v] = 0;
  std::vector<std::uint32_t> order;
  order.reserve(n);
  for (std::uint32_t v = 0; v < n; ++v)
    if (local[v] == 0) order.push_back(v);
  const auto by_key = [&](std::uint32_t a, std::uint32_t b) { return block.key[a] < block.key[b]; };
  const bool in_order = std::is_sorted(order.begin(), order.end(), by_key);
  if (!in_order) std::sort(order.begin(), order.end(), by_key);
  if (!in_order || order.size() < n) {
    for (std::uint32_t i = 0; i < order.size(); ++i) local[order[i]] = i;
    MeshBlock sorted;
    append_vertices(block, order, sorted);
    sorted.faces = std::move(block.faces);
    sorted.face_flags = std::move(block.face_flags);
    sorted.face_bound = std::move(block.face_bound);
    block = std::move(sorted);
    for (FaceCorners& f : block.faces)
      for (std::uint32_t& v : f) v = local[v];
  }
  for (std::size_t f = 0; f < block.faces.size(); ++f) rotate_corners(block.faces[f], block.face_flags[f]);
  sort_faces(block, tag);
}

MeshBlock select_faces(const MeshBlock& block, std::span<const std::uint8_t> keep) {
  std::vector<std::uint32_t> faces;
  for (std::uint32_t f = 0; f < keep.size(); ++f)
    if (keep[f]) faces.push_back(f);
  std::vector<std::uint32_t> local(block.key.size(), kNoFace);
  return gather(block, faces, local);
}

MeshBlock merge_blocks(std::span<const MeshBlock* const> pieces, std::span<const std::uint8_t> tags,
                       std::vector<std::uint8_t>* tag_of_face, std::vector<std::uint32_t>* slot) {
  std::size_t vertices = 0;
  std::size_t faces = 0;
  for (const MeshBlock* piece : pieces) {
    vertices += piece->key.size();
    faces += piece->faces.size();
  }
  // All vertices one after the other, then equal keys become one.
  MeshBlock all;
  const auto append = [](const auto& from, auto& to) { to.insert(to.end(), from.begin(), from.end()); };
  all.key.reserve(vertices);
  all.position.reserve(vertices);
  all.vertex_class.reserve(vertices);
  for (const MeshBlock* piece : pieces) {
    append(piece->key, all.key);
    append(piece->position, all.position);
    append(piece->vertex_class, all.vertex_class);
    append(piece->rgba, all.rgba);
  }
  std::vector<std::pair<std::uint64_t, std::uint32_t>> by_key(vertices);
  for (std::uint32_t i = 0; i < vertices; ++i) by_key[i] = {all.key[i], i};
  sort_runs(by_key);
  std::vector<std::uint32_t> target(vertices);
  std::vector<std::uint32_t> kept;
  kept.reserve(vertices);
  for (std::size_t i = 0; i < vertices; ++i) {
    const std::uint32_t v = by_key[i].second;
    if (i == 0 || by_key[i].first != by_key[i - 1].first) {
      kept.push_back(v);
    } else if (all.position[v] != all.position[kept.back()]) {
      throw std::logic_error("mesh blocks: vertex " + std::to_string(all.key[v]) + " has two positions");
    }
    target[v] = static_cast<std::uint32_t>(kept.size() - 1);
  }
  MeshBlock out;
  append_vertices(all, kept, out);
  out.faces.reserve(faces);
  out.face_flags.reserve(faces);
  if (tag_of_face) tag_of_face->clear();
  const bool bounds = std::any_of(pieces.begin(), pieces.end(),
                                  [](const MeshBlock* piece) { return !piece->face_bound.empty(); });
  for (const MeshBlock* piece : pieces) {
    if (!bounds) break;
    append(piece->face_bound, out.face_bound);
    if (piece->face_bound.empty()) out.face_bound.insert(out.face_bound.end(), piece->faces.size(), 0.0f);
  }
  std::size_t first = 0;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const MeshBlock& piece = *pieces[p];
    for (std::size_t f = 0; f < piece.faces.size(); ++f) {
      FaceCorners c = piece.faces[f];
      for (std::uint32_t& v : c) v = target[first + v];
      out.faces.push_back(c);
      out.face_flags.push_back(piece.face_flags[f]);
      if (tag_of_face) tag_of_face->push_back(tags[p]);
    }
    first += piece.key.size();
  }
  for (std::size_t f = 0; f < out.faces.size(); ++f) rotate_corners(out.faces[f], out.face_flags[f]);
  sort_faces(out, tag_of_face);
  if (slot) *slot = std::move(target);
  return out;
}

std::vector<std::uint8_t> complete_stars(const MeshBlock& block) {
  // Of each edge, at its lower vertex and once a face: the other vertex, and below it whether it is a border.
  Lists<std::uint64_t> edges = make_lists<std::uint64_t>(block.key.size(), [&](const auto& put) {
    for (std::size_t f = 0; f < block.faces.size(); ++f) {
      const auto& v = block.faces[f];
      const unsigned borders = block.face_flags[f];
      put(std::min(v[0], v[1]), std::uint64_t{std::max(v[0], v[1])} << 1 | (borders & 1u));
      put(std::min(v[1], v[2]), std::uint64_t{std::max(v[1], v[2])} << 1 | (borders >> 1 & 1u));
      put(std::min(v[2], v[0]), std::uint64_t{std::max(v[2], v[0])} << 1 | (borders >> 2 & 1u));
    }
  });
  std::vector<std::uint8_t> complete(block.key.size(), 1);
  for (std::size_t low = 0; low < edges.size(); ++low) {
    const std::span<std::uint64_t> list = edges[low];
    sort_few(list, [](std::uint64_t edge) { return edge; });
    // Twice without a border, or once with one.
    for (std::size_t i = 0; i < list.size();) {
      const std::uint64_t edge = list[i];
      std::size_t end = i + 1;
      while (end < list.size() && (list[end] ^ edge) <= 1) ++end;
      const bool border = (list[end - 1] & 1u) != 0;
      if (border ? end != i + 1 : end != i + 2) complete[low] = complete[edge >> 1] = 0;
      i = end;
    }
  }
  return complete;
}

void split_faces(const MeshBlock& block, std::span<const std::uint64_t> class_of_face,
                 const std::function<void(std::uint64_t, MeshBlock&&)>& sink) {
  std::vector<std::uint64_t> classes(class_of_face.begin(), class_of_face.end());
  std::sort(classes.begin(), classes.end());
  classes.erase(std::unique(classes.begin(), classes.end()), classes.end());
  std::vector<std::vector<std::uint32_t>> members(classes.size());
  std::size_t last = 0;
  for (std::uint32_t f = 0; f < class_of_face.size(); ++f) {
    if (classes[last] != class_of_face[f])
      last = static_cast<std::size_t>(std::lower_bound(classes.begin(), classes.end(), class_of_face[f]) -
                                      classes.begin());
    members[last].push_back(f);
  }
  std::vector<std::uint32_t> local(block.key.size(), kNoFace);
  for (std::size_t c = 0; c < classes.size(); ++c) sink(classes[c], gather(block, members[c], local));
}

std::uint64_t brick_of_face(const Lattice& lattice, const Double3& a, const Double3& b, const Double3& c) {
  Int3 brick;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double low = a[axis], middle = b[axis], high = c[axis];
    if (middle < low) std::swap(low, middle);
    if (high < middle) std::swap(middle, high);
    if (middle < low) std::swap(low, middle);
    const double centre = (low + middle + high) * (1.0 / 3.0);
    const double cells =
        cell_at(centre, lattice.h * kBrickCells) - static_cast<double>(lattice.origin_brick[axis]);
    constexpr double kLast = (1 << (kMaxCellBits - kBrickBits)) - 1;
    brick[axis] = static_cast<std::int32_t>(std::clamp(cells, 0.0, kLast));
  }
  return brick_key(brick);
}

}  // namespace tessera
