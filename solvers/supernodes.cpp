#include "solvers/supernodes.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace tessera {
namespace {

using ColumnList = std::vector<std::int32_t>;

ColumnList inverse_of(std::span<const std::int32_t> order) {
  ColumnList slot(order.size());
  for (std::size_t k = 0; k < order.size(); ++k)
    slot[static_cast<std::size_t>(order[k])] = static_cast<std::int32_t>(k);
  return slot;
}

/// Calls use(j) for every column j != k that has an entry in row k of the matrix in this order.
template <class Use>
void for_row(const SparseMatrix& a, std::span<const std::int32_t> order, const ColumnList& slot,
             std::size_t k, const Use& use) {
  const std::int32_t row = order[k];
  for (std::int32_t e = a.start[row]; e < a.start[row + 1]; ++e) {
    const std::int32_t j = slot[static_cast<std::size_t>(a.column[e])];
    if (j != static_cast<std::int32_t>(k)) use(j);
  }
}

/// Parents by Liu's rule: the roots that a row meets get that row as parent. Paths are cut short on the way.
ColumnList parents_of(const SparseMatrix& a, std::span<const std::int32_t> order, const ColumnList& slot) {
  ColumnList parent(order.size(), -1), ancestor(order.size(), -1);
  for (std::size_t k = 0; k < order.size(); ++k)
    for_row(a, order, slot, k, [&](std::int32_t j) {
      const auto here = static_cast<std::int32_t>(k);
      while (j >= 0 && j < here) {
        const std::int32_t next = ancestor[static_cast<std::size_t>(j)];
        ancestor[static_cast<std::size_t>(j)] = here;
        if (next < 0) parent[static_cast<std::size_t>(j)] = here;
        j = next;
      }
    });
  return parent;
}

/// Columns in postorder; children of a column by ascending `weight`, then by their number; roots by their number.
ColumnList postorder_of(const ColumnList& parent, const ColumnList* weight) {
  const std::size_t n = parent.size();
  ColumnList by_weight(n);
  std::iota(by_weight.begin(), by_weight.end(), 0);
  if (weight != nullptr)
    std::stable_sort(by_weight.begin(), by_weight.end(), [&](std::int32_t a, std::int32_t b) {
      return (*weight)[static_cast<std::size_t>(a)] < (*weight)[static_cast<std::size_t>(b)];
    });
  ColumnList child(n, -1), sibling(n, -1);
  for (auto j = by_weight.rbegin(); j != by_weight.rend(); ++j) {
    const std::int32_t p = parent[static_cast<std::size_t>(*j)];
    if (p < 0) continue;
    sibling[static_cast<std::size_t>(*j)] = child[static_cast<std::size_t>(p)];
    child[static_cast<std::size_t>(p)] = *j;
  }
  ColumnList out, stack;
  out.reserve(n);
  for (std::size_t root = 0; root < n; ++root) {
    if (parent[root] >= 0) continue;
    stack.assign(1, static_cast<std::int32_t>(root));
    while (!stack.empty()) {
      const auto top = static_cast<std::size_t>(stack.back());
      if (child[top] >= 0) {
        stack.push_back(child[top]);
        child[top] = sibling[static_cast<std::size_t>(child[top])];
      } else {
        out.push_back(static_cast<std::int32_t>(top));
        stack.pop_back();
      }
    }
  }
  return out;
}

std::int32_t set_of(ColumnList& set, std::int32_t j) {
  std::int32_t root = j;
  while (set[static_cast<std::size_t>(root)] != root) root = set[static_cast<std::size_t>(root)];
  while (j != root) j = std::exchange(set[static_cast<std::size_t>(j)], root);
  return root;
}

/// Entries of each column. A row of the factor is a subtree; each of its leaves adds one to the counts above, and where two paths
/// meet one is taken back.
ColumnList counts_of(const SparseMatrix& a, std::span<const std::int32_t> order, const ColumnList& slot,
                     const ColumnList& parent) {
  const std::size_t n = order.size();
  const ColumnList post = postorder_of(parent, nullptr);
  ColumnList first(n, -1), count(n, 0), last_leaf(n, -1), last_first(n, -1), set(n);
  for (std::size_t k = 0; k < n; ++k) {
    const auto j = static_cast<std::size_t>(post[k]);
    if (first[j] < 0) {
      first[j] = static_cast<std::int32_t>(k);
      count[j] = 1;
    }
    if (const std::int32_t p = parent[j]; p >= 0 && first[static_cast<std::size_t>(p)] < 0)
      first[static_cast<std::size_t>(p)] = first[j];
  }
  std::iota(set.begin(), set.end(), 0);
  for (const std::int32_t column : post) {
    const auto j = static_cast<std::size_t>(column);
    if (parent[j] >= 0) --count[static_cast<std::size_t>(parent[j])];
    for_row(a, order, slot, j, [&](std::int32_t row) {
      const auto i = static_cast<std::size_t>(row);
      if (row < column || first[j] <= last_first[i]) return;
      ++count[j];
      if (last_leaf[i] >= 0) --count[static_cast<std::size_t>(set_of(set, last_leaf[i]))];
      last_leaf[i] = column;
      last_first[i] = first[j];
    });
    if (parent[j] >= 0) set[j] = parent[j];
  }
  for (const std::int32_t j : post)
    if (const std::int32_t p = parent[static_cast<std::size_t>(j)]; p >= 0)
      count[static_cast<std::size_t>(p)] += count[static_cast<std::size_t>(j)];
  return count;
}

/// Columns taken together, and the rows of the first of them.
struct ColumnGroup {
  std::int32_t first = 0, columns = 0, rows = 0;
  std::int64_t zeros = 0;  ///< entries that are none of the factor
  bool merged = false;     ///< into the one before it
};

/// Whether a group of so many columns may hold such a share of zeros: what CHOLMOD's manual gives as good on current machines.
bool few_zeros(std::int32_t columns, double share) {
  return columns <= 4 || share == 0.0 || (columns <= 16 && share < 0.8) || (columns <= 48 && share < 0.1) ||
         share < 0.05;
}

/// Columns that follow each other with the same rows: one child, the next one.
std::vector<ColumnGroup> fundamental_groups(const EliminationTree& tree) {
  const std::size_t n = tree.parent.size();
  ColumnList children(n, 0);
  for (const std::int32_t p : tree.parent)
    if (p >= 0) ++children[static_cast<std::size_t>(p)];
  std::vector<ColumnGroup> groups;
  for (std::size_t j = 0; j < n; ++j) {
    const bool joins = j > 0 && tree.parent[j - 1] == static_cast<std::int32_t>(j) &&
                       tree.count[j - 1] == tree.count[j] + 1 && children[j] == 1;
    if (!joins) groups.push_back({static_cast<std::int32_t>(j), 0, tree.count[j]});
    ++groups.back().columns;
  }
  return groups;
}

/// Takes each group, the last first, together with its parent where that is the next one and few zeros come in.
void relax_groups(std::vector<ColumnGroup>& groups, const EliminationTree& tree) {
  ColumnList group_of(tree.parent.size());
  for (std::size_t g = 0; g < groups.size(); ++g)
    std::fill_n(group_of.begin() + groups[g].first, groups[g].columns, static_cast<std::int32_t>(g));
  std::vector<std::int32_t> head(groups.size());  // of what a group was taken into
  std::iota(head.begin(), head.end(), 0);
  for (std::size_t g = groups.size() - 1; g-- > 0;) {
    ColumnGroup& low = groups[g];
    const std::int32_t above = tree.parent[static_cast<std::size_t>(low.first + low.columns - 1)];
    if (above < 0) continue;
    const std::int32_t parent = set_of(head, group_of[static_cast<std::size_t>(above)]);
    if (parent != static_cast<std::int32_t>(g) + 1) continue;
    ColumnGroup& high = groups[g + 1];
    const std::int32_t columns = low.columns + high.columns;
    const std::int64_t fresh = std::int64_t{low.columns} * (high.rows + low.columns - low.rows);
    const std::int64_t zeros = high.zeros + fresh;
    const double width = columns;
    const double size = width * (width + 1.0) / 2.0 + width * (high.rows - high.columns);
    const double share = fresh == 0 ? 0.0 : static_cast<double>(zeros) / size;
    if (!few_zeros(columns, share)) continue;
    low.zeros = columns <= 4 ? high.zeros : zeros;
    low.rows = low.columns + high.rows;
    low.columns = columns;
    high.merged = true;
    head[g + 1] = static_cast<std::int32_t>(g);
  }
}

}  // namespace

