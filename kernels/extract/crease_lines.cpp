#include "kernels/extract/crease_lines.h"

#include <algorithm>

namespace tessera {
namespace {

template <class T>
std::span<const T> equal_span(const std::vector<T>& all, std::uint32_t key, std::uint32_t T::*of) {
  const auto first =
      std::lower_bound(all.begin(), all.end(), key, [&](const T& a, std::uint32_t k) { return a.*of < k; });
  auto last = first;
  while (last != all.end() && (*last).*of == key) ++last;
  return {first, last};
}

}  // namespace

std::span<const CreaseChain> CreaseLines::chains_of(std::uint32_t face) const {
  return equal_span(chains, face, &CreaseChain::face);
}

std::span<const CreasePiece> CreaseLines::pieces_of(std::uint32_t cell) const {
  return equal_span(pieces, cell, &CreasePiece::cell);
}

}  // namespace tessera
