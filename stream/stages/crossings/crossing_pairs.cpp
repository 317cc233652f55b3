#include "stream/stages/crossings/crossing_pairs.h"

#include <algorithm>
#include <type_traits>

#include "stream/files/record_file.h"

namespace tessera {

static_assert(std::is_trivially_copyable_v<CrossingPair>, "kept as it lies in memory");

FaceKeys face_keys(const MeshBlock& block, std::size_t face) {
  FaceKeys keys = {block.key[block.faces[face][0]], block.key[block.faces[face][1]],
                   block.key[block.faces[face][2]]};
  std::rotate(keys.begin(), std::min_element(keys.begin(), keys.end()), keys.end());
  return keys;
}

namespace {

MeshBox box_of_face(const std::array<Double3, 3>& corners) {
  MeshBox box = {corners[0], corners[0]};
  for (const Double3& p : corners)
    for (std::size_t a = 0; a < 3; ++a)
      box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
  return box;
}

}  // namespace

MeshBox CrossingPair::box() const {
  const MeshBox one = box_of_face(corners[0]), other = box_of_face(corners[1]);
  MeshBox both;
  for (std::size_t a = 0; a < 3; ++a) {
    both.low[a] = std::min(one.low[a], other.low[a]);
    both.high[a] = std::max(one.high[a], other.high[a]);
  }
  return both;
}

MeshBox CrossingPair::shared_box() const {
  const MeshBox one = box_of_face(corners[0]), other = box_of_face(corners[1]);
  MeshBox both;
  for (std::size_t a = 0; a < 3; ++a) {
    both.low[a] = std::max(one.low[a], other.low[a]);
    both.high[a] = std::max(both.low[a], std::min(one.high[a], other.high[a]));
  }
  return both;
}

std::vector<CrossingPair> load_crossing_pairs(const std::vector<std::filesystem::path>& files) {
  constexpr std::size_t kPage = 1024;
  std::vector<CrossingPair> pairs;
  for (const std::filesystem::path& file : files)
    for_each_page<CrossingPair>(file, kPage, [&](std::span<const CrossingPair> page) {
      pairs.insert(pairs.end(), page.begin(), page.end());
    });
  std::sort(pairs.begin(), pairs.end(),
            [](const CrossingPair& a, const CrossingPair& b) { return a.face < b.face; });
  return pairs;
}

}  // namespace tessera
