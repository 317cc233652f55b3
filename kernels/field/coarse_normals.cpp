#include "kernels/field/coarse_normals.h"

#include <array>
#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

/// Length of the mean of unit normals below which a block's normals disagree.
constexpr float kDisagree = 0.7f;
/// The two faces of a thin wall in one block: each has a mean at least so long, and their cosine is at most that.
constexpr float kOneFace = 0.8f;
constexpr float kOpposed = -0.7f;

/// Sums over the points of one face in a block.
struct Face {
  Float3 p = {0, 0, 0}, n = {0, 0, 0};  ///< positions relative to the block
  float count = 0.0f;
  bool is_one() const { return norm(n) >= kOneFace * count; }
};

/// Splits the points [begin, end) of a block by the side of the first normal. \returns whether they are two opposed faces
bool split_faces(const PointBlock& points, std::size_t begin, std::size_t end, const Float3& corner,
                 std::array<Face, 2>& faces) {
  Float3 first = {0, 0, 0};
  for (std::size_t i = begin; i < end; ++i) {
    const Float3 n = {points.nx[i], points.ny[i], points.nz[i]};
    if (n == Float3{0, 0, 0}) continue;
    if (first == Float3{0, 0, 0}) first = n;
    Face& face = faces[dot(n, first) < 0.0f ? 1 : 0];
    face.p = face.p + (Float3{points.x[i], points.y[i], points.z[i]} - corner);
    face.n = face.n + n;
    face.count += 1.0f;
  }
  return faces[1].count > 0.0f && faces[0].is_one() && faces[1].is_one() &&
         dot(faces[0].n, faces[1].n) <= kOpposed * norm(faces[0].n) * norm(faces[1].n);
}

}  // namespace

PointBlock average_normals(const PointBlock& points) {
  PointBlock out;
  out.origin = points.origin;
  out.cells = points.cells;
  const std::size_t n = points.size();
  const auto block_of = [](float v) { return std::floor(v * 0.5f); };
  for (std::size_t begin = 0; begin < n;) {
    const float bx = block_of(points.x[begin]), by = block_of(points.y[begin]),
                bz = block_of(points.z[begin]);
    // Positions relative to the block: the same floats whatever the origin of the points.
    float px = 0.0f, py = 0.0f, pz = 0.0f, nx = 0.0f, ny = 0.0f, nz = 0.0f, count = 0.0f;
    bool synthetic = false;
    std::size_t end = begin;
    for (; end < n; ++end) {
      const float x = points.x[end] - 2.0f * bx, y = points.y[end] - 2.0f * by, z = points.z[end] - 2.0f * bz;
      if (x < 0.0f || y < 0.0f || z < 0.0f || x >= 2.0f || y >= 2.0f || z >= 2.0f) break;
      if (points.nx[end] == 0.0f && points.ny[end] == 0.0f && points.nz[end] == 0.0f) continue;
      synthetic = synthetic || (!points.flags.empty() && (points.flags[end] & kPointSynthetic) != 0);
      px += x;
      py += y;
      pz += z;
      nx += points.nx[end];
      ny += points.ny[end];
      nz += points.nz[end];
      count += 1.0f;
    }
    if (synthetic) {
      begin = end;
      continue;
    }
    const auto push = [&](const Float3& sum, float of, const Float3& normal) {
      const auto quantum = [&](float coordinate, float corner) {
        return std::floor(coordinate / of * static_cast<float>(kQuantaPerCell) + 0.5f) /
                   static_cast<float>(kQuantaPerCell) +
               2.0f * corner;
      };
      out.x.push_back(quantum(sum[0], bx));
      out.y.push_back(quantum(sum[1], by));
      out.z.push_back(quantum(sum[2], bz));
      out.nx.push_back(normal[0]);
      out.ny.push_back(normal[1]);
      out.nz.push_back(normal[2]);
    };
    const float length = std::sqrt(nx * nx + ny * ny + nz * nz);
    std::array<Face, 2> faces;
    if (count > 0.0f && length < kDisagree * count &&
        split_faces(points, begin, end, {2.0f * bx, 2.0f * by, 2.0f * bz}, faces)) {
      for (const Face& f : faces) push(f.p, f.count, f.n * (1.0f / (norm(f.n) * std::sqrt(f.count))));
    } else if (count > 0.0f) {
      float scale = length > 0.0f ? 1.0f / (length * std::sqrt(count)) : 0.0f;
      if (length < kDisagree * count) {
        float minimum = 2.0f, lx = 0.0f, ly = 0.0f, lz = 0.0f;
        for (std::size_t p = begin; p < end; ++p) {
          const float d = points.nx[p] * nx + points.ny[p] * ny + points.nz[p] * nz;
          if (d >= minimum * count || (points.nx[p] == 0.0f && points.ny[p] == 0.0f && points.nz[p] == 0.0f))
            continue;
          minimum = d / count;
          lx = points.nx[p];
          ly = points.ny[p];
          lz = points.nz[p];
        }
        nx = lx;
        ny = ly;
        nz = lz;
        scale = 0.5f;
      }
      push({px, py, pz}, count, {nx * scale, ny * scale, nz * scale});
    }
    begin = end;
  }
  return out;
}

}  // namespace tessera
