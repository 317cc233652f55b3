/// \file points.h
/// Points as the job stores them, and the block of points that a kernel gets.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// No normal known. Octahedral codes never take this value.
inline constexpr std::uint32_t kNoNormal = 0xffffffffu;
inline constexpr std::uint32_t kNoSensor = 0xffffu;

/// One point on disk: 24 bytes, little endian. Position in quanta from the lattice origin.
/// Canonical order of points: Morton code of q (all 30 bits per axis), then the remaining fields
/// ascending, so that the order never depends on how the input arrived.
struct PointRecord {
  Int3 q = {0, 0, 0};
  std::uint32_t normal = kNoNormal;  ///< octahedral 16+16 bits, see encode_normal
  std::uint32_t rgba = 0;            ///< r | g<<8 | b<<16 | a<<24; alpha 0 = no colour
  std::uint16_t sensor = kNoSensor;  ///< index into the job's sensor table
  std::uint16_t flags = 0;
};
static_assert(sizeof(PointRecord) == 24);

/// Bits of PointRecord::flags.
enum PointFlag : std::uint16_t {
  kPointOutlier = 1,  ///< dropped by cleaning; later stages skip it
  kPointNotLast = 2,  ///< an earlier return of its pulse: something solid lies beyond
  kPointGround = 4,   ///< the scan's own classes say ground
  kPointVolumetric =
      8,  ///< strewn through space instead of lying on a surface; where the top surface stands in for it
  kPointSynthetic = 16,  ///< a sample of the top surface: nothing was measured just there
  kPointUnseen = 32,     ///< of these: of a wall or a hole that nobody saw
};

/// Unit vector to 16+16 bit octahedral code and back; error below 1e-4 rad. Exact on every machine
/// (only + - * / sqrt). A zero or non-finite vector gives kNoNormal.
[[nodiscard]] std::uint32_t encode_normal(float x, float y, float z);
[[nodiscard]] Float3 decode_normal(std::uint32_t code);
/// The same bits as encode_normal, decode_normal for `count` codes, several at a time.
void encode_normals(const float* nx, const float* ny, const float* nz, std::size_t count,
                    std::uint32_t* codes);
void decode_normals(const std::uint32_t* codes, std::size_t count, float* nx, float* ny, float* nz);

/// The points of one block and its halo, in canonical (global Morton) order, structure of arrays.
/// Positions are in cells relative to the block's min corner: exact floats, multiples of 1/1024.
struct PointBlock {
  Int3 origin = {0, 0, 0};  ///< global cell coordinates of the block's min corner
  Int3 cells = {0, 0, 0};   ///< core size in cells, each a multiple of kBrickCells
  std::vector<float> x, y, z;
  std::vector<float> nx, ny, nz;      ///< unit normals; zero where unknown
  std::vector<std::uint32_t> rgba;    ///< empty if the scan has no colour
  std::vector<std::uint16_t> sensor;  ///< empty unless asked for
  std::vector<std::uint16_t> flags;   ///< bits of PointFlag; empty unless asked for
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

}  // namespace tessera
