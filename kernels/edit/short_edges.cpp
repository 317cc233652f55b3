#include "kernels/edit/short_edges.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;

Face sorted(Face f) {
  std::sort(f.begin(), f.end());
  return f;
}

/// Two faces with the same corners, whichever way round, enclose nothing.
void drop_back_to_back(std::vector<Face>& faces) {
  std::vector<std::uint32_t> order(faces.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const Face x = sorted(faces[a]), y = sorted(faces[b]);
    return x != y ? x < y : a < b;
  });
  std::vector<std::uint8_t> gone(faces.size(), 0);
  for (std::size_t i = 0; i + 1 < order.size(); ++i)
    if (sorted(faces[order[i]]) == sorted(faces[order[i + 1]])) {
      gone[order[i]] = gone[order[i + 1]] = 1;
      ++i;
    }
  std::size_t kept = 0;
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (!gone[f]) faces[kept++] = faces[f];
  faces.resize(kept);
}

}  // namespace

std::size_t merge_short_edges(std::vector<Double3>& position, std::vector<Face>& faces, double shorter_than,
                              std::vector<Double3>& attached) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> shorts;
  for (const Face& f : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = std::min(f[k], f[(k + 1) % 3]), b = std::max(f[k], f[(k + 1) % 3]);
      if (squared_distance(position[a], position[b]) < shorter_than * shorter_than) shorts.emplace_back(a, b);
    }
  std::sort(shorts.begin(), shorts.end());
  shorts.erase(std::unique(shorts.begin(), shorts.end()), shorts.end());
  std::vector<std::uint32_t> becomes(position.size());
  std::iota(becomes.begin(), becomes.end(), 0u);
  std::vector<std::uint8_t> merged(position.size(), 0);
  std::size_t count = 0;
  for (const auto& [a, b] : shorts) {
    if (merged[a] || merged[b]) continue;
    merged[a] = merged[b] = 1;
    becomes[b] = a;
    ++count;
  }
  if (count == 0) return 0;
  std::size_t kept = 0;
  for (Face f : faces) {
    for (std::uint32_t& v : f) v = becomes[v];
    if (f[0] != f[1] && f[1] != f[2] && f[2] != f[0]) faces[kept++] = f;
  }
  faces.resize(kept);
  drop_back_to_back(faces);
  constexpr std::uint32_t kUnused = 0xffffffffu;
  std::vector<std::uint32_t> number(position.size(), kUnused);
  for (const Face& f : faces)
    for (const std::uint32_t v : f) number[v] = 0;
  std::uint32_t next = 0;
  for (std::size_t v = 0; v < number.size(); ++v)
    if (number[v] != kUnused) {
      position[next] = position[v];
      if (!attached.empty()) attached[next] = attached[v];
      number[v] = next++;
    }
  position.resize(next);
  if (!attached.empty()) attached.resize(next);
  for (Face& f : faces)
    for (std::uint32_t& v : f) v = number[v];
  return count;
}

}  // namespace tessera
