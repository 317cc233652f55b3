#include "stream/stages/smooth/vertices_back.h"

#include <algorithm>
#include <array>

#include "stream/files/direct_file.h"
#include "stream/files/record_file.h"

namespace tessera {
namespace {

constexpr std::size_t kBackPage = 4096;  ///< records read at a time
/// Of the way that smoothing moved a vertex, what is left to it once it was found so often.
constexpr std::array<double, 4> kWayLeft = {1.0, 0.5, 0.25, 0.0};
/// From this round on, vertices go all the way back: places that are still tangled would take too many rounds.
constexpr std::size_t kImpatient = 4;

Double3 part_way(const Double3& given, const Double3& smoothed, std::size_t times, bool floats) {
  const double share = kWayLeft[std::min(times, kWayLeft.size() - 1)];
  if (share == 0.0) return given;
  Double3 p = given + (smoothed - given) * share;
  if (floats)
    for (double& x : p) x = static_cast<double>(static_cast<float>(x));
  return p;
}

}  // namespace

VerticesBack::VerticesBack(const std::vector<std::vector<std::filesystem::path>>& rounds) {
  struct Found {
    std::uint64_t key;
    Double3 given;
  };
  std::vector<std::pair<Found, std::size_t>> all;  // and how much a round counts
  for (std::size_t r = 0; r < rounds.size(); ++r) {
    std::vector<Found> round;
    last_.clear();
    for (const std::filesystem::path& file : rounds[r])
      for_each_page<VertexBack>(file, kBackPage, [&](std::span<const VertexBack> page) {
        for (const VertexBack& v : page) round.push_back({v.key, v.given}), last_.push_back(v.at);
      });
    std::sort(round.begin(), round.end(), [](const Found& a, const Found& b) { return a.key < b.key; });
    const auto same = [](const Found& a, const Found& b) { return a.key == b.key; };
    round.erase(std::unique(round.begin(), round.end(), same), round.end());
    for (const Found& v : round) all.emplace_back(v, r < kImpatient ? 1 : kWayLeft.size());
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first.key < b.first.key; });
  for (const auto& [v, counts] : all) {
    if (keys_.empty() || keys_.back() != v.key)
      keys_.push_back(v.key), times_.push_back(0), given_.push_back(v.given);
    times_.back() = static_cast<std::uint8_t>(times_.back() + counts);
  }
}

std::uint64_t VerticesBack::save(const std::filesystem::path& path, std::vector<VertexBack>& found) {
  std::sort(found.begin(), found.end(),
            [](const VertexBack& a, const VertexBack& b) { return a.key < b.key; });
  const auto same = [](const VertexBack& a, const VertexBack& b) { return a.key == b.key; };
  found.erase(std::unique(found.begin(), found.end(), same), found.end());
  DirectFile file(path);
  if (!found.empty()) file.write(found.data(), found.size() * sizeof(VertexBack));
  return file.finish();
}

std::vector<std::pair<std::uint32_t, Double3>> VerticesBack::apply(MeshBlock& block, bool floats) const {
  std::vector<std::pair<std::uint32_t, Double3>> moved;
  if (block.key.empty()) return moved;
  const auto first = std::lower_bound(keys_.begin(), keys_.end(), block.key.front());
  auto at = block.key.begin();
  for (auto key = first; key != keys_.end() && *key <= block.key.back(); ++key) {
    at = std::lower_bound(at, block.key.end(), *key);
    if (at == block.key.end() || *at != *key) continue;
    const auto v = static_cast<std::size_t>(at - block.key.begin());
    const auto n = static_cast<std::size_t>(key - keys_.begin());
    moved.emplace_back(static_cast<std::uint32_t>(v), block.position[v]);
    block.position[v] = part_way(given_[n], block.position[v], times_[n], floats);
  }
  return moved;
}

}  // namespace tessera
