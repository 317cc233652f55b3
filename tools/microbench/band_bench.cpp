// The band in OpenVDB's leaves against the same leaf with plain arrays of its own, on the band of a synthetic sphere:
// fill, read and throw away as the field and the extraction do. Prints one JSON line. band_bench [cells] [repeats]
#include "kernels/field/vdb_leaf.h"
//
#include <malloc.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "kernels/field/field.h"
#include "tests/helpers/oriented_samples.h"
#include "tools/microbench/thread_seconds.h"

namespace {

using namespace tessera;

/// What BandLeaf is, but for where values and their mask lie.
struct PlainLeaf {
  PlainLeaf(const Int3&, const Int3& at) : origin(at) { values.fill(kBandBackground); }
  float& value(std::size_t n) { return values[n]; }
  float value(std::size_t n) const { return values[n]; }
  const LeafWords& valid() const { return mask; }
  void set_valid(const LeafWords& words) { mask = words; }

  Int3 origin;
  alignas(32) std::array<float, 512> values;
  LeafWords mask{}, inside{}, closing{};
  std::array<LeafWords, 3> crossing{};
  std::array<std::array<std::uint32_t, 8>, 3> first_root{};
};

std::size_t heap_bytes(const PlainLeaf&) {
  return 0;
}
/// What the allocator keeps for an OpenVDB leaf, its own word before each block among it.
std::size_t heap_bytes(const BandLeaf& leaf) {
  const auto block = [](const void* p) { return malloc_usable_size(const_cast<void*>(p)) + sizeof(void*); };
  return block(&leaf.vdb()) + block(leaf.vdb().buffer().data());
}

/// What the fit hands over.
struct Fit {
  Int3 origin;
  LeafWords valid;
  std::array<float, 512> value;
};

struct Times {
  double fill = 1e30, read = 1e30, words = 1e30;
  double sum = 0, bytes = 0;
  std::uint64_t bits = 0;
};

template <class Body>
void keep_best(double& best, const Body& body) {
  const double start = thread_seconds();
  body();
  best = std::min(best, thread_seconds() - start);
}

template <class Leaf>
void measure(const DirectedField& field, const std::vector<Fit>& fits, Times& t) {
  std::vector<Leaf> leaves;
  keep_best(t.fill, [&] {
    std::vector<Leaf> fresh;
    fresh.reserve(fits.size());
    for (const Fit& fit : fits) {
      Leaf& leaf = fresh.emplace_back(field.origin, fit.origin);
      leaf.set_valid(fit.valid);
      for (std::size_t z = 0; z < 8; ++z)
        for (std::uint64_t left = fit.valid[z]; left; left &= left - 1) {
          const auto n = static_cast<std::size_t>(std::countr_zero(left)) + 64 * z;
          leaf.value(n) = fit.value[n];
          if (fit.value[n] < 0.0f) leaf.inside[z] |= left & (~left + 1);
        }
    }
    leaves.swap(fresh);
  });
  // The eight corners of every cell whose first node is valid, as ambiguous cells are read.
  const Int3 dims = field.leaf_dims();
  const auto leaf_at = [&](int i, int j, int k) {
    const auto slot =
        static_cast<std::size_t>((((k >> 3) + 1) * dims[1] + (j >> 3) + 1) * dims[0] + (i >> 3) + 1);
    return field.leaf_index[slot] < 0 ? nullptr : &leaves[static_cast<std::size_t>(field.leaf_index[slot])];
  };
  keep_best(t.read, [&] {
    t.sum = 0;
    for (const Fit& fit : fits)
      for (std::size_t z = 0; z < 8; ++z)
        for (std::uint64_t left = fit.valid[z]; left; left &= left - 1) {
          const int b = std::countr_zero(left);
          const int i = fit.origin[0] + (b & 7), j = fit.origin[1] + (b >> 3),
                    k = fit.origin[2] + static_cast<int>(z);
          if (i >= field.cells[0] || j >= field.cells[1] || k >= field.cells[2]) continue;
          float s = 0.0f;
          for (int c = 0; c < 8; ++c) {
            const int x = i + (c & 1), y = j + (c >> 1 & 1), w = k + (c >> 2);
            const Leaf* leaf = leaf_at(x, y, w);
            s += leaf ? leaf->value(BandLeaf::node(x, y, w)) : kBandBackground;
          }
          t.sum += static_cast<double>(s);
        }
  });
  keep_best(t.words, [&] {
    t.bits = 0;
    for (const Leaf& leaf : leaves)
      for (const std::uint64_t word : leaf.valid()) t.bits = t.bits * 3 + word;
  });
  t.bytes = 0;
  for (const Leaf& leaf : leaves) t.bytes += static_cast<double>(sizeof(Leaf) + heap_bytes(leaf));
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
  std::vector<Fit> fits;
  std::size_t nodes = 0;
  for (const BandLeaf& leaf : field.leaves) {
    Fit& fit = fits.emplace_back();
    fit.origin = leaf.origin;
    fit.valid = leaf.valid();
    for (std::size_t n = 0; n < 512; ++n) fit.value[n] = leaf.value(n);
    for (const std::uint64_t word : fit.valid) nodes += static_cast<std::size_t>(std::popcount(word));
  }
  Times plain, vdb;
  for (int i = 0; i < repeats; ++i) {
    measure<PlainLeaf>(field, fits, plain);
    measure<BandLeaf>(field, fits, vdb);
  }
  if (plain.sum != vdb.sum || plain.bits != vdb.bits) {
    std::fprintf(stderr, "band_bench: the two bands differ: %.9g and %.9g\n", plain.sum, vdb.sum);
    return 1;
  }
  const auto n = static_cast<double>(nodes), leaves = static_cast<double>(fits.size());
  std::printf(
      "{\"bench\":\"band\",\"cells\":%d,\"leaves\":%zu,\"nodes\":%zu,\"fill_ns_per_node\":%.2f,"
      "\"fill_ns_per_node_vdb\":%.2f,\"read_ns_per_cell\":%.2f,\"read_ns_per_cell_vdb\":%.2f,"
      "\"words_ns_per_leaf\":%.1f,\"words_ns_per_leaf_vdb\":%.1f,\"bytes_per_node\":%.2f,"
      "\"bytes_per_node_vdb\":%.2f}\n",
      cells, fits.size(), nodes, plain.fill / n * 1e9, vdb.fill / n * 1e9, plain.read / n * 1e9,
      vdb.read / n * 1e9, plain.words / leaves * 1e9, vdb.words / leaves * 1e9, plain.bytes / n,
      vdb.bytes / n);
  return 0;
}
