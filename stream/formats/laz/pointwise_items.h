/// \file pointwise_items.h
/// Items of point formats 0 to 5, which take turns in one stream: versions 2 and 1 of each. An item begins with a raw
/// record and codes the ones after it, in place. Source: ASPRS LAZ specification 1.4; Isenburg, LASzip (2013).
#pragma once
#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "stream/formats/laz/colour_coder.h"
#include "stream/formats/laz/gps_time_coder.h"
#include "stream/formats/laz/integer_coder.h"
#include "stream/formats/laz/point_contexts.h"
#include "stream/formats/laz/symbol_model.h"
#include "stream/formats/laz/wave_coder.h"

namespace tessera::laz {

/// The first 20 bytes of a record as they lie in the file.
struct Point10 {
  std::int32_t x, y, z;
  std::uint16_t intensity;
  std::uint8_t returns;  ///< number: 3 bits, of: 3 bits, direction, edge
  std::uint8_t kind;
  std::uint8_t angle;
  std::uint8_t user;
  std::uint16_t source;
  unsigned number() const { return returns & 7u; }
  unsigned of() const { return returns >> 3 & 7u; }
  unsigned direction() const { return returns >> 6 & 1u; }
};
static_assert(sizeof(Point10) == 20);

inline std::int32_t minus(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b));
}
inline std::int32_t plus(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
}

/// Bytes that depend on what they were before.
template <class Coder>
std::uint8_t code_after(Coder& coder, ModelSet<256, 256>& models, std::uint8_t last, std::uint8_t actual) {
  return static_cast<std::uint8_t>(coder.symbol(models[last], actual));
}

class Point10Coder {
 public:
  void start(const char* record) { std::memcpy(&last_, record, sizeof last_); }

  template <class Coder>
  void code(Coder& coder, char* record) {
    Point10 now;
    std::memcpy(&now, record, sizeof now);
    unsigned changed = 0;
    if constexpr (Coder::kEncodes) {
      changed = (now.returns != last_.returns ? kReturns : 0u) |
                (now.intensity != intensities_[return_context_16(now.number(), now.of())] ? kIntensity : 0u) |
                (now.kind != last_.kind ? kKind : 0u) | (now.angle != last_.angle ? kAngle : 0u) |
                (now.user != last_.user ? kUser : 0u) | (now.source != last_.source ? kSource : 0u);
    }
    changed = coder.symbol(changed_, changed);
    Point10 p = last_;
    if (changed & kReturns) p.returns = code_after(coder, returns_, last_.returns, now.returns);
    const unsigned of = p.of();
    const unsigned context = return_context_16(p.number(), of);
    std::uint16_t& intensity = intensities_[context];
    if (changed & kIntensity)
      intensity =
          static_cast<std::uint16_t>(intensity_.code(coder, intensity, now.intensity, std::min(context, 3u)));
    p.intensity = intensity;
    if (changed & kKind) p.kind = code_after(coder, kinds_, last_.kind, now.kind);
    if (changed & kAngle)
      p.angle = static_cast<std::uint8_t>(code_byte(coder, angles_[p.direction()], last_.angle, now.angle));
    if (changed & kUser) p.user = code_after(coder, users_, last_.user, now.user);
    if (changed & kSource)
      p.source = static_cast<std::uint16_t>(source_.code(coder, last_.source, now.source));

    const unsigned single = of == 1 ? 1 : 0;
    const std::int32_t dx = x_.code(coder, steps_x_[context].middle(), minus(now.x, last_.x), single);
    p.x = plus(last_.x, dx);
    steps_x_[context].add(dx);
    const std::int32_t dy = y_.code(coder, steps_y_[context].middle(), minus(now.y, last_.y),
                                    single + even_up_to(x_.length(), 20));
    p.y = plus(last_.y, dy);
    steps_y_[context].add(dy);
    std::int32_t& height = heights_[return_level(p.number(), of)];
    p.z = height = z_.code(coder, height, now.z, single + even_up_to((x_.length() + y_.length()) / 2, 18));
    last_ = p;
    std::memcpy(record, &last_, sizeof last_);
  }

 private:
  enum Changed : unsigned { kSource = 1, kUser = 2, kAngle = 4, kKind = 8, kIntensity = 16, kReturns = 32 };

  Point10 last_{};
  std::array<std::uint16_t, 16> intensities_{};
  std::array<StreamingMedian, 16> steps_x_, steps_y_;
  std::array<std::int32_t, 8> heights_{};
  SymbolModel changed_{64};
  ModelSet<256, 256> returns_, kinds_, users_;
  ModelSet<2, 256> angles_;
  IntegerCoder intensity_{16, 4}, source_{16}, x_{32, 2}, y_{32, 22}, z_{32, 20};
};

