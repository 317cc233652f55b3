// A mesh of OpenMesh is remeshed by Tessera and comes back.
#include <tessera/kernels.h>
#include <tessera/octree.h>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <iostream>

using Mesh = OpenMesh::TriMesh_ArrayKernelT<>;

static tessera::MeshBlock to_block(const Mesh& mesh) {
  std::vector<tessera::Double3> vertices;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const auto v : mesh.vertices()) {
    const auto p = mesh.point(v);
    vertices.push_back({p[0], p[1], p[2]});
  }
  for (const auto f : mesh.faces()) {
    std::array<std::uint32_t, 3> face{};
    std::size_t k = 0;
    for (const auto v : mesh.fv_range(f)) face[k++] = static_cast<std::uint32_t>(v.idx());
    faces.push_back(face);
  }
  return tessera::make_block(vertices, faces);
}

static Mesh from_block(const tessera::MeshBlock& block) {
  Mesh mesh;
  std::vector<Mesh::VertexHandle> vertex;
  for (const auto& p : block.position) {
    const tessera::Float3 f = tessera::narrow(p);
    vertex.push_back(mesh.add_vertex(Mesh::Point(f[0], f[1], f[2])));
  }
  for (const auto& f : block.faces) mesh.add_face(vertex[f[0]], vertex[f[1]], vertex[f[2]]);
  return mesh;
}

int main() {
  Mesh cube;
  std::vector<Mesh::VertexHandle> v;
  for (int i = 0; i < 8; ++i) v.push_back(cube.add_vertex(Mesh::Point(i & 1, i >> 1 & 1, i >> 2 & 1)));
  for (const auto& f : {std::array{0, 2, 3},
                        {0, 3, 1},
                        {4, 5, 7},
                        {4, 7, 6},
                        {0, 1, 5},
                        {0, 5, 4},
                        {2, 6, 7},
                        {2, 7, 3},
                        {0, 4, 6},
                        {0, 6, 2},
                        {1, 3, 7},
                        {1, 7, 5}})
    cube.add_face(v[f[0]], v[f[1]], v[f[2]]);
  tessera::MeshBlock block = to_block(cube);
  const tessera::MeshBlock reference = block;
  tessera::RemeshOptions options;
  options.edge = 0.1;
  options.find_creases = true;
  options.max_faces = 100000;
  options.first_key = reference.key.back() + 1;
  tessera::remesh(block, reference, options);
  const Mesh even = from_block(block);
  std::cout << even.n_faces() << " faces, closed: " << (even.n_edges() * 2 == even.n_faces() * 3) << "\n";
  return even.n_faces() > 1000 && even.n_edges() * 2 == even.n_faces() * 3 ? 0 : 1;
}
