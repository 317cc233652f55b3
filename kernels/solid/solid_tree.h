/// \file solid_tree.h
/// Boolean expressions over solids, evaluated for 64 nodes at once.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

inline constexpr std::size_t kMaxOperands = 64;

/// A tree as its postfix program: leaves push, joints take two and push one.
class SolidTree {
 public:
  enum class Join : std::uint8_t { kUnite, kIntersect, kSubtract };

  void push_operand(std::uint8_t operand) { steps_.push_back({true, operand, Join::kUnite}); }
  void push_join(Join join) { steps_.push_back({false, 0, join}); }
  /// Whether every joint finds two solids and one is left, over operands below `operands`.
  [[nodiscard]] bool is_complete(std::size_t operands) const;
  /// \param inside  per operand: bit b, inside at node b  \pre is_complete(inside.size()), at most kMaxOperands deep
  [[nodiscard]] std::uint64_t inside(std::span<const std::uint64_t> inside) const;

 private:
  struct Step {
    bool is_operand;
    std::uint8_t operand;
    Join join;
  };
  std::vector<Step> steps_;
};

}  // namespace tessera