class Point10CoderV1 {
 public:
  void start(const char* record) { std::memcpy(&last_, record, sizeof last_); }

  template <class Coder>
  void code(Coder& coder, char* record) {
    Point10 now;
    std::memcpy(&now, record, sizeof now);
    Point10 p = last_;
    const std::int32_t dx = x_.code(coder, median(steps_x_), minus(now.x, last_.x));
    p.x = plus(last_.x, dx);
    unsigned length = x_.length();
    const std::int32_t dy = y_.code(coder, median(steps_y_), minus(now.y, last_.y), std::min(length, 19u));
    p.y = plus(last_.y, dy);
    length = (length + y_.length()) / 2;
    p.z = z_.code(coder, last_.z, now.z, std::min(length, 19u));
    steps_x_[step_] = dx;
    steps_y_[step_] = dy;
    step_ = (step_ + 1) % 3;

    unsigned changed = 0;
    if constexpr (Coder::kEncodes) {
      changed = (now.intensity != last_.intensity ? kIntensity : 0u) |
                (now.returns != last_.returns ? kReturns : 0u) | (now.kind != last_.kind ? kKind : 0u) |
                (now.angle != last_.angle ? kAngle : 0u) | (now.user != last_.user ? kUser : 0u) |
                (now.source != last_.source ? kSource : 0u);
    }
    changed = coder.symbol(changed_, changed);
    if (changed & kIntensity)
      p.intensity = static_cast<std::uint16_t>(intensity_.code(coder, last_.intensity, now.intensity));
    if (changed & kReturns) p.returns = code_after(coder, returns_, last_.returns, now.returns);
    if (changed & kKind) p.kind = code_after(coder, kinds_, last_.kind, now.kind);
    if (changed & kAngle)
      p.angle = static_cast<std::uint8_t>(angle_.code(coder, last_.angle, now.angle, length < 3 ? 1 : 0));
    if (changed & kUser) p.user = code_after(coder, users_, last_.user, now.user);
    if (changed & kSource)
      p.source = static_cast<std::uint16_t>(source_.code(coder, last_.source, now.source));
    last_ = p;
    std::memcpy(record, &last_, sizeof last_);
  }

 private:
  enum Changed : unsigned { kSource = 1, kUser = 2, kAngle = 4, kKind = 8, kReturns = 16, kIntensity = 32 };
  static std::int32_t median(const std::array<std::int32_t, 3>& v) {
    return std::max(std::min(v[0], v[1]), std::min(std::max(v[0], v[1]), v[2]));
  }

  Point10 last_{};
  std::array<std::int32_t, 3> steps_x_{}, steps_y_{};
  std::size_t step_ = 0;
  SymbolModel changed_{64};
  ModelSet<256, 256> returns_, kinds_, users_;
  IntegerCoder intensity_{16}, angle_{8, 2}, source_{16}, x_{32}, y_{32, 20}, z_{32, 20};
};

/// GPS time, version 2.
class GpsTime11Coder {
 public:
  void start(const char* record) { times_.start(load(record)); }
  template <class Coder>
  void code(Coder& coder, char* record) {
    const std::uint64_t time = times_.code(coder, load(record));
    std::memcpy(record, &time, sizeof time);
  }
  static std::uint64_t load(const char* record) {
    std::uint64_t time;
    std::memcpy(&time, record, sizeof time);
    return time;
  }

 private:
  GpsTimeCoder<true> times_;
};

/// One sequence only, no negative multiples.
class GpsTime11CoderV1 {
 public:
  void start(const char* record) { time_ = GpsTime11Coder::load(record); }
  template <class Coder>
  void code(Coder& coder, char* record) {
    const std::uint64_t actual = GpsTime11Coder::load(record);
    const std::uint64_t difference = actual - time_;
    if (step_ == 0) {
      const unsigned how = coder.symbol(without_step_, difference == 0            ? 0
                                                       : fits_32_bits(difference) ? 1
                                                                                  : 2);
      if (how == 1) advance(step_ = integers_.code(coder, 0, static_cast<std::int32_t>(difference), 0));
      if (how == 2) time_ = code_whole(coder, actual);
    } else {
      unsigned symbol = kWhole;
      if (difference == 0)
        symbol = kSame;
      else if (fits_32_bits(difference))
        symbol =
            static_cast<unsigned>(nearest_multiple(static_cast<std::int32_t>(difference), step_, 0, kMax));
      symbol = coder.symbol(with_step_, symbol);
      if (symbol < kWhole)
        code_multiple(coder, static_cast<int>(symbol), static_cast<std::int32_t>(difference));
      if (symbol == kWhole) time_ = code_whole(coder, actual);
    }
    std::memcpy(record, &time_, sizeof time_);
  }

