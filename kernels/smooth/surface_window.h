/// \file surface_window.h
/// The part of a surface around a vertex that belongs to one of its smooth sides, as samples over a plane.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block.h"
#include "kernels/smooth/window_fit.h"

namespace tessera {

/// A plane with an orthonormal frame; n is its normal.
struct WindowFrame {
  Double3 origin = {}, a = {}, b = {}, n = {};
};

/// Spreads from face to face over those whose normals are like the side's, so neither a crease nor a thin wall lets
/// it through. Vertices beyond the radius wait until it grows.
class SurfaceWindow {
 public:
  /// Rings that a window reads.
  static constexpr int kRings = 20;

  /// All of these outlive the window.
  /// \param normals   m, filtered
  /// \param data      n, the positions that are fitted
  /// \param position  n, where the surface is taken to be
  /// \param known     n flags, 0 where star, normals or position may be others than in the whole mesh; empty: all are
  ///                  right
  SurfaceWindow(const MeshBlock& block, const FaceCorners& corners, std::span<const Float3> normals,
                std::span<const Double3> data, std::span<const Double3> position,
                std::span<const std::uint8_t> known = {});

  /// Begins at a vertex, with faces of its star. \param normal  unit, of the side
  void begin(std::uint32_t vertex, const Double3& normal, std::span<const std::uint32_t> faces);
  /// Adds what lies within the radius and is connected to the middle within it. \pre no smaller than before
  void grow(double radius);

  /// From now on a face is compared with the normal of this quadric (window_fit.h) where the face is met, and no longer
  /// with the side's: a curved surface goes on, a crease does not.
  void expect(const std::array<double, 6>& quadric);

  [[nodiscard]] const WindowFrame& frame() const { return frame_; }
  [[nodiscard]] const WindowSamples& samples() const { return samples_; }

  struct Taken {
    std::uint32_t vertex;
    int ring;
    float likeness;  ///< of its star's normals to the expected one, 0 to 1: the sample's weight
  };
  /// The vertex of every sample, in their order.
  [[nodiscard]] const std::vector<Taken>& taken() const { return taken_; }
  /// Whether nothing that was met since begin() may be other than in the whole mesh.
  [[nodiscard]] bool right() const { return right_; }

  [[nodiscard]] static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t faces) {
    return 4 * vertices + 8 * faces;
  }

 private:
  struct QueueEntry {
    std::uint32_t index;
    int ring;
  };
  struct FaceMark {
    std::uint32_t stamp = 0;  ///< even: its likeness is known; + 1: it belongs to the window
    float likeness = 0.0F;
  };
  void visit(std::uint32_t vertex, int ring);
  void take(std::uint32_t vertex, int ring);
  float likeness(std::uint32_t face, const Float3& expected);
  Float3 expected_normal(std::uint32_t vertex) const;

  const MeshBlock& block_;
  const FaceCorners& corners_;
  std::span<const Float3> normals_;
  std::span<const Double3> data_, position_;
  std::span<const std::uint8_t> known_;
  WindowFrame frame_;
  WindowSamples samples_;
  float inverse_width_;  ///< of the likeness
  std::array<double, 6> quadric_ = {};
  bool laplacians_ = false;  ///< the quadric is not zero
  double square_ = 0.0;      ///< of the radius
  std::uint32_t stamp_ = 0;
  std::vector<std::uint32_t> vertex_stamp_;  ///< n
  std::vector<FaceMark> face_mark_;          ///< m
  std::vector<QueueEntry> faces_, waiting_;
  std::vector<Taken> taken_;
  bool right_ = true;
  std::size_t next_face_ = 0;
};

}  // namespace tessera
