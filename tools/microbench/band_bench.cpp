// Our band leaves against an openvdb::FloatGrid, on the band of a synthetic sphere; prints one JSON line.
// band_bench [cells] [repeats]
#include <openvdb/openvdb.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "kernels/field/field.h"
#include "tests/helpers/oriented_samples.h"

namespace {

using namespace tessera;

/// Processor time: a busy machine does not count.
double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

template <class Body>
double best_of(int repeats, const Body& body) {
  double best = 1e30;
  for (int i = 0; i < repeats; ++i) {
    const double start = thread_seconds();
    body();
    best = std::min(best, thread_seconds() - start);
  }
  return best;
}

template <class Body>
void for_each_node(const DirectedField& field, const Body& body) {
  for (const BandLeaf& leaf : field.leaves)
    for (int z = 0; z < 8; ++z)
      for (std::uint64_t left = leaf.valid[static_cast<std::size_t>(z)]; left; left &= left - 1) {
        const int bit = std::countr_zero(left);
        body(leaf, leaf.origin[0] + (bit & 7), leaf.origin[1] + (bit >> 3), leaf.origin[2] + z,
             static_cast<std::size_t>(bit + 64 * z));
      }
}

}  // namespace

int main(int argc, char** argv) {
  const int cells = argc > 1 ? std::atoi(argv[1]) : 128, repeats = argc > 2 ? std::atoi(argv[2]) : 20;
  test::Random random(7);
  test::Samples samples;
  const double centre = 64.0 + 0.5 * cells;
  test::add_sphere({centre, centre, centre}, 0.43 * cells, 1 / 1.5, random, samples);
  const auto block = test::make_block(samples, {64, 64, 64}, {cells, cells, cells}, field_halo_cells({}));
  const DirectedField field = evaluate_field(block, {});
  std::size_t nodes = 0;
  for_each_node(field, [&](const BandLeaf&, int, int, int, std::size_t) { ++nodes; });

  // Fill: value and validity of every node.
  DirectedField copy;
  const double fill_ours = best_of(repeats, [&] {
    copy = DirectedField{};
    copy.cells = field.cells;
    copy.leaf_index.assign(field.leaf_index.size(), -1);
    copy.leaves.reserve(field.leaves.size());
    const Int3 dims = copy.leaf_dims();
    for (const BandLeaf& leaf : field.leaves) {
      const auto at = static_cast<std::size_t>(
          (((leaf.origin[2] >> 3) + 1) * dims[1] + (leaf.origin[1] >> 3) + 1) * dims[0] +
          (leaf.origin[0] >> 3) + 1);
      copy.leaf_index[at] = static_cast<std::int32_t>(copy.leaves.size());
      BandLeaf& to = copy.leaves.emplace_back();
      to.origin = leaf.origin;
      for (std::size_t z = 0; z < 8; ++z)
        for (std::uint64_t left = leaf.valid[z]; left; left &= left - 1) {
          const auto n = static_cast<std::size_t>(std::countr_zero(left)) + 64 * z;
          to.value[n] = leaf.value[n];
          to.valid[z] |= left & (~left + 1);
        }
    }
  });
  openvdb::initialize();
  openvdb::FloatGrid::Ptr grid;
  const double fill_vdb = best_of(repeats, [&] {
    grid = openvdb::FloatGrid::create(3.0f);
    auto accessor = grid->getAccessor();
    for_each_node(field, [&](const BandLeaf& leaf, int i, int j, int k, std::size_t n) {
      accessor.setValueOn(openvdb::Coord(i, j, k), leaf.value[n]);
    });
  });

  // Read: the eight corners of every cell whose first node is valid, as extraction does.
  double sum_ours = 0, sum_vdb = 0;
  const auto corners = [&](const auto& value_at, double* sum) {
    for_each_node(field, [&](const BandLeaf&, int i, int j, int k, std::size_t) {
      if (i >= cells || j >= cells || k >= cells) return;
      float s = 0.0f;
      for (int c = 0; c < 8; ++c) s += value_at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
      *sum += static_cast<double>(s);
    });
  };
  const double read_ours = best_of(repeats, [&] {
    sum_ours = 0;
    corners(
        [&](int i, int j, int k) {
          const BandLeaf* leaf = copy.leaf_at(i, j, k);
          const auto bit = static_cast<std::size_t>(DirectedField::bit(i, j));
          const auto z = static_cast<std::size_t>(k & 7);
          return leaf && leaf->valid[z] >> bit & 1 ? leaf->value[bit + 64 * z] : 3.0f;
        },
        &sum_ours);
  });
  const double read_vdb = best_of(repeats, [&] {
    sum_vdb = 0;
    auto accessor = grid->getConstAccessor();
    corners([&](int i, int j, int k) { return accessor.getValue(openvdb::Coord(i, j, k)); }, &sum_vdb);
  });
  if (sum_ours != sum_vdb) {
    std::fprintf(stderr, "band_bench: the two bands differ: %.9g and %.9g\n", sum_ours, sum_vdb);
    return 1;
  }
  const auto n = static_cast<double>(nodes);
  const double bytes = static_cast<double>(field.leaves.size() * sizeof(BandLeaf) +
                                           field.leaf_index.size() * sizeof(std::int32_t));
  const double lean = static_cast<double>(field.leaves.size() * (512 * sizeof(float) + 64 + 12) +
                                          field.leaf_index.size() * sizeof(std::int32_t));
  std::printf(
      "{\"bench\":\"band\",\"cells\":%d,\"nodes\":%zu,\"fill_ns_per_node\":%.2f,\"fill_ns_per_node_vdb\":%."
      "2f,"
      "\"read_ns_per_cell\":%.2f,\"read_ns_per_cell_vdb\":%.2f,\"bytes_per_node\":%.2f,"
      "\"bytes_per_node_values_only\":%.2f,\"bytes_per_node_vdb\":%.2f}\n",
      cells, nodes, fill_ours / n * 1e9, fill_vdb / n * 1e9, read_ours / n * 1e9, read_vdb / n * 1e9,
      bytes / n, lean / n, static_cast<double>(grid->memUsage()) / n);
  return 0;
}
