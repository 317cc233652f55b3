/// \file solid_command.h
/// Commands that make closed meshes, and what is asked of these.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "tests/helpers/command.h"
#include "tests/helpers/mesh_files.h"

namespace tessera::test {

inline double volume(const WholeMesh& m) {
  double sum = 0.0;
  for (const MeshFace& f : m.faces) sum += dot(m.points[f[0]], cross(m.points[f[1]], m.points[f[2]]));
  return sum / 6.0;
}

/// Every edge has two faces that run along it in opposite directions.
inline bool is_closed(const WholeMesh& m) {
  std::map<std::pair<std::uint64_t, std::uint64_t>, int> runs;
  for (const MeshFace& f : m.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = f[k], b = f[(k + 1) % 3];
      int& seen = runs[std::minmax(a, b)];
      seen += a < b ? 1 : 1 << 8;
    }
  for (const auto& [edge, seen] : runs)
    if (seen != 1 + (1 << 8)) return false;
  return !m.faces.empty();
}

inline CommandResult solid_command(std::vector<std::string> words) {
  words.insert(words.end(), {"--no-html", "--progress", "none"});
  return tessera_command(words);
}

}  // namespace tessera::test
