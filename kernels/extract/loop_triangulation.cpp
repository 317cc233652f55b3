#include "kernels/extract/loop_triangulation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr float kForbiddenCost = 1e30f;

float area(const LoopSamples& loop, std::size_t i, std::size_t j, std::size_t k) {
  const Float3 n = triangle_normal(loop.point[i], loop.point[j], loop.point[k]);
  return std::sqrt(dot(n, n));
}

using Split = std::array<std::array<std::uint8_t, kCellEdges>, kCellEdges>;

void emit(const Split& split, std::uint8_t from, std::uint8_t to, LoopTriangles& out) {
  if (to - from < 2) return;
  const std::uint8_t apex = split[from][to];
  out.triangle[static_cast<std::size_t>(out.count++)] = {from, apex, to};
  emit(split, from, apex, out);
  emit(split, apex, to, out);
}

}  // namespace

// Flattened: one in a large unit is otherwise left with calls in its innermost loops.
[[gnu::flatten]] void triangulate_loop(const LoopSamples& loop, LoopTriangles& out) {
  out.count = 0;
  const auto size = static_cast<std::size_t>(loop.size);
  if (size == 3) {
    out.count = 1;
    out.triangle[0] = {0, 1, 2};
    return;
  }
  if (size == 4) {  // no chord of a loop of four lies in a face
    out.count = 2;
    if (area(loop, 0, 1, 2) + area(loop, 0, 2, 3) <= area(loop, 0, 1, 3) + area(loop, 1, 2, 3)) {
      out.triangle[0] = {0, 1, 2};
      out.triangle[1] = {0, 2, 3};
    } else {
      out.triangle[0] = {0, 1, 3};
      out.triangle[1] = {1, 2, 3};
    }
    return;
  }
  std::array<std::array<float, kCellEdges>, kCellEdges> cost;
  Split split;
  for (std::size_t i = 0; i + 1 < size; ++i) cost[i][i + 1] = 0.0f;
  for (std::size_t span = 2; span < size; ++span) {
    for (std::size_t i = 0; i + span < size; ++i) {
      const std::size_t j = i + span;
      cost[i][j] = kForbiddenCost;
      split[i][j] = static_cast<std::uint8_t>(i + 1);
      if (span + 1 < size && common_face(loop.edge[i], loop.edge[j]) != 255) continue;
      for (std::size_t k = i + 1; k < j; ++k) {
        const float sides = cost[i][k] + cost[k][j];
        if (!(sides < cost[i][j])) continue;
        const float sum = sides + area(loop, i, k, j);
        if (sum < cost[i][j]) {
          cost[i][j] = sum;
          split[i][j] = static_cast<std::uint8_t>(k);
        }
      }
    }
  }
  if (cost[0][size - 1] < kForbiddenCost) emit(split, 0, static_cast<std::uint8_t>(size - 1), out);
}

void triangulate_border_loop(const LoopSamples& loop, const Float3& normal, LoopTriangles& out) {
  out.count = 0;
  const auto size = static_cast<std::size_t>(loop.size);
  std::array<std::array<float, kCellEdges>, kCellEdges> minimum;
  Split split;
  for (std::size_t i = 0; i + 1 < size; ++i) minimum[i][i + 1] = kForbiddenCost;
  for (std::size_t span = 2; span < size; ++span) {
    for (std::size_t i = 0; i + span < size; ++i) {
      const std::size_t j = i + span;
      minimum[i][j] = -kForbiddenCost;
      split[i][j] = static_cast<std::uint8_t>(i + 1);
      if (span + 1 < size && common_face(loop.edge[i], loop.edge[j]) != 255) continue;
      for (std::size_t k = i + 1; k < j; ++k) {
        const float here = dot(triangle_normal(loop.point[i], loop.point[k], loop.point[j]), normal);
        const float worst = std::min(here, std::min(minimum[i][k], minimum[k][j]));
        if (worst > minimum[i][j]) {
          minimum[i][j] = worst;
          split[i][j] = static_cast<std::uint8_t>(k);
        }
      }
    }
  }
  if (minimum[0][size - 1] > -kForbiddenCost) emit(split, 0, static_cast<std::uint8_t>(size - 1), out);
}

bool loop_crosses_itself(const LoopSamples& loop, const LoopTriangles& triangles, const Float3& centre) {
  const auto size = static_cast<std::size_t>(loop.size);
  const std::size_t count = triangles.count > 0 ? static_cast<std::size_t>(triangles.count) : size;
  std::array<ContactFace, kCellEdges> faces;
  std::size_t with_area = 0;
  for (std::size_t i = 0; i < count; ++i) {
    ContactFace& face = faces[with_area];
    const std::array<std::size_t, 3> fan = {i, i + 1 == size ? 0 : i + 1, size};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t at = triangles.count > 0 ? triangles.triangle[i][k] : fan[k];
      face.corner[k] = wide(at == size ? centre : loop.point[at]);
      face.vertex[k] = at;
    }
    if (collinear(face.corner[0], face.corner[1], face.corner[2])) continue;
    for (std::size_t other = 0; other < with_area; ++other)
      if (face_contact(faces[other], face) != FaceContact::kNone) return true;
    ++with_area;
  }
  return false;
}

}  // namespace tessera
