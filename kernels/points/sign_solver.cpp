#include "kernels/points/sign_solver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>

#include "octree/lists.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

constexpr double kRoundFactor = 8.0;  ///< ties within this factor of the best join in one round
constexpr float kUncertain = 0.5f;    ///< a quarter of the votes or more speak against
constexpr int kFlipSweeps = 6;
constexpr std::uint32_t kNever = std::numeric_limits<std::uint32_t>::max();

double score(const PatchVote& v) {
  const auto net = static_cast<double>(v.same - v.opposite);
  const auto all = static_cast<double>(v.same + v.opposite);
  return all > 0.0 ? net * net / all : 0.0;
}
double confidence(const PatchVote& v) {
  const auto all = static_cast<double>(v.same + v.opposite);
  return all > 0.0 ? std::fabs(static_cast<double>(v.same - v.opposite)) / all : 0.0;
}

/// Votes leaving every subtree of the contraction, times the signs: negative where flipping the subtree
/// gains.
std::vector<std::int64_t> cuts(const Contraction& tree, std::span<const PatchVote> votes,
                               std::span<const std::int8_t> sign) {
  std::vector<std::int64_t> cut(tree.parent.size(), 0);
  for (const PatchVote& v : votes) {
    const std::int64_t kept = (v.same - v.opposite) * sign[v.a] * sign[v.b];
    cut[v.a] += kept;
    cut[v.b] += kept;
    std::uint32_t a = v.a, b = v.b;  // at the lowest common ancestor both ends are inside
    while (a != b) {
      const std::uint32_t ra = tree.round[a], rb = tree.round[b];
      if (ra == kNever && rb == kNever) break;  // two components whose votes add up to nothing
      if (ra <= rb) a = tree.parent[a];
      if (rb <= ra) b = tree.parent[b];
    }
    if (a == b) cut[a] -= 2 * kept;
  }
  for (auto it = tree.joined_last.rbegin(); it != tree.joined_last.rend(); ++it)
    if (tree.parent[*it] != *it) cut[tree.parent[*it]] += cut[*it];
  return cut;
}

/// Places of the votes of every node.
Lists<std::uint32_t, std::uint64_t> votes_of_nodes(std::size_t nodes, std::span<const PatchVote> votes) {
  return make_lists<std::uint32_t, std::uint64_t>(nodes, [&](const auto& put) {
    for (std::uint32_t v = 0; v < votes.size(); ++v) put(votes[v].a, v), put(votes[v].b, v);
  });
}

/// Nodes below each node of the forest, as ranges of one preorder.
struct Subtrees {
  std::vector<std::uint32_t> order, at, size;
  explicit Subtrees(const Contraction& tree) {
    const auto n = static_cast<std::uint32_t>(tree.parent.size());
    size.assign(n, 1), at.assign(n, 0), order.resize(n);
    for (auto it = tree.joined_last.rbegin(); it != tree.joined_last.rend(); ++it)
      if (tree.parent[*it] != *it) size[tree.parent[*it]] += size[*it];
    std::vector<std::uint32_t> next(n);
    std::uint32_t roots = 0;
    for (const std::uint32_t v : tree.joined_last) {
      std::uint32_t& slot = tree.parent[v] == v ? roots : next[tree.parent[v]];
      at[v] = slot;
      slot += size[v];
      next[v] = at[v] + 1;
      order[at[v]] = v;
    }
  }
};

/// Flips nodes and whole subtrees of the contraction while they gain.
class Flips {
 public:
  Flips(const Contraction& tree, std::span<const PatchVote> votes, std::vector<std::int8_t>& sign)
      : tree_(tree),
        votes_(votes),
        sign_(sign),
        subtrees_(tree),
        touching_(votes_of_nodes(sign.size(), votes)) {}

  void run() {
    for (int sweep = 0; sweep < kFlipSweeps; ++sweep) {
      const bool groups = sweep_subtrees();
      const bool singles = sweep_nodes();
      if (!groups && !singles) return;
    }
  }

