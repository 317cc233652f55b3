/// \file e57_scans.h
/// What the XML section of an E57 file says of its scans (data3D): where their records are, what a record holds, the
/// pose, the limits of colours. Images and everything else are passed over. Claims of the file, all of it.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/formats/e57/e57_pages.h"

namespace tessera {

/// What a field of a record is to us.
enum class E57Use : std::uint8_t {
  kX,  ///< cartesian
  kY,
  kZ,
  kRange,  ///< spherical, radians
  kAzimuth,
  kElevation,
  kNormalX,  ///< of the extension nor:
  kNormalY,
  kNormalZ,
  kRed,
  kGreen,
  kBlue,
  kCartesianState,  ///< 0 = valid, 1 = a direction alone, 2 = nothing
  kSphericalState,
  kColourState,  ///< 0 = valid
  kReturn,       ///< from 0
  kReturns,      ///< how many
  kIntensity,
  kRow,
  kColumn,
  kUses,  ///< how many there are
};

enum class E57Code : std::uint8_t { kInteger, kScaled, kSingle, kDouble };

/// A field of all records: one bytestream.
struct E57Field {
  E57Use use = E57Use::kX;
  E57Code code = E57Code::kDouble;
  std::int64_t minimum = 0;  ///< integers: stored is the value minus this, in `bits` bits
  std::int64_t maximum = 0;
  double scale = 1.0;  ///< scaled integers: (minimum + stored) * scale + offset
  double offset = 0.0;
  unsigned bits = 64;      ///< of a value; 0 where all are `minimum`
  double min_value = 0.0;  ///< values that can be there, as far as the file says; equal if it does not
  double max_value = 0.0;
  std::uint32_t stream = 0;  ///< index of its bytestream
};

struct E57Scan {
  std::uint32_t number = 0;      ///< in the file, from 1
  std::uint64_t section = 0;     ///< of the records: its place in the file (physical)
  std::uint64_t declared = 0;    ///< records, as the file says
  std::uint32_t streams = 0;     ///< bytestreams, wanted or not
  std::vector<E57Field> fields;  ///< those that have a use
  bool has_pose = false;
  std::array<double, 4> rotation = {1, 0, 0, 0};  ///< quaternion w x y z, as given
  Double3 translation{};
  std::array<double, 6> bounds;  ///< cartesian, scan's frame: min x, max x, min y, ...; NaN = not given
  std::array<double, 6> colour_limits;     ///< min red, max red, min green, ...; NaN = not given
  std::array<double, 2> intensity_limits;  ///< least and most; NaN = not given
  bool has_range_bounds = false;           ///< spherical bounds are given: the scan is in its scanner's frame

  E57Scan();
  /// The field of this use, null without one.
  const E57Field* find(E57Use use) const;
};

struct E57Scans {
  std::vector<E57Scan> scans;  ///< those that declare records
  std::uint32_t count = 0;     ///< all
};

/// Reads the XML section in bounded memory, whatever its size.
/// \throws InputError naming file and byte: XML that is not well-formed, a document type (entities), elements nested
///   deeper than 64, a word or tag of more than 1 MiB, a number that is none, limits upside down, more than 16384
///   scans, records in a code other than bitPackCodec
E57Scans read_e57_scans(E57Pages& pages, const E57Header& header);

}  // namespace tessera
