#include "solvers/fill_ordering.h"

#include <amd.h>
#include <metis.h>

#include <limits>
#include <numeric>
#include <string>

#include "octree/error.h"

namespace tessera {
namespace {

static_assert(sizeof(idx_t) == sizeof(std::int32_t));

/// Neighbours of every unknown, itself left out.
struct AdjacencyGraph {
  std::vector<std::int32_t> start, neighbour;
};

AdjacencyGraph adjacency_graph(const SparseMatrix& a) {
  AdjacencyGraph graph;
  graph.start.reserve(static_cast<std::size_t>(a.rows) + 1);
  graph.neighbour.reserve(a.entries());
  graph.start.push_back(0);
  for (std::int32_t i = 0; i < a.rows; ++i) {
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
      if (a.column[e] != i) graph.neighbour.push_back(a.column[e]);
    graph.start.push_back(static_cast<std::int32_t>(graph.neighbour.size()));
  }
  return graph;
}

std::vector<std::int32_t> minimum_degree(AdjacencyGraph graph) {
  const auto n = static_cast<std::int32_t>(graph.start.size() - 1);
  const std::size_t size = graph.start.size() - 1;
  const std::size_t entries = graph.neighbour.size();
  const std::size_t room = entries + entries / 2 + size;  // AMD works in place and asks for a fifth more
  if (room > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    throw ResourceError("no ordering of " + std::to_string(n) + " unknowns: more than 2^31 entries");
  graph.neighbour.resize(room);
  std::vector<std::int32_t> length(size), weight(size), inverse(size), order(size), head(size),
      elements(size), degree(size), work(size);
  for (std::size_t i = 0; i < size; ++i) length[i] = graph.start[i + 1] - graph.start[i];
  double control[AMD_CONTROL], info[AMD_INFO];
  amd_defaults(control);
  amd_2(n, graph.start.data(), graph.neighbour.data(), length.data(), static_cast<std::int32_t>(room),
        static_cast<std::int32_t>(entries), weight.data(), inverse.data(), order.data(), head.data(),
        elements.data(), degree.data(), work.data(), control, info);
  return order;
}

std::vector<std::int32_t> nested_dissection(AdjacencyGraph graph) {
  std::vector<std::int32_t> order(graph.start.size() - 1), inverse(order.size());
  std::iota(order.begin(), order.end(), 0);
  if (graph.neighbour.empty()) return order;
  auto n = static_cast<idx_t>(order.size());
  const int status = METIS_NodeND(&n, graph.start.data(), graph.neighbour.data(), nullptr, nullptr,
                                  order.data(), inverse.data());
  if (status != METIS_OK)
    throw ResourceError("no ordering of " + std::to_string(n) + " unknowns: METIS is out of memory");
  return order;
}

}  // namespace

std::vector<std::int32_t> fill_ordering(const SparseMatrix& a, Ordering ordering) {
  return ordering == Ordering::kNestedDissection ? nested_dissection(adjacency_graph(a))
                                                 : minimum_degree(adjacency_graph(a));
}

}  // namespace tessera