EliminationTree elimination_tree(const SparseMatrix& a, std::span<const std::int32_t> order) {
  const ColumnList slot = inverse_of(order);
  EliminationTree tree;
  tree.parent = parents_of(a, order, slot);
  tree.count = counts_of(a, order, slot, tree.parent);
  return tree;
}

std::vector<std::int32_t> postorder(EliminationTree& tree, std::span<const std::int32_t> order) {
  const ColumnList post = postorder_of(tree.parent, &tree.count);
  const ColumnList place = inverse_of(post);
  EliminationTree renamed;
  std::vector<std::int32_t> unknowns;
  for (const std::int32_t j : post) {
    const std::int32_t p = tree.parent[static_cast<std::size_t>(j)];
    renamed.parent.push_back(p < 0 ? -1 : place[static_cast<std::size_t>(p)]);
    renamed.count.push_back(tree.count[static_cast<std::size_t>(j)]);
    unknowns.push_back(order[static_cast<std::size_t>(j)]);
  }
  tree = std::move(renamed);
  return unknowns;
}

Supernodes find_supernodes(const SparseMatrix& a, std::span<const std::int32_t> order,
                           const EliminationTree& tree) {
  Supernodes out;
  out.start.push_back(0);
  if (order.empty()) {
    out.first.push_back(0);
    return out;
  }
  std::vector<ColumnGroup> groups = fundamental_groups(tree);
  relax_groups(groups, tree);
  std::erase_if(groups, [](const ColumnGroup& g) { return g.merged; });
  ColumnList group_of(order.size());
  std::vector<std::size_t> filled;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::fill_n(group_of.begin() + groups[g].first, groups[g].columns, static_cast<std::int32_t>(g));
    out.first.push_back(groups[g].first);
    filled.push_back(out.start.back());
    out.start.push_back(out.start.back() + static_cast<std::size_t>(groups[g].rows));
  }
  out.first.push_back(static_cast<std::int32_t>(order.size()));
  out.rows.resize(out.start.back());
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (std::int32_t j = out.first[g]; j < out.first[g + 1]; ++j) out.rows[filled[g]++] = j;
  // Row by row: every group on the paths from the entries of the matrix up to the group of the row has it.
  const ColumnList slot = inverse_of(order);
  ColumnList seen(groups.size(), -1);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const auto row = static_cast<std::int32_t>(k);
    seen[static_cast<std::size_t>(group_of[k])] = row;
    for_row(a, order, slot, k, [&](std::int32_t j) {
      if (j > row) return;
      for (auto g = static_cast<std::size_t>(group_of[static_cast<std::size_t>(j)]); seen[g] != row;) {
        seen[g] = row;
        out.rows[filled[g]++] = row;
        g = static_cast<std::size_t>(
            group_of[static_cast<std::size_t>(tree.parent[static_cast<std::size_t>(out.first[g + 1] - 1)])]);
      }
    });
  }
  return out;
}

}  // namespace tessera
