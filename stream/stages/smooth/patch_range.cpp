#include "stream/stages/smooth/patch_range.h"

#include <algorithm>
#include <cmath>

#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"

namespace tessera {

PatchEdges edges_of(const MeshBlock& block) {
  double longest = 0.0, squares = 0.0;
  for (const auto& face : block.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 &p = block.position[face[k]], &q = block.position[face[(k + 1) % 3]];
      const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      const double square = x * x + y * y + z * z;
      longest = std::max(longest, square);
      squares += square;
    }
  // A last bit more, so that the bound holds however it was rounded.
  return {std::sqrt(longest) * (1.0 + 1e-12), squares};
}

double PatchRange::edge(std::uint64_t faces) const {
  double sum = 0.0;
  for (const double squares : edge_squares) sum += squares;
  return faces > 0 ? std::sqrt(sum / (3.0 * static_cast<double>(faces))) : 0.0;
}

void PatchRange::save(const std::filesystem::path& path) const {
  DirectFile file(path);
  for (const auto* values : {&longest_edge, &edge_squares})
    if (!values->empty()) file.write(values->data(), values->size() * sizeof(double));
  file.finish();
}

PatchRange PatchRange::load(const std::filesystem::path& path) {
  const ReadFile file(path);
  PatchRange range;
  const std::uint64_t bytes = file.size() / 2;
  std::uint64_t offset = 0;
  for (auto* values : {&range.longest_edge, &range.edge_squares}) {
    values->resize(bytes / sizeof(double));
    file.read_at(offset, values->data(), values->size() * sizeof(double));
    offset += bytes;
  }
  return range;
}

PatchRange range_of(const std::vector<Json>& summaries, std::size_t patches) {
  PatchRange range;
  range.longest_edge.resize(patches);
  range.edge_squares.resize(patches);
  for (const Json& s : summaries)
    for (const Json& entry : s.at("edges")) {
      const auto p = entry.at(0).get<std::size_t>();
      range.longest_edge.at(p) = entry.at(1).get<double>();
      range.edge_squares.at(p) = entry.at(2).get<double>();
    }
  return range;
}

}  // namespace tessera
