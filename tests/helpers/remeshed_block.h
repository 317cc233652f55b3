/// \file remeshed_block.h
/// A block remeshed by itself, and what holds of the result.
#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "kernels/certify/certificate.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/remesh/remesh.h"
#include "tests/helpers/mesh_checks.h"

namespace tessera::test {

/// Edges of one length, creases found, no rounding.
inline RemeshOptions options_for(double edge) {
  RemeshOptions o;
  o.edge = edge;
  o.iterations = 5;
  o.find_creases = true;
  o.float_positions = false;
  o.max_faces = 400000;
  o.first_key = std::uint64_t{1} << 63;
  return o;
}

/// With itself as the reference.
inline MeshBlock remeshed(MeshBlock block, const RemeshOptions& options, RemeshReport* report = nullptr,
                          const std::vector<std::uint64_t>& pinned = {}) {
  canonicalise(block);
  const MeshBlock reference = block;
  const RemeshReport r = remesh(block, reference, options, pinned);
  if (report) *report = r;
  return block;
}

inline MeshChecks checks_of(const MeshBlock& b) {
  IndexedMesh mesh;
  mesh.position = b.position;
  mesh.faces = b.faces;
  return check_mesh(mesh);
}

/// The proven distance both ways. \param scale  the tolerance that cells begin with
inline double certified(const MeshBlock& a, const MeshBlock& b, double scale) {
  const ClosestFaces there(b.position, b.faces, {}), back(a.position, a.faces, {});
  const CertificateOptions options{.tolerance = scale, .max_distance = 4.0 * scale, .area_unit = 0x1p-40};
  return std::max(certify_deviation({a.position, a.faces}, nullptr, there, options).upper,
                  certify_deviation({b.position, b.faces}, nullptr, back, options).upper);
}

}  // namespace tessera::test
