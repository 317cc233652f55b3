/// \file lists.h
/// Many short lists one after the other in one array, and the counting that lays them out.
#pragma once
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace tessera {

/// List i is item[first[i]] .. item[first[i + 1] - 1].
template <class Item, class Index = std::uint32_t>
struct Lists {
  std::vector<Index> first;
  std::vector<Item> item;

  [[nodiscard]] std::size_t size() const { return first.size() - 1; }
  std::span<Item> operator[](std::size_t i) { return {item.data() + first[i], item.data() + first[i + 1]}; }
  std::span<const Item> operator[](std::size_t i) const {
    return {item.data() + first[i], item.data() + first[i + 1]};
  }
};

/// \param each  calls put(list, item) for everything that is to be in a list; called twice, to count and to fill.
///              A list keeps the order of the calls.
template <class Item, class Index = std::uint32_t, class Each>
[[nodiscard]] Lists<Item, Index> make_lists(std::size_t lists, const Each& each) {
  Lists<Item, Index> out;
  // Places two behind: summed up, first[i + 1] is where list i begins, and where it ends once it is filled.
  out.first.assign(lists + 2, 0);
  each([&](std::size_t list, const Item&) { ++out.first[list + 2]; });
  std::partial_sum(out.first.begin(), out.first.end(), out.first.begin());
  out.item.resize(static_cast<std::size_t>(out.first.back()));
  each([&](std::size_t list, const Item& item) {
    out.item[static_cast<std::size_t>(out.first[list + 1]++)] = item;
  });
  out.first.pop_back();
  return out;
}

/// One pass of a counting sort, stable: `from` by key(item) into `to`. \param begin  scratch, one more than keys
template <class Item, class Key>
void counting_sort(std::span<const Item> from, std::span<Item> to, std::span<std::uint32_t> begin,
                   const Key& key) {
  std::fill(begin.begin(), begin.end(), 0u);
  for (const Item& i : from) ++begin[key(i) + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  for (const Item& i : from) to[begin[key(i)]++] = i;
}

}  // namespace tessera