 private:
  static constexpr int kMax = 509;
  static constexpr unsigned kWhole = 510;
  static constexpr unsigned kSame = 511;

  template <class Coder>
  void code_multiple(Coder& coder, int multiple, std::int32_t difference) {
    const std::int32_t predicted = multiple == 0 ? step_ / 4 : times(multiple, step_);
    const unsigned context = multiple == 1   ? 1
                             : multiple == 0 ? 2
                             : multiple < 10 ? 3
                             : multiple < 50 ? 4
                                             : 5;
    const std::int32_t found = integers_.code(coder, predicted, difference, context);
    advance(found);
    if (multiple == 1) {
      step_ = found;
      odd_ = 0;
    } else if ((multiple == 0 || multiple == kMax) && ++odd_ > 3) {
      step_ = found;
      odd_ = 0;
    }
  }
  template <class Coder>
  static std::uint64_t code_whole(Coder& coder, std::uint64_t actual) {
    const std::uint64_t low = coder.raw(32, static_cast<std::uint32_t>(actual));
    return low | std::uint64_t{coder.raw(32, static_cast<std::uint32_t>(actual >> 32))} << 32;
  }
  void advance(std::int32_t step) { time_ += static_cast<std::uint64_t>(std::int64_t{step}); }

  std::uint64_t time_ = 0;
  std::int32_t step_ = 0;
  int odd_ = 0;
  SymbolModel without_step_{3};
  SymbolModel with_step_{512};
  IntegerCoder integers_{32, 6};
};

class Rgb12Coder {
 public:
  void start(const char* record) { std::memcpy(last_.data(), record, sizeof last_); }
  template <class Coder>
  void code(Coder& coder, char* record) {
    Rgb now;
    std::memcpy(now.data(), record, sizeof now);
    last_ = colours_.code(coder, last_, now);
    std::memcpy(record, last_.data(), sizeof last_);
  }

 private:
  Rgb last_{};
  RgbCoder colours_;
};

class Rgb12CoderV1 {
 public:
  void start(const char* record) { std::memcpy(last_.data(), record, sizeof last_); }
  template <class Coder>
  void code(Coder& coder, char* record) {
    std::array<std::uint8_t, 6> now;
    std::memcpy(now.data(), record, sizeof now);
    unsigned mask = 0;
    for (unsigned b = 0; b < 6; ++b) mask |= (now[b] != last_[b] ? 1u : 0u) << b;
    mask = coder.symbol(changed_, mask);
    for (unsigned b = 0; b < 6; ++b)
      if (mask >> b & 1u) last_[b] = static_cast<std::uint8_t>(bytes_.code(coder, last_[b], now[b], b));
    std::memcpy(record, last_.data(), sizeof last_);
  }

 private:
  std::array<std::uint8_t, 6> last_{};
  SymbolModel changed_{64};
  IntegerCoder bytes_{8, 6};
};

class WavePacket13Coder {
 public:
  void start(const char* record) { std::memcpy(last_.data(), record, kWaveBytes); }
  template <class Coder>
  void code(Coder& coder, char* record) {
    waves_.code(coder, last_.data(), record);
    std::memcpy(last_.data(), record, kWaveBytes);
  }

 private:
  std::array<char, kWaveBytes> last_{};
  WaveCoder waves_;
};

/// Extra bytes.
class BytesCoder {
 public:
  explicit BytesCoder(std::size_t bytes) : last_(bytes), models_(bytes) {
    for (SymbolModel& m : models_) m = SymbolModel(256);
  }
  void start(const char* record) { std::memcpy(last_.data(), record, last_.size()); }
  template <class Coder>
  void code(Coder& coder, char* record) {
    for (std::size_t b = 0; b < last_.size(); ++b)
      last_[b] = static_cast<std::uint8_t>(
          code_byte(coder, models_[b], last_[b], static_cast<std::uint8_t>(record[b])));
    std::memcpy(record, last_.data(), last_.size());
  }

 private:
  std::vector<std::uint8_t> last_;
  std::vector<SymbolModel> models_;
};

class BytesCoderV1 {
 public:
  explicit BytesCoderV1(std::size_t bytes) : last_(bytes), bytes_(8, static_cast<unsigned>(bytes)) {}
  void start(const char* record) { std::memcpy(last_.data(), record, last_.size()); }
  template <class Coder>
  void code(Coder& coder, char* record) {
    for (std::size_t b = 0; b < last_.size(); ++b)
      last_[b] = static_cast<std::uint8_t>(
          bytes_.code(coder, last_[b], static_cast<std::uint8_t>(record[b]), static_cast<unsigned>(b)));
    std::memcpy(record, last_.data(), last_.size());
  }

 private:
  std::vector<std::uint8_t> last_;
  IntegerCoder bytes_;
};

}  // namespace tessera::laz
