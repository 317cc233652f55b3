#include "kernels/blends/blend_hole.h"

#include <algorithm>
#include <unordered_map>

namespace tessera {
namespace {

std::uint64_t half_edge(std::uint32_t from, std::uint32_t to) {
  return std::uint64_t{from} << 32 | to;
}

}  // namespace

bool meets_rectangle(const std::array<Double2, 3>& t, double left, double width, double height) {
  const Double2 low = {left, -height}, high = {width, height};
  for (std::size_t c = 0; c < 2; ++c) {
    const auto [a, b] = std::minmax({t[0][c], t[1][c], t[2][c]});
    if (b < low[c] || a > high[c]) return false;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const Double2 &p = t[k], &q = t[(k + 1) % 3], &r = t[(k + 2) % 3];
    const Double2 n = {q[1] - p[1], p[0] - q[0]};
    const double at = n[0] * p[0] + n[1] * p[1], third = n[0] * r[0] + n[1] * r[1] - at;
    double minimum = 0.0, maximum = 0.0;
    for (int c = 0; c < 4; ++c) {
      const double d = n[0] * (c & 1 ? high[0] : low[0]) + n[1] * (c & 2 ? high[1] : low[1]) - at;
      minimum = c == 0 ? d : std::min(minimum, d), maximum = c == 0 ? d : std::max(maximum, d);
    }
    if (maximum < std::min(0.0, third) || minimum > std::max(0.0, third)) return false;
  }
  return true;
}

std::uint32_t face_across(const MeshBlock& block, const FaceCorners& corners, std::size_t f, std::size_t k) {
  const std::uint32_t a = block.faces[f][k], b = block.faces[f][(k + 1) % 3];
  for (const std::uint32_t c : corners.at(b))
    if (block.faces[c >> 2][((c & 3) + 1) % 3] == a) return c >> 2;
  return kNoFaceAcross;
}

void keep_largest_piece(const MeshBlock& block, const FaceCorners& corners,
                        std::vector<std::uint8_t>& removed) {
  const std::size_t n = removed.size();
  std::vector<std::uint32_t> piece(n, kNoFaceAcross), stack, size;
  for (std::uint32_t start = 0; start < n; ++start) {
    if (!removed[start] || piece[start] != kNoFaceAcross) continue;
    const auto number = static_cast<std::uint32_t>(size.size());
    size.push_back(0);
    stack.assign(1, start);
    piece[start] = number;
    while (!stack.empty()) {
      const std::uint32_t f = stack.back();
      stack.pop_back();
      ++size[number];
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t g = face_across(block, corners, f, k);
        if (g == kNoFaceAcross || !removed[g] || piece[g] != kNoFaceAcross) continue;
        piece[g] = number;
        stack.push_back(g);
      }
    }
  }
  if (size.empty()) return;
  const auto largest = static_cast<std::uint32_t>(std::max_element(size.begin(), size.end()) - size.begin());
  for (std::size_t f = 0; f < n; ++f) removed[f] = piece[f] == largest;
  for (std::size_t f = 0; f < n; ++f) {
    if (removed[f]) continue;
    bool inside = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t g = face_across(block, corners, f, k);
      inside = inside && g != kNoFaceAcross && piece[g] == largest;
    }
    if (inside) removed[f] = 1;
  }
}

std::vector<std::uint32_t> loose_vertices(std::span<const std::array<std::uint32_t, 3>> faces,
                                          std::span<const std::uint8_t> open, std::size_t vertices) {
  std::unordered_map<std::uint64_t, std::uint32_t> half;
  std::vector<std::uint32_t> star(vertices, 0), any(vertices, 0), out;
  std::vector<std::uint8_t> at_open(vertices, 0);
  for (std::uint32_t f = 0; f < faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = faces[f][k], next = faces[f][(k + 1) % 3];
      if (!half.emplace(half_edge(v, next), f).second) out.push_back(v);
      ++star[v];
      any[v] = f;
      if (open[f] >> k & 1) at_open[v] = at_open[next] = 1;
    }
  for (std::uint32_t f = 0; f < faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k)
      if (!(open[f] >> k & 1) && half.count(half_edge(faces[f][(k + 1) % 3], faces[f][k])) == 0)
        out.push_back(faces[f][k]);
  if (!out.empty()) return out;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    if (star[v] == 0 || at_open[v]) continue;
    std::uint32_t f = any[v], count = 0;
    do {
      const auto& t = faces[f];
      const std::size_t k = t[0] == v ? 0 : t[1] == v ? 1 : 2;
      f = half.at(half_edge(v, t[(k + 2) % 3]));
    } while (++count <= star[v] && f != any[v]);
    if (count != star[v]) out.push_back(v);
  }
  return out;
}

}  // namespace tessera
