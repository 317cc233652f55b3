/// \file reference_mesh.h
/// The reference of a decimation as its tests walk over it: two faces a cache line, each with its bound and the marks of the walk
/// at hand; and what lines (creases and borders) of it are.
#pragma once
#include <bit>
#include <cstdint>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"

namespace tessera {

struct ReferenceMesh {
  struct alignas(32) Face {
    std::uint32_t vertex[3], stamp, opposite[3];
    std::uint32_t
        lines;  ///< edges as in CollapseFace::state, and in the upper bits the bound, rounded up to what they hold
    static constexpr std::uint32_t kLineBits = 0xffu;
    [[nodiscard]] float bound() const { return std::bit_cast<float>(lines & ~kLineBits); }
  };
  struct alignas(32) Vertex {
    Double3 at{};
    std::uint32_t stamp, slot;
  };

  ReferenceMesh() = default;
  /// \param heights  set max_height
  explicit ReferenceMesh(const CollapseMesh& mesh, bool heights = false);

  [[nodiscard]] const Face& face_of(std::uint32_t c) const { return faces[c >> 2]; }
  [[nodiscard]] std::uint32_t vertex(std::uint32_t c) const { return face_of(c).vertex[c & 3u]; }
  [[nodiscard]] std::uint32_t opposite(std::uint32_t c) const { return face_of(c).opposite[c & 3u]; }
  /// The edge opposite the corner.
  [[nodiscard]] bool is_line(std::uint32_t c) const {
    return (face_of(c).lines >> (c & 3u) & (kStateBorder | kStateCrease)) != 0;
  }
  /// The corner of the next face around the same vertex, counter-clockwise; kNoCorner where the fan ends.
  [[nodiscard]] std::uint32_t next_in_fan(std::uint32_t c) const {
    const std::uint32_t o = opposite(next_corner(c));
    return o == kNoCorner ? o : next_corner(o);
  }

  std::vector<Face> faces;
  std::vector<Vertex> vertices;
  std::vector<std::uint32_t> corner;  ///< of vertices, the first of an open fan
  std::vector<float> max_height;      ///< per vertex, of the triangles there
};

/// Follows the line of the reference that runs through u both ways to v and to q, where two lines end or meet too.
/// \param[out] deviation  every point of the line and of the straight edge from v to q lies within it of the other
/// \return false where the gap exceeds the limit or the line does not lead there
bool line_deviation(const ReferenceMesh& mesh, std::uint32_t u, std::uint32_t v, std::uint32_t q,
                    double limit, double& deviation);

/// The corners of the vertex of `start` in its fan, counter-clockwise from there on. \return whether the fan is closed
bool gather_fan(const ReferenceMesh& mesh, std::uint32_t start, std::vector<std::uint32_t>& fan);

/// The first corner of the fan of v on whose clockwise side a line runs; kNoCorner where none follows its first corner.
[[nodiscard]] std::uint32_t corner_behind_line(const ReferenceMesh& mesh, std::uint32_t v);

}  // namespace tessera
