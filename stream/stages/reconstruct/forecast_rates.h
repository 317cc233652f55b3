/// \file forecast_rates.h
/// Measured rates by which a forecast tells disk, time and what only the work itself knows.
#pragma once
#include <algorithm>
#include <cstdint>

namespace tessera::rates {

// Bytes on disk, as the files' headers give them.
inline constexpr double kRunBytes = 24.0;
inline constexpr double kStoreBytes = 24.3;   // records and tables, bricks of some thousand points
inline constexpr double kOverlayBytes = 9.0;  // normals and boundary surfels
inline constexpr double kPatchBytes = 21.0;   // per face
inline constexpr double kOutputBytes = 19.0;  // per face: 13 bytes a face, half a vertex of 12

// Processor time on one core of an EPYC at about 3 GHz, microseconds per point or face. `tools/bench` prints
// them.
inline constexpr double kDistributeTime = 0.05;
inline constexpr double kOrderTime = 0.05;
inline constexpr double kSeenTime = 0.1;
inline constexpr double kShapeTime = 0.25;     // supporters of points with normals
inline constexpr double kEstimateTime = 0.95;  // normals too
inline constexpr double kLinksTime = 0.15;
inline constexpr double kOrientTime = 0.25;
inline constexpr double kTopTime = 0.45;  // of scenes from above
inline constexpr double kTopPointsTime = 0.07;
inline constexpr double kGroundCellsTime = 0.2;
inline constexpr double kGroundTime = 0.012;  // per byte of its blocks
inline constexpr double kTopBytes = 10.0;     // model and samples, of a forest
inline constexpr double kSkinBytes = 18.0;    // of a skin
/// Per face. Noisy samples are fitted again with wider radii, and look for sheets and creases that noise only feigns.
constexpr double surface_time(double noise_cells) {
  return 0.42 + 2.2 * std::min(1.0, noise_cells / 0.05);
}
inline constexpr double kWeldTime = 0.03;      // per face
inline constexpr double kUncrossTime = 0.2;    // per face, of scans that are mostly borders
inline constexpr double kBorderTime = 0.1;     // per face, of scans that are mostly borders
inline constexpr double kSamplesTime = 0.5;    // per point, of either pass
inline constexpr double kCoverageTime = 0.17;  // per face
inline constexpr double kWriteTime = 0.02;     // per face
// With --holes, per point and per face of the open surface; what closing itself takes only the holes know.
inline constexpr double kMultipoleTime = 0.1;
inline constexpr double kBoundaryTime = 0.4;
inline constexpr double kMultipoleBytes = 0.96;
inline constexpr double kBoundaryBytes = 1.5;
// With --tolerance, per face of full resolution.
inline constexpr double kFirstPassTime = 0.65;
inline constexpr double kFirstPassBytes = 6.4;  // instead of kPatchBytes
inline constexpr double kPass2Time = 0.27;
inline constexpr double kPass3Time = 0.13;
inline constexpr double kCertifyTime = 0.43;
inline constexpr double kPassBytes = 0.3;
// With --smooth, per face of full resolution: fits of denoise, filters; edges, and noise at a sample.
inline constexpr double kFitTime = 18.0;
inline constexpr double kFilterTime = 1.0;
inline constexpr double kRangeTime = 0.1;
// Of the import of a raw mesh, per face; its files against the mesh.
inline constexpr double kImportReadTime = 0.05;
inline constexpr double kImportVerticesTime = 0.1;
inline constexpr double kImportCornersTime = 0.1;
inline constexpr double kImportTilesTime = 0.4;
inline constexpr double kImportBytes = 1.0;
inline constexpr std::uint64_t kDealtVertexBytes = 32;
inline constexpr double kDiskBytesPerSecond = 8e8;

inline constexpr double kFacesMargin = 1.2;  // within that the estimate of all faces was right
/// Patches of an imported mesh that lie near one brick of points: itself and all around it.
inline constexpr std::uint64_t kImportedNear = 27;
/// What the end of a stage that has nothing to do reserves, at most.
inline constexpr std::uint64_t kIdleBytes = std::uint64_t{20} << 20;

}  // namespace tessera::rates
