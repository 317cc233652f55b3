// What CGAL says of a mesh: its faces that intersect, by pairs. The oracle of `check --crossings`, in a program of its own: no
// other target sees CGAL.
//   usage: cgal_crossings FILE    two numbers of 64 bits (vertices, faces), positions (3 doubles), corners (3 numbers of 64 bits)
//   prints a line "F G" for every pair, F < G, ascending
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <iterator>
#include <utility>
#include <vector>

int main(int count, char** words) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
  if (count != 2) return 2;
  std::ifstream file(words[1], std::ios::binary);
  const auto read = [&](auto& value) { file.read(reinterpret_cast<char*>(&value), sizeof value); };
  std::array<std::uint64_t, 2> size{};
  read(size);
  Mesh mesh;
  std::vector<Mesh::Vertex_index> vertex;
  for (std::uint64_t v = 0; v < size[0]; ++v) {
    std::array<double, 3> p{};
    read(p);
    vertex.push_back(mesh.add_vertex({p[0], p[1], p[2]}));
  }
  for (std::uint64_t f = 0; f < size[1]; ++f) {
    std::array<std::uint64_t, 3> c{};
    read(c);
    if (mesh.add_face(vertex.at(c[0]), vertex.at(c[1]), vertex.at(c[2])) == Mesh::null_face()) return 3;
  }
  if (!file) return 3;
  std::vector<std::pair<Mesh::Face_index, Mesh::Face_index>> pairs;
  CGAL::Polygon_mesh_processing::self_intersections(mesh, std::back_inserter(pairs));
  for (auto& [one, other] : pairs)
    if (other < one) std::swap(one, other);
  std::sort(pairs.begin(), pairs.end());
  for (const auto& [one, other] : pairs)
    std::cout << static_cast<std::uint32_t>(one) << ' ' << static_cast<std::uint32_t>(other) << '\n';
}