 private:
  /// Votes that hold between the nodes at places [begin, end) of the preorder and all others, less those
  /// broken.
  std::int64_t kept(std::uint32_t begin, std::uint32_t end) const {
    std::int64_t sum = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      const std::uint32_t p = subtrees_.order[i];
      for (const std::uint32_t k : touching_[p]) {
        const PatchVote& w = votes_[k];
        const std::uint32_t other = subtrees_.at[w.a == p ? w.b : w.a];
        if (other < begin || other >= end) sum += (w.same - w.opposite) * sign_[w.a] * sign_[w.b];
      }
    }
    return sum;
  }

  bool flip(std::uint32_t begin, std::uint32_t end) {
    if (kept(begin, end) >= 0) return false;
    for (std::uint32_t i = begin; i < end; ++i) {
      std::int8_t& s = sign_[subtrees_.order[i]];
      s = static_cast<std::int8_t>(-s);
    }
    return true;
  }

  bool sweep_subtrees() {
    const std::vector<std::int64_t> cut = cuts(tree_, votes_, sign_);
    std::vector<std::uint32_t> gaining;
    for (std::uint32_t v = 0; v < cut.size(); ++v)
      if (cut[v] < 0 && tree_.parent[v] != v) gaining.push_back(v);
    std::sort(gaining.begin(), gaining.end(),
              [&](std::uint32_t l, std::uint32_t r) { return cut[l] != cut[r] ? cut[l] < cut[r] : l < r; });
    bool any = false;  // each asked again: earlier flips may have changed what it gains
    for (const std::uint32_t v : gaining) any |= flip(subtrees_.at[v], subtrees_.at[v] + subtrees_.size[v]);
    return any;
  }

  bool sweep_nodes() {
    bool any = false;
    for (std::uint32_t v = 0; v < sign_.size(); ++v)
      if (tree_.parent[v] != v) any |= flip(subtrees_.at[v], subtrees_.at[v] + 1);
    return any;
  }

  const Contraction& tree_;
  std::span<const PatchVote> votes_;
  std::vector<std::int8_t>& sign_;
  Subtrees subtrees_;
  Lists<std::uint32_t, std::uint64_t> touching_;
};

/// The nodes of each component that clear votes joined: per node the smallest of them.
std::vector<std::uint32_t> find_clusters(const Contraction& tree, std::span<const std::uint32_t> component,
                                         std::span<const std::int8_t> sign) {
  const auto n = static_cast<std::uint32_t>(component.size());
  UnionFind sets(n);
  for (const SignJoin& j : tree.joins)  // flips may have torn what joined
    if (j.confidence >= kUncertain && sign[j.a] * sign[j.b] == j.sign) sets.unite(j.a, j.b);
  const std::vector<std::uint32_t> joined = sets.roots();
  std::vector<std::uint32_t> order(n), cluster(n);
  std::iota(order.begin(), order.end(), 0u);
  const auto key = [&](std::uint32_t v) { return std::array{joined[v], component[v], v}; };
  std::sort(order.begin(), order.end(), [&](std::uint32_t l, std::uint32_t r) { return key(l) < key(r); });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::uint32_t v = order[i], before = i > 0 ? order[i - 1] : v;
    const bool goes_on = i > 0 && joined[v] == joined[before] && component[v] == component[before];
    cluster[v] = goes_on ? cluster[before] : v;
  }
  return cluster;
}

/// Which signs are beyond doubt. Pairs join in the order of their votes, so a node may hang on a group by split votes that others
/// outvoted since. Nodes that joined by clear votes are clusters; those with an anchor or a root are decided, and so is every
/// one that they tell.
std::vector<std::uint8_t> find_uncertain(const Contraction& tree, std::span<const PatchVote> votes,
                                         std::span<const std::uint32_t> component,
                                         std::span<const std::int8_t> sign) {
  const std::vector<std::uint32_t> cluster = find_clusters(tree, component, sign);
  const auto n = static_cast<std::uint32_t>(cluster.size());
  std::vector<std::uint8_t> decided(n, 0);
  for (std::uint32_t v = 0; v < n; ++v)
    if (component[v] == v) decided[cluster[v]] = 1;
  std::vector<PatchVote> between;
  for (const PatchVote& v : votes) {
    const std::uint32_t a = cluster[v.a], b = cluster[v.b];
    if (a == b) continue;
    const bool keep = sign[v.a] == sign[v.b];
    const std::int64_t kept = keep ? v.same : v.opposite, broken = keep ? v.opposite : v.same;
    if (component[v.a] == component[v.b]) {
      between.push_back({a, b, kept, broken});
    } else {  // the signs of two components against each other are found later
      between.push_back({a, n, kept, broken});
      between.push_back({b, n, kept, broken});
    }
  }
  decide_told(between, decided);
  std::vector<std::uint8_t> uncertain(n);
  for (std::uint32_t v = 0; v < n; ++v) uncertain[v] = decided[cluster[v]] != 0 ? 0 : 1;
  return uncertain;
}

}  // namespace

