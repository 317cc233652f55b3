#include "stream/stages/smooth/vertices_back.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

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
  std::vector<std::uint64_t> all;
  for (std::size_t r = 0; r < rounds.size(); ++r) {
    const auto& files = rounds[r];
    std::vector<std::uint64_t> round;
    last_.clear();
    for (const std::filesystem::path& file : files)
      for_each_page<VertexBack>(file, kBackPage, [&](std::span<const VertexBack> page) {
        for (const VertexBack& v : page) round.push_back(v.key), last_.push_back(v.at);
      });
    std::sort(round.begin(), round.end());
    round.erase(std::unique(round.begin(), round.end()), round.end());
    for (std::size_t times = r < kImpatient ? 1 : kWayLeft.size(); times > 0; --times)
      all.insert(all.end(), round.begin(), round.end());
  }
  std::sort(all.begin(), all.end());
  for (const std::uint64_t key : all) {
    if (keys_.empty() || keys_.back() != key) keys_.push_back(key), times_.push_back(0);
    ++times_.back();
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

void VerticesBack::apply(MeshBlock& block, const MeshBlock& given, bool floats,
                         std::vector<std::uint32_t>* moved) const {
  if (block.key.empty()) return;
  const auto at = [](const MeshBlock& b, std::uint64_t key) {
    const auto found = std::lower_bound(b.key.begin(), b.key.end(), key);
    return found != b.key.end() && *found == key ? static_cast<std::size_t>(found - b.key.begin())
                                                 : b.key.size();
  };
  const auto first = std::lower_bound(keys_.begin(), keys_.end(), block.key.front());
  for (auto key = first; key != keys_.end() && *key <= block.key.back(); ++key) {
    const std::size_t v = at(block, *key);
    if (v == block.key.size()) continue;
    const std::size_t from = at(given, *key);
    if (from == given.key.size())
      throw std::logic_error("untangle: vertex " + std::to_string(*key) +
                             " is not in the given mesh's block");
    const std::uint8_t times = times_[static_cast<std::size_t>(key - keys_.begin())];
    block.position[v] = part_way(given.position[from], block.position[v], times, floats);
    if (moved != nullptr) moved->push_back(static_cast<std::uint32_t>(v));
  }
}

}  // namespace tessera
