#include "kernels/remesh/edge_ratios.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

constexpr std::uint32_t kNewVertex = 0xfffffffeu;  ///< the one that a split would make

}  // namespace

EdgeRatios::EdgeRatios(const CollapseMesh& mesh, std::vector<std::uint8_t> whole, double aimed)
    : mesh_(mesh), whole_(std::move(whole)), aimed_(aimed) {
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) renew(v);
}

void EdgeRatios::renew(std::uint32_t v) {
  if (v >= whole_.size()) whole_.resize(v + 1, 1);
  if (v >= sum_.size()) sum_.resize(v + 1, 0.0), degree_.resize(v + 1, 0.0);
  sum_[v] = degree_[v] = 0.0;
  if (mesh_.state(v) & kVertexDead) return;
  mesh_.for_each_neighbour(v, [&](std::uint32_t w) {
    sum_[v] += norm(mesh_.at(w) - mesh_.at(v));
    degree_[v] += 1.0;
  });
}

double EdgeRatios::ratio(std::uint32_t a, std::uint32_t b) const {
  if (!whole_[a] || !whole_[b]) return 0.0;
  const double x = mean(a), y = mean(b);
  return x > y ? x / y : y / x;
}

/// The place of the vertex among those of the edit.
std::uint32_t EdgeRatios::local(std::uint32_t v) {
  const auto found = std::find(vertex_.begin(), vertex_.end(), v);
  if (found != vertex_.end()) return static_cast<std::uint32_t>(found - vertex_.begin());
  vertex_.push_back(v);
  local_sum_.push_back(v == kNewVertex ? 0.0 : sum_[v]);
  local_degree_.push_back(v == kNewVertex ? 0.0 : degree_[v]);
  return static_cast<std::uint32_t>(vertex_.size() - 1);
}

/// \returns the cost of the edges at these vertices
double EdgeRatios::begin(std::span<const std::uint32_t> changed) {
  vertex_.clear(), local_sum_.clear(), local_degree_.clear(), edges_.clear();
  for (const std::uint32_t v : changed) local(v);
  bool known = true;
  for (std::uint32_t i = 0; i < changed.size(); ++i) {
    known &= whole_[changed[i]] != 0;
    mesh_.for_each_neighbour(changed[i], [&](std::uint32_t w) {
      known &= whole_[w] != 0;
      const std::uint32_t j = local(w);
      if (j >= changed.size() || i < j) edges_.push_back({i, j});
    });
  }
  return known ? cost() : kNoRatio;
}

double EdgeRatios::cost() const {
  double sum = 0.0;
  for (const auto& [i, j] : edges_) {
    // The ratio of the means without a division for each of them.
    const double x = local_sum_[i] * local_degree_[j], y = local_sum_[j] * local_degree_[i];
    const double low = std::min(x, y), high = std::max(x, y);
    if (!(high > aimed_ * low)) continue;
    const double over = high / low - aimed_;
    sum += over * over;
  }
  return sum;
}

void EdgeRatios::drop(std::uint32_t a, std::uint32_t b) {
  const std::uint32_t i = local(a), j = local(b);
  std::erase_if(edges_, [&](const auto& e) { return (e[0] == i && e[1] == j) || (e[0] == j && e[1] == i); });
  const double length = norm(mesh_.at(a) - mesh_.at(b));
  for (const std::uint32_t k : {i, j}) local_sum_[k] -= length, local_degree_[k] -= 1.0;
}

void EdgeRatios::add(std::uint32_t a, std::uint32_t b, double length) {
  const std::uint32_t i = local(a), j = local(b);
  edges_.push_back({i, j});
  for (const std::uint32_t k : {i, j}) local_sum_[k] += length, local_degree_[k] += 1.0;
}

double EdgeRatios::flip_adds(std::uint32_t corner) {
  const std::uint32_t u = mesh_.vertex(corner), w = mesh_.vertex(mesh_.opposite(corner)),
                      a = mesh_.vertex(next_corner(corner)), b = mesh_.vertex(prev_corner(corner));
  const std::array<std::uint32_t, 4> changed = {u, a, w, b};
  const double before = begin(changed);
  if (before == kNoRatio) return kNoRatio;
  drop(a, b);
  add(u, w, norm(mesh_.at(u) - mesh_.at(w)));
  return cost() - before;
}

double EdgeRatios::split_adds(std::uint32_t corner, const Double3& at) {
  const std::uint32_t a = mesh_.vertex(next_corner(corner)), b = mesh_.vertex(prev_corner(corner)),
                      across = mesh_.opposite(corner);
  const std::array<std::uint32_t, 4> changed = {a, b, mesh_.vertex(corner),
                                                across == kNoCorner ? kNoCorner : mesh_.vertex(across)};
  const std::span<const std::uint32_t> there(changed.data(), across == kNoCorner ? 3 : 4);
  const double before = begin(there);
  if (before == kNoRatio) return kNoRatio;
  drop(a, b);
  for (const std::uint32_t v : there) add(kNewVertex, v, norm(mesh_.at(v) - at));
  return cost() - before;
}

double EdgeRatios::collapse_adds(const Star& star, std::size_t at) {
  const std::uint32_t u = mesh_.vertex(star.corner[0]), v = star.ring[at];
  const std::span<const std::uint32_t> ring(star.ring.data(), star.ring_size());
  const double before = begin(ring);
  if (before == kNoRatio || !whole_[u]) return kNoRatio;
  for (const std::uint32_t w : ring) drop(u, w);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    // Both sides of the edge that goes end at v already.
    const bool beside = star.following(i) == at || star.following(at) == i;
    if (i == at || (beside && (star.closed || i + 1 == at || at + 1 == i))) continue;
    add(v, ring[i], norm(mesh_.at(ring[i]) - mesh_.at(v)));
  }
  return cost() - before;
}

double EdgeRatios::open_star(std::uint32_t v, const Star& star) {
  std::array<std::uint32_t, kMaxRing + 3> changed;
  changed[0] = v;
  std::copy_n(star.ring.begin(), star.ring_size(), changed.begin() + 1);
  const double before = begin({changed.data(), star.ring_size() + 1});
  ring_.clear(), without_.clear();
  for (std::size_t i = 0; i < star.ring_size(); ++i) {
    ring_.push_back(mesh_.at(star.ring[i]));
    without_.push_back(local_sum_[i + 1] - norm(ring_[i] - mesh_.at(v)));
  }
  return before;
}

double EdgeRatios::move_costs(const Double3& p) {
  local_sum_[0] = 0.0;
  for (std::size_t i = 0; i < ring_.size(); ++i) {
    const double spoke = norm(ring_[i] - p);
    local_sum_[0] += spoke;
    local_sum_[i + 1] = without_[i] + spoke;
  }
  return cost();
}

}  // namespace tessera
