/// \file colour_guard.h
/// Whether a collapse leaves the colours of a surface as they are: what is seen at the place of a vertex that goes is interpolated
/// between those that stay. Keeps borders of colours on flat faces, of which quadrics of positions know nothing.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// `--colour-tolerance auto`: four times what nine of ten edges of the mesh differ by, the most of their channels, and at least 8
/// levels. In a scan that is its noise and the grain of what it saw; borders of colours are fewer. 0 (any) where it would be
/// more than 255: no border stands out.
[[nodiscard]] double auto_colour_tolerance(const MeshBlock& mesh);

/// Small changes are noise, of which a mean is left; beyond a quarter of the tolerance they add up: a vertex bears what
/// those changed that it stands for, so that a colour does not creep across its border in small steps.
class ColourGuard {
 public:
  /// \param mesh, block  outlive it  \param tolerance  levels of 255 that a channel may change by; 0 = any
  ColourGuard(const CollapseMesh& mesh, const MeshBlock& block, double tolerance);

  [[nodiscard]] bool asks() const { return tolerance_ > 0.0; }
  /// Whether the colour at the place of u, the centre, stays within the tolerance where u goes to star.ring[at].
  /// \pre the collapse folds nothing
  [[nodiscard]] bool allows(std::uint32_t u, const Star& star, std::size_t at);
  /// Whether those at both ends do where the edge becomes one vertex, its colour blended. \param along  0 to 1, from u to v
  [[nodiscard]] bool allows_blend(std::uint32_t u, std::uint32_t v, double along);
  /// The collapse that was allowed last is done.
  void accept();
  /// Tells whether the colours alone keep u, as far as it was asked last.
  void keep(std::uint32_t u, bool kept) {
    if (asks()) kept_[u] = kept;
  }
  /// How many vertices they do. \pre no compact() since
  [[nodiscard]] std::size_t kept() const;
  /// After CollapseMesh::compact().
  void compact(const std::vector<std::uint32_t>& kept);

 private:
  using Colour = std::array<double, 3>;
  struct Corner {
    double x = 0.0, y = 0.0;  ///< from the centre, in the plane of the star
    Colour colour{};
  };

  [[nodiscard]] Colour colour(std::uint32_t v) const;
  bool flatten(std::uint32_t u, const Star& star);
  double change_at_foot(const Colour& own, const Star& star, std::size_t at);
  [[nodiscard]] double change_at_crossings(const Colour& own, const Star& star, std::size_t at) const;

  const CollapseMesh& mesh_;
  const MeshBlock& block_;
  const double tolerance_;
  std::vector<float> changed_;      ///< per vertex, levels beyond noise
  std::vector<std::uint8_t> kept_;  ///< per vertex
  std::array<Corner, kMaxRing + 1> ring_;
  struct Change {
    float levels = 0.0f;
    std::array<std::uint32_t, 3> heir{};  ///< vertices that stay
  } last_;
};

}  // namespace tessera