void merge_votes(std::vector<PatchVote>& votes) {
  std::sort(votes.begin(), votes.end(),
            [](const PatchVote& l, const PatchVote& r) { return l.a != r.a ? l.a < r.a : l.b < r.b; });
  std::size_t out = 0;
  for (const PatchVote& v : votes) {
    if (out > 0 && votes[out - 1].a == v.a && votes[out - 1].b == v.b) {
      votes[out - 1].same += v.same;
      votes[out - 1].opposite += v.opposite;
    } else {
      votes[out++] = v;
    }
  }
  votes.resize(out);
}

void decide_told(std::span<const PatchVote> votes, std::vector<std::uint8_t>& decided) {
  const auto n = static_cast<std::uint32_t>(decided.size());
  const auto touching = make_lists<std::uint32_t, std::uint64_t>(n, [&](const auto& put) {
    for (std::uint32_t k = 0; k < votes.size(); ++k) {
      if (votes[k].a < n) put(votes[k].a, k);
      if (votes[k].b < n) put(votes[k].b, k);
    }
  });
  const auto is_told = [&](std::uint32_t node) {
    std::int64_t kept = 0, broken = 0, open = 0;
    for (const std::uint32_t k : touching[node]) {
      const PatchVote& v = votes[k];
      const std::uint32_t other = v.a == node ? v.b : v.a;
      const bool known = other < n && decided[other] != 0;
      kept += known ? v.same : 0;
      broken += known ? v.opposite : 0;
      open += known ? 0 : std::abs(v.same - v.opposite);
    }
    const std::int64_t net = kept - broken;
    return net > open && static_cast<double>(net) >= double{kUncertain} * static_cast<double>(kept + broken);
  };
  std::vector<std::uint32_t> asked;
  std::vector<std::uint8_t> waits(n, 0);
  const auto ask = [&](std::uint32_t node) {
    if (node < n && decided[node] == 0 && waits[node] == 0) asked.push_back(node), waits[node] = 1;
  };
  for (std::uint32_t v = 0; v < n; ++v)
    if (touching[v].size() > 0) ask(v);
  for (std::size_t i = 0; i < asked.size(); ++i) {
    const std::uint32_t node = asked[i];
    waits[node] = 0;
    if (!is_told(node)) continue;
    decided[node] = 1;
    for (const std::uint32_t k : touching[node]) ask(votes[k].a), ask(votes[k].b);
  }
}

