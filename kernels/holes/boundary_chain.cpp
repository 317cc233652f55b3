#include "kernels/holes/boundary_chain.h"

#include <algorithm>

namespace tessera {

std::size_t BoundaryChain::new_path(const BoundaryEdge& edge) {
  if (free_.empty()) {
    free_.push_back(paths_.size());
    paths_.emplace_back();
  }
  const std::size_t at = free_.back();
  free_.pop_back();
  paths_[at] = {edge.from, edge.to, false, {edge}};
  by_first_[edge.from] = by_last_[edge.to] = at;
  ++open_;
  return at;
}

void BoundaryChain::forget(Path& path) {
  open_ -= path.edges.size();
  path.forgotten = true;
  std::vector<BoundaryEdge>().swap(path.edges);
}

/// \pre the front's last vertex is the back's first
void BoundaryChain::join(std::size_t front, std::size_t back) {
  Path &a = paths_[front], &b = paths_[back];
  by_last_.erase(a.last);
  by_first_.erase(b.first);
  const bool lost = a.forgotten || b.forgotten || a.edges.size() + b.edges.size() > max_edges_;
  if (lost) {
    forget(a);
    forget(b);
  } else {
    a.edges.insert(a.edges.end(), b.edges.begin(), b.edges.end());
  }
  a.last = b.last;
  by_last_[a.last] = front;
  b = {};
  free_.push_back(back);
}

void BoundaryChain::close(std::size_t path, const std::function<void(HoleBoundary&&)>& use) {
  Path& p = paths_[path];
  by_first_.erase(p.first);
  by_last_.erase(p.last);
  free_.push_back(path);
  open_ -= p.edges.size();
  const std::vector<BoundaryEdge> edges = std::move(p.edges);
  p = {};
  if (edges.size() < 3) return;
  const auto smallest =
      std::min_element(edges.begin(), edges.end(),
                       [](const BoundaryEdge& a, const BoundaryEdge& b) { return a.from < b.from; });
  const auto start = static_cast<std::size_t>(smallest - edges.begin());
  HoleBoundary out;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const BoundaryEdge& e = edges[(start + i) % edges.size()];
    out.vertex.push_back(e.from);
    out.third.push_back(e.third);
  }
  use(std::move(out));
}

void BoundaryChain::add(const BoundaryEdge& edge, const std::function<void(HoleBoundary&&)>& use) {
  if (by_first_.contains(edge.from) || by_last_.contains(edge.to))
    return;  // no manifold: its paths stay open
  std::size_t path = new_path(edge);
  // Before the edge: the path that ends where it begins.
  if (const auto before = by_last_.find(edge.from); before != by_last_.end() && before->second != path) {
    const std::size_t front = before->second;
    join(front, path);
    path = front;
  }
  if (const auto after = by_first_.find(edge.to); after != by_first_.end()) {
    if (after->second == path) return close(path, use);
    join(path, after->second);
  }
  if (open_ <= max_open_) return;
  for (Path& p : paths_)
    if (!p.edges.empty()) {
      forget(p);
      ++given_up_;
    }
}

}  // namespace tessera
