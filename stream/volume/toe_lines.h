/// \file toe_lines.h
/// The toe of a heap or the edge of a pit: heights of a mesh along the outline of a polygon, exact where the outline crosses
/// edges of the mesh.
#pragma once
#include <cstdint>
#include <mutex>
#include <vector>

#include "stream/volume/plan_faces.h"
#include "stream/volume/volume_areas.h"

namespace tessera {

/// What one face has over one edge of an area.
struct ToePiece {
  std::uint32_t area = 0, edge = 0;
  double begin = 0.0, end = 0.0;  ///< along the edge, of [0, 1]
  double height[2] = {0.0, 0.0};  ///< there
  double steepness = 0.0;         ///< rise of the face over its plan: of a level one 0
  bool operator<(const ToePiece& o) const;
};

/// The pieces of one face. \param faces  of the window
void add_toe_pieces(const std::vector<PlanFace>& faces, const std::vector<AreaWindow>& windows,
                    std::vector<ToePiece>& pieces);

struct ToePoint {
  Double2 at{};
  double height = 0.0;
  double along = 0.0;  ///< distance from the first corner of the ring
  double steepness = 0.0;
};

/// One ring of an area.
struct ToeRing {
  std::vector<ToePoint> points;  ///< corners of the ring and where it crosses edges of the mesh, in order
  double length = 0.0;
  double uncovered = 0.0;   ///< length without mesh
  double widest_gap = 0.0;  ///< longest piece without mesh
  Double2 gap_at{};         ///< where that begins
};

/// The rings of area `k`. Where several faces lie over the outline the highest counts; over gaps heights run straight from one
/// end to the other. \param pieces  of all areas, sorted
std::vector<ToeRing> toe_rings(const VolumeArea& area, std::uint32_t k, const std::vector<ToePiece>& pieces);

}  // namespace tessera
