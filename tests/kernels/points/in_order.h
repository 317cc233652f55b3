/// \file in_order.h
/// The loop that kernels are given in tests: one index after the other.
#pragma once
#include <cstddef>
#include <functional>

namespace tessera {

inline void in_order(std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
}

}  // namespace tessera
