/// \file vertex_clustering.h
/// A coarse copy of a mesh that is only streamed past: the vertices of one cell of a grid become one.
/// For looking at, not for work: nothing is proven about it, and thin parts may close up.
/// Sources: Rossignac and Borrel, "Multi-resolution 3D Approximations for Rendering Complex Scenes", 1993; Lindstrom,
/// "Out-of-Core Simplification of Large Polygonal Models", 2000 (the vertex of a cell by the quadrics of its faces).
#pragma once
#include <immintrin.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/decimate/cluster_vertex.h"
#include "octree/key_table.h"

namespace tessera {

/// An infinite grid with a corner at zero; up to 2^20 cells from there to each side, farther counts as there.
class ClusterLattice {
 public:
  /// \param cell  edge, > 0
  explicit ClusterLattice(double cell) : inverse_(1.0 / cell) {}
  /// Names the cell that holds p. \pre finite
  [[nodiscard]] std::uint64_t key(const Double3& p) const {
    alignas(32) std::array<std::uint64_t, 4> k;
    const __m256i at = coordinates(_mm256_set_pd(0.0, p[2], p[1], p[0]));
    _mm256_store_si256(reinterpret_cast<__m256i*>(k.data()),
                       _mm256_sllv_epi64(at, _mm256_set_epi64x(0, 2 * kBits, kBits, 0)));
    return k[0] | k[1] | k[2];
  }
  /// Those of the corners of a face, in its first three numbers. \pre finite
  [[nodiscard]] std::array<std::uint64_t, 4> keys(const std::array<Double3, 3>& p) const {
    alignas(32) std::array<std::uint64_t, 4> k;
    const __m256i x = coordinates(_mm256_set_pd(0.0, p[2][0], p[1][0], p[0][0])),
                  y = coordinates(_mm256_set_pd(0.0, p[2][1], p[1][1], p[0][1])),
                  z = coordinates(_mm256_set_pd(0.0, p[2][2], p[1][2], p[0][2]));
    _mm256_store_si256(
        reinterpret_cast<__m256i*>(k.data()),
        _mm256_or_si256(_mm256_or_si256(x, _mm256_slli_epi64(y, kBits)), _mm256_slli_epi64(z, 2 * kBits)));
    return k;
  }
  static constexpr int kBits = 21;  ///< of a coordinate in a key: x in the lowest
  static constexpr std::int64_t kMiddle = std::int64_t{1} << (kBits - 1);  ///< the coordinate at zero

 private:
  [[nodiscard]] __m256i coordinates(__m256d p) const {
    constexpr double kIntegers = 0x1p52;  // added to an integer below it, the low bits are that integer
    const __m256d cell = _mm256_add_pd(_mm256_floor_pd(_mm256_mul_pd(p, _mm256_set1_pd(inverse_))),
                                       _mm256_set1_pd(static_cast<double>(kMiddle)));
    const __m256d in = _mm256_min_pd(_mm256_max_pd(cell, _mm256_setzero_pd()),
                                     _mm256_set1_pd(static_cast<double>(2 * kMiddle - 1)));
    return _mm256_castpd_si256(
        _mm256_xor_pd(_mm256_add_pd(in, _mm256_set1_pd(kIntegers)), _mm256_set1_pd(kIntegers)));
  }
  double inverse_;
};

/// Finds the edge of cell at which a stream of vertices occupies about as many cells as allowed: counted on grids twice as coarse from one to
/// the next, and between two of them told from how their counts grow.
class ClusterSize {
 public:
  explicit ClusterSize(std::size_t max_cells) : max_(max_cells) {}
  void add(const Double3& p);  ///< what is not finite is skipped
  /// The finest of the sizes told (fourth roots of two apart) that keeps to the limit; 0 without two different points.
  [[nodiscard]] double cell() const;

 private:
  void coarsen();

  std::size_t max_;
  double cell_ = 0.0, farthest_ = 0.0;      ///< as far from zero as its keys reach
  std::uint64_t last_ = ~std::uint64_t{0};  ///< key
  KeyTable occupied_;
  Double3 first_{};
  bool has_first_ = false;
};

struct ClusteredMesh {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;  ///< mean of the corners, as points carry colours
  std::vector<std::array<std::uint32_t, 3>> faces;
};

/// One grid of `cell`. Faces whose corners lie in three cells stay, once each; all others only shape the vertices.
class VertexClustering {
 public:
  VertexClustering(double cell, std::size_t max_faces);
  /// \param corners  counter-clockwise; a face with one that is not finite is skipped
  /// \return false once more than max_faces would stay, or 5/8 as many cells are touched: take a larger cell and begin anew
  bool add(const std::array<Double3, 3>& corners, const std::array<std::uint32_t, 3>& rgba);
  /// \post a pure function of cell and faces in their order; cells are numbered as they come
  [[nodiscard]] ClusteredMesh finish() const;
  /// Upper bound of what it holds.
  [[nodiscard]] static std::size_t bytes(std::size_t max_faces) { return 288 * max_faces; }

 private:
  struct Cluster {
    ClusterVertex vertex;  ///< relative to the first corner of the cell
    Double3 first{};
  };

  /// Faces that follow one another mostly lie in the same cells: what a key of this hash was last.
  struct Recent {
    std::uint64_t key = ~std::uint64_t{0};  ///< no cell has it
    std::uint32_t number = 0;
  };
  std::uint32_t find(std::uint64_t key, const Double3& corner);

  double cell_;
  ClusterLattice grid_;
  std::size_t max_faces_, max_cells_;
  std::array<Recent, 256> recent_;
  KeyTable number_;  ///< of cells
  std::vector<Cluster> clusters_;
  KeyTable seen_;  ///< faces
  std::vector<std::array<std::uint32_t, 3>> faces_;
};

}  // namespace tessera
