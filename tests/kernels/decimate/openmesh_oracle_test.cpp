// OpenMesh beside our arrays: its half-edges refuse what is no manifold, its decimater is what the field compares with.
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>
#include <limits>
#include <set>

#include <catch2/catch.hpp>

#include "kernels/decimate/decimate.h"
#include "kernels/mesh/closest_face.h"
#include "octree/edge_faces.h"
#include "octree/vector.h"
#include "tests/helpers/block_meshes.h"

namespace openmesh_oracle_test {
namespace {

using namespace tessera;

struct DoubleTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using TriMesh = OpenMesh::TriMesh_ArrayKernelT<DoubleTraits>;

/// \param[out] refused  faces at complex edges or vertices
TriMesh half_edges(const MeshBlock& block, std::size_t& refused) {
  TriMesh mesh;
  std::vector<TriMesh::VertexHandle> vertex;
  for (const Double3& p : block.position) vertex.push_back(mesh.add_vertex({p[0], p[1], p[2]}));
  refused = 0;
  for (const auto& f : block.faces)
    refused += !mesh.add_face(vertex[f[0]], vertex[f[1]], vertex[f[2]]).is_valid();
  return mesh;
}

std::size_t boundary_edges(const TriMesh& mesh) {
  std::size_t edges = 0;
  for (const auto e : mesh.edges()) edges += mesh.is_boundary(e);
  return edges;
}

MeshBlock block_of(const TriMesh& mesh) {
  MeshBlock block;
  for (const auto v : mesh.vertices()) {
    const auto& p = mesh.point(v);
    block.position.push_back({p[0], p[1], p[2]});
  }
  for (const auto f : mesh.faces()) {
    auto& face = block.faces.emplace_back();
    std::size_t k = 0;
    for (const auto v : mesh.fv_range(f)) face[k++] = static_cast<std::uint32_t>(v.idx());
  }
  return block;
}

/// Root mean square of the distances from the vertices of one mesh to the faces of another.
double rms(const MeshBlock& from, const MeshBlock& to) {
  const ClosestFaces faces(to.position, to.faces, {0, 0, 0});
  double sum = 0.0;
  for (const Double3& p : from.position)
    sum += faces.closest(p, std::numeric_limits<double>::infinity(), ClosestFaces::kNone).square;
  return std::sqrt(sum / static_cast<double>(from.position.size()));
}

/// Our plain quadrics down to so many faces.
MeshBlock decimated(const MeshBlock& block, std::size_t faces) {
  DecimateOptions options;
  options.sweep = false;
  MeshBlock all = block;
  const DecimateReport report = decimate(all, all, options);
  options.max_cost_class = cost_class_for(report.cost_histogram, report.faces_in, faces);
  MeshBlock out = block;
  decimate(out, out, options);
  return out;
}

TriMesh decimated_by_openmesh(const MeshBlock& block, std::size_t faces) {
  std::size_t refused = 0;
  TriMesh mesh = half_edges(block, refused);
  OpenMesh::Decimater::DecimaterT<TriMesh> decimater(mesh);
  OpenMesh::Decimater::ModQuadricT<TriMesh>::Handle quadric;
  decimater.add(quadric);
  decimater.module(quadric).unset_max_err();
  decimater.initialize();
  decimater.decimate_to_faces(0, faces);
  mesh.garbage_collection();
  return mesh;
}

struct Case {
  const char* name;
  MeshBlock block;
};

std::vector<Case> cases() {
  std::vector<Case> all = {{"sphere", test::sphere_block(4)},
                           {"cube", test::cube_block(16)},
                           {"waves", test::grid_block(48, 48, [](double x, double y) {
                              return std::sin(x / 5) * std::cos(y / 7);
                            })}};
  all.push_back({"with holes", test::piece_of(all[2].block, [](std::uint32_t v) { return v % 97 != 0; })});
  for (Case& c : all) test::add_noise(c.block, 0.002, 7);
  return all;
}

TEST_CASE("openmesh: its half-edges take every face of a decimated block, and count its boundary as ours do",
          "[unit]") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const MeshBlock out = decimated(c.block, c.block.faces.size() / 10);
    REQUIRE(out.faces.size() < c.block.faces.size() / 5);
    std::size_t refused = 0, alone = 0;
    const TriMesh mesh = half_edges(out, refused);
    CHECK(refused == 0);
    EdgeFaces(out.position.size(), out.faces)
        .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
          alone += half.size() == 1;
        });
    CHECK(boundary_edges(mesh) == alone);
    std::size_t refused_before = 0;
    const TriMesh before = half_edges(c.block, refused_before);
    REQUIRE(refused_before == 0);
    const auto euler = [](const TriMesh& m) {
      std::set<int> used;
      for (const auto f : m.faces())
        for (const auto v : m.fv_range(f)) used.insert(v.idx());
      return static_cast<std::int64_t>(used.size()) - static_cast<std::int64_t>(m.n_edges()) +
             static_cast<std::int64_t>(m.n_faces());
    };
    CHECK(euler(mesh) == euler(before));
  }
}

TEST_CASE("openmesh: a face too many at an edge is refused by it and counted by ours", "[unit]") {
  MeshBlock block = test::sphere_block(1);
  const auto f = block.faces.front();
  block.position.push_back({3, 3, 3});
  block.faces.push_back({f[1], f[0], static_cast<std::uint32_t>(block.position.size() - 1)});
  std::size_t refused = 0, crowded = 0;
  half_edges(block, refused);
  CHECK(refused == 1);
  EdgeFaces(block.position.size(), block.faces)
      .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
        crowded += half.size() > 2;
      });
  CHECK(crowded == 1);
}

TEST_CASE("openmesh: at as many faces its quadrics lie no nearer to the surface than ours", "[unit]") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const MeshBlock ours = decimated(c.block, c.block.faces.size() / 10);
    const MeshBlock theirs =
        block_of(decimated_by_openmesh(c.block, ours.faces.size() + 1));  // it takes two at once
    REQUIRE(theirs.faces.size() >= ours.faces.size());
    CHECK(rms(c.block, ours) <= 1.05 * rms(c.block, theirs));
  }
}

}  // namespace
}  // namespace openmesh_oracle_test
