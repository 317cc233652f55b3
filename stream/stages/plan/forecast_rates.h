/// \file forecast_rates.h
/// Measured rates of what several stages read and write; what only one knows stands beside it. Processor time is that of one
/// core of an EPYC at about 3 GHz: `tools/bench` prints it.
#pragma once

namespace tessera::rates {

// Bytes on disk, as the files' headers give them.
inline constexpr double kRunBytes = 24.0;
inline constexpr double kStoreBytes = 24.3;     // records and tables, bricks of some thousand points
inline constexpr double kOverlayBytes = 9.0;    // normals and boundary surfels
inline constexpr double kPatchBytes = 21.0;     // per face
inline constexpr double kFirstPassBytes = 6.4;  // per face, instead of that, where stores are fused
inline constexpr double kOutputBytes = 19.0;    // per face: 13 bytes a face, half a vertex of 12
inline constexpr double kDiskBytesPerSecond = 8e8;

inline constexpr double kFacesMargin = 1.2;  // within that the estimate of all faces was right

}  // namespace tessera::rates
