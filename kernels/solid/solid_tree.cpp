#include "kernels/solid/solid_tree.h"

#include <array>

namespace tessera {

bool SolidTree::is_complete(std::size_t operands) const {
  std::size_t depth = 0;
  for (const Step& s : steps_) {
    if (s.is_operand) {
      if (s.operand >= operands || ++depth > kMaxOperands) return false;
    } else if (depth-- < 2) {
      return false;
    }
  }
  return depth == 1;
}

std::uint64_t SolidTree::inside(std::span<const std::uint64_t> inside) const {
  std::array<std::uint64_t, kMaxOperands + 1> stack;
  std::size_t top = 0;
  for (const Step& s : steps_) {
    if (s.is_operand) {
      stack[top++] = inside[s.operand];
      continue;
    }
    const std::uint64_t b = stack[--top];
    std::uint64_t& a = stack[top - 1];
    a = s.join == Join::kUnite ? a | b : s.join == Join::kIntersect ? a & b : a & ~b;
  }
  return stack[0];
}

}  // namespace tessera