Contraction contract_signs(std::span<const std::uint64_t> weight, std::vector<PatchVote> votes,
                           const ContractionLimits& limits) {
  const auto n = static_cast<std::uint32_t>(weight.size());
  Contraction tree;
  tree.parent.resize(n);
  std::iota(tree.parent.begin(), tree.parent.end(), 0u);
  tree.relation.assign(n, 1);
  tree.round.assign(n, kNever);
  std::vector<std::uint64_t> group(weight.begin(), weight.end());  // weight of the group of a root
  std::vector<std::uint32_t> best(n, kNever);
  SignedUnionFind trees(n);
  std::vector<std::uint32_t> joined;
  const auto heavier = [&](std::uint32_t l, std::uint32_t r) {
    return group[l] != group[r] ? group[l] > group[r] : l < r;
  };
  // Votes that the limits rule out now may come back when they have been added to others.
  for (std::uint32_t round = 0;; ++round) {
    double top = 0.0;
    for (const PatchVote& v : votes)
      if (confidence(v) >= limits.min_confidence) top = std::max(top, score(v));
    if (!(top > 0.0) || top < limits.min_score) break;
    const double minimum = std::max(top / kRoundFactor, limits.min_score);
    joined.clear();
    for (std::uint32_t e = 0; e < votes.size(); ++e) {
      const PatchVote& v = votes[e];
      const double s = score(v);
      if (s < minimum || confidence(v) < limits.min_confidence) continue;
      for (const std::uint32_t node : {v.a, v.b}) {
        if (best[node] == kNever)
          joined.push_back(node), best[node] = e;
        else if (s > score(votes[best[node]]))
          best[node] = e;
      }
    }
    std::sort(joined.begin(), joined.end());
    // Best ties form trees (ties in score by the order of edges). The heaviest of a tree takes the others in.
    for (const std::uint32_t v : joined) trees.isolate(v);
    for (const std::uint32_t v : joined) {
      const PatchVote& edge = votes[best[v]];
      SignedUnionFind::SignedRoot a = trees.find(edge.a), b = trees.find(edge.b);
      if (a.root == b.root) continue;
      if (heavier(b.root, a.root)) std::swap(a, b);
      const std::int8_t sign = edge.same >= edge.opposite ? 1 : -1;
      trees.hang(b.root, a.root, a.sign * b.sign * sign);
      tree.joins.push_back({edge.a, edge.b, static_cast<float>(confidence(edge)), sign});
    }
    for (const std::uint32_t v : joined) {
      const SignedUnionFind::SignedRoot at = trees.find(v);
      if (at.root == v) continue;
      tree.parent[v] = at.root;
      tree.relation[v] = static_cast<std::int8_t>(at.sign);
      tree.round[v] = round;
    }
    for (const std::uint32_t v : joined) {
      best[v] = kNever;
      if (tree.parent[v] != v) group[tree.parent[v]] += group[v];
    }
    std::size_t out = 0;
    for (PatchVote v : votes) {
      const std::uint32_t a = tree.parent[v.a], b = tree.parent[v.b];
      if (a == b) continue;
      const int relation = (a == v.a ? 1 : tree.relation[v.a]) * (b == v.b ? 1 : tree.relation[v.b]);
      if (relation < 0) std::swap(v.same, v.opposite);
      v.a = std::min(a, b), v.b = std::max(a, b);
      votes[out++] = v;
    }
    votes.resize(out);
    merge_votes(votes);
  }
  tree.joined_last.resize(n);
  std::iota(tree.joined_last.begin(), tree.joined_last.end(), 0u);
  std::sort(tree.joined_last.begin(), tree.joined_last.end(), [&](std::uint32_t l, std::uint32_t r) {
    return tree.round[l] != tree.round[r] ? tree.round[l] > tree.round[r] : l < r;
  });
  return tree;
}

SignSolution solve_signs(std::span<const std::uint64_t> weight, std::span<const PatchVote> votes,
                         std::span<const std::uint8_t> anchors) {
  const Contraction tree = contract_signs(weight, {votes.begin(), votes.end()}, {});
  const std::size_t n = weight.size();
  SignSolution out;
  out.sign.assign(n, 1);
  out.component.resize(n);
  for (const std::uint32_t v : tree.joined_last) {
    const std::uint32_t p = tree.parent[v];
    const bool anchor = p == v || (!anchors.empty() && anchors[v] != 0);
    out.component[v] = anchor ? v : out.component[p];
    if (p == v) continue;
    out.sign[v] = static_cast<std::int8_t>(out.sign[p] * tree.relation[v]);
  }
  Flips(tree, votes, out.sign).run();
  out.uncertain = find_uncertain(tree, votes, out.component, out.sign);
  for (const PatchVote& v : votes) {
    out.frustrated_votes += static_cast<std::uint64_t>(out.sign[v.a] == out.sign[v.b] ? v.opposite : v.same);
    out.total_votes += static_cast<std::uint64_t>(v.same + v.opposite);
  }
  return out;
}

}  // namespace tessera
