/// \file hole_mesh.h
/// The growing mesh of one hole's filling: triangles with their neighbours, split and flipped in canonical
/// order.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/holes/hole_filling.h"

namespace tessera {

class HoleMesh {
 public:
  static constexpr std::uint32_t kBoundary = 0xffffffffu;  ///< neighbour beyond the loop

  /// Edge e of a triangle runs from vertex[e] to vertex[(e + 1) % 3].
  struct Triangle {
    std::array<std::uint32_t, 3> vertex;
    std::array<std::uint32_t, 3> neighbour;  ///< across each edge: triangle, or kBoundary
  };

  HoleMesh(const HoleLoop& loop, const std::vector<std::array<std::uint32_t, 3>>& faces);

  /// Splits inner edges that are much longer than `edge`, longest first, until none is left or `maximum`
  /// vertices are new; flips to the Delaunay criterion after every round.
  void refine(double edge, std::size_t maximum);
  /// `rounds` times: every inner vertex to the mean of its neighbours, all at once, then flips.
  void relax(int rounds);

  [[nodiscard]] std::uint32_t boundary() const { return boundary_; }
  [[nodiscard]] const std::vector<Triangle>& triangles() const { return triangles_; }
  std::vector<Double3>& positions() { return position_; }  ///< the loop's first
  [[nodiscard]] const std::vector<std::uint32_t>& colours() const { return rgba_; }

 private:
  std::uint32_t side_of(std::uint32_t triangle, std::uint32_t neighbour) const;
  void replace_neighbour(std::uint32_t triangle, std::uint32_t was, std::uint32_t is);
  double squared_length(const Triangle& t, std::uint32_t e) const;
  double longest_inner() const;
  void split(std::uint32_t triangle, std::uint32_t e);
  bool joined(std::uint32_t from, std::uint32_t triangle, std::uint32_t to) const;
  bool wants_flip(std::uint32_t triangle, std::uint32_t e) const;
  void flip(std::uint32_t triangle, std::uint32_t e);
  void flip_all();

  const HoleLoop* loop_;
  std::uint32_t boundary_;
  std::vector<Double3> position_;
  std::vector<std::uint32_t> rgba_;
  std::vector<Triangle> triangles_;
};

}  // namespace tessera
