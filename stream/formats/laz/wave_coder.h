/// \file wave_coder.h
/// Where the waveform of a point lies and how its ray runs, 29 bytes: WAVEPACKET13 version 1 and WAVEPACKET14. Source:
/// ASPRS LAZ specification 1.4.
#pragma once
#include <array>
#include <cstdint>
#include <cstring>

#include "stream/formats/laz/gps_time_coder.h"
#include "stream/formats/laz/integer_coder.h"
#include "stream/formats/laz/symbol_model.h"

namespace tessera::laz {

inline constexpr std::size_t kWaveBytes = 29;

class WaveCoder {
 public:
  /// \param last, now  29 bytes each: descriptor, offset (8), size, return location, x, y, z (4 each)
  template <class Coder>
  void code(Coder& coder, const char* last, char* now) {
    now[0] = static_cast<char>(coder.symbol(descriptor_, static_cast<std::uint8_t>(now[0])));
    const auto before = load<std::uint64_t>(last + 1);
    const auto size = load<std::uint32_t>(last + 9);
    const std::uint64_t difference = load<std::uint64_t>(now + 1) - before;
    unsigned how = difference == 0 ? 0 : difference == size ? 1 : fits_32_bits(difference) ? 2 : 3;
    how = coder.symbol(offset_by_[how_before_], how);
    how_before_ = how;
    std::uint64_t offset = before;
    if (how == 1) offset += size;
    if (how == 2) {
      step_ = steps_.code(coder, step_, static_cast<std::int32_t>(difference));
      offset += static_cast<std::uint64_t>(std::int64_t{step_});
    }
    if (how == 3) {
      const auto actual = load<std::uint64_t>(now + 1);
      offset = coder.raw(32, static_cast<std::uint32_t>(actual));
      offset |= std::uint64_t{coder.raw(32, static_cast<std::uint32_t>(actual >> 32))} << 32;
    }
    std::memcpy(now + 1, &offset, sizeof offset);
    number(coder, sizes_, 0, last + 9, now + 9);
    number(coder, returns_, 0, last + 13, now + 13);
    for (unsigned a = 0; a < 3; ++a) number(coder, rays_, a, last + 17 + 4 * a, now + 17 + 4 * a);
  }

 private:
  template <class T>
  static T load(const char* p) {
    T value;
    std::memcpy(&value, p, sizeof value);
    return value;
  }
  template <class Coder>
  static void number(Coder& coder, IntegerCoder& integers, unsigned context, const char* last, char* now) {
    const std::int32_t v = integers.code(coder, load<std::int32_t>(last), load<std::int32_t>(now), context);
    std::memcpy(now, &v, sizeof v);
  }

  unsigned how_before_ = 0;
  std::int32_t step_ = 0;
  SymbolModel descriptor_{256};
  ModelSet<4, 4> offset_by_;
  IntegerCoder steps_{32};
  IntegerCoder sizes_{32};
  IntegerCoder returns_{32};
  IntegerCoder rays_{32, 3};
};

}  // namespace tessera::laz
