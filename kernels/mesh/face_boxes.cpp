#include "kernels/mesh/face_boxes.h"

#include <algorithm>
#include <utility>

#include "octree/morton.h"

namespace tessera {
namespace {

std::uint64_t middle_code(const FaceBoxes::Box& b) {
  std::array<std::uint32_t, 3> at{};
  for (std::size_t k = 0; k < 3; ++k) at[k] = static_cast<std::uint32_t>((b.low[k] + b.high[k] + 65536) / 2);
  return morton_encode(at[0], at[1], at[2]);
}

}  // namespace

FaceBoxes::Bundle::Bundle() {
  for (auto& axis : low) axis.fill(kNothing.low[0]);
  for (auto& axis : high) axis.fill(kNothing.high[0]);
}

FaceBoxes::Box FaceBoxes::Bundle::lane(std::size_t l) const {
  Box b;
  for (std::size_t k = 0; k < 3; ++k) b.low[k] = low[k][l], b.high[k] = high[k][l];
  return b;
}

void FaceBoxes::Bundle::put(std::size_t l, const Box& box) {
  for (std::size_t k = 0; k < 3; ++k) low[k][l] = box.low[k], high[k][l] = box.high[k];
}

FaceBoxes::Box FaceBoxes::Bundle::around() const {
  Box b;
  for (std::size_t k = 0; k < 3; ++k) {
    b.low[k] = *std::min_element(low[k].begin(), low[k].end());
    b.high[k] = *std::max_element(high[k].begin(), high[k].end());
  }
  return b;
}

FaceBoxes::FaceBoxes(const Double3& low, const Double3& high) : low_(low) {
  for (std::size_t k = 0; k < 3; ++k) per_step_[k] = high[k] > low[k] ? kSteps / (high[k] - low[k]) : 0.0;
}

void FaceBoxes::build(std::span<const Box> boxes, Order order) {
  levels_.clear(), slot_of_.clear(), face_at_.clear();
  if (boxes.empty()) return;
  if (order == Order::kMorton) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> codes(boxes.size());
    for (std::uint32_t f = 0; f < boxes.size(); ++f) codes[f] = {middle_code(boxes[f]), f};
    std::sort(codes.begin(), codes.end());
    slot_of_.resize(boxes.size());
    for (const auto& [code, face] : codes) {
      slot_of_[face] = static_cast<std::uint32_t>(face_at_.size());
      face_at_.push_back(face);
    }
  }
  std::vector<Bundle> leaves((boxes.size() + kLanes - 1) / kLanes);
  for (std::size_t s = 0; s < boxes.size(); ++s) leaves[s / kLanes].put(s % kLanes, boxes[face_at(s)]);
  levels_.push_back(std::move(leaves));
  while (levels_.back().size() > 1) {
    const std::vector<Bundle>& below = levels_.back();
    std::vector<Bundle> next((below.size() + kLanes - 1) / kLanes);
    for (std::size_t b = 0; b < below.size(); ++b) next[b / kLanes].put(b % kLanes, below[b].around());
    levels_.push_back(std::move(next));
  }
}

void FaceBoxes::set(std::uint32_t face, const Box& box) {
  std::size_t at = slot_of(face);
  levels_[0][at / kLanes].put(at % kLanes, box);
  at /= kLanes;
  for (std::size_t level = 1; level < levels_.size(); ++level, at /= kLanes) {
    const Box before = levels_[level][at / kLanes].lane(at % kLanes);
    Box wider = before;
    wider.add(box);
    if (wider == before) return;
    levels_[level][at / kLanes].put(at % kLanes, wider);
  }
}

}  // namespace tessera
