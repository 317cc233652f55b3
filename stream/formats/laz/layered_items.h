/// \file layered_items.h
/// Items of point formats 6 to 10: every attribute of a chunk in a layer of its own, so that what nobody wants need not
/// be read, with models by scanner channel. Source: ASPRS LAZ specification 1.4 (items version 3), LASzip (version 4).
#pragma once
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "stream/formats/laz/colour_coder.h"
#include "stream/formats/laz/gps_time_coder.h"
#include "stream/formats/laz/integer_coder.h"
#include "stream/formats/laz/point_contexts.h"
#include "stream/formats/laz/pointwise_items.h"
#include "stream/formats/laz/symbol_model.h"
#include "stream/formats/laz/wave_coder.h"

namespace tessera::laz {

/// A coder of one layer.
template <class Coder>
struct Layer {
  Coder coder;
  bool on = true;  ///< coded; a layer that is off leaves its attribute as it was
  bool changed =
      false;  ///< an attribute differs from the one before: a layer without any need not be written
};

inline constexpr std::size_t kPoint14Bytes = 30;
enum Point14Layer : std::size_t {
  kXy,
  kZ,
  kKind,
  kFlags,
  kIntensity,
  kAngle,
  kUser,
  kSource,
  kTime,
  kPoint14Layers
};

/// The first 30 bytes of a record, unpacked.
struct Point14 {
  std::int32_t x = 0, y = 0, z = 0;
  std::uint16_t intensity = 0, source = 0;
  std::uint8_t number = 0, of = 0;
  std::uint8_t flags = 0;  ///< classification flags: 4 bits, direction, edge
  std::uint8_t channel = 0, kind = 0, user = 0;
  std::int16_t angle = 0;
  std::uint64_t time = 0;  ///< bits of the double

  void load(const char* r) {
    const auto byte = [r](std::size_t at) { return static_cast<std::uint8_t>(r[at]); };
    std::memcpy(&x, r, 4), std::memcpy(&y, r + 4, 4), std::memcpy(&z, r + 8, 4);
    std::memcpy(&intensity, r + 12, 2);
    number = byte(14) & 15u, of = static_cast<std::uint8_t>(byte(14) >> 4);
    flags = static_cast<std::uint8_t>((byte(15) & 15u) | (byte(15) >> 6) << 4);
    channel = byte(15) >> 4 & 3u;
    kind = byte(16), user = byte(17);
    std::memcpy(&angle, r + 18, 2), std::memcpy(&source, r + 20, 2), std::memcpy(&time, r + 22, 8);
  }
  void store(char* r) const {
    std::memcpy(r, &x, 4), std::memcpy(r + 4, &y, 4), std::memcpy(r + 8, &z, 4);
    std::memcpy(r + 12, &intensity, 2);
    r[14] = static_cast<char>(number | of << 4);
    r[15] = static_cast<char>((flags & 15u) | static_cast<unsigned>(channel) << 4 |
                              static_cast<unsigned>(flags >> 4) << 6);
    r[16] = static_cast<char>(kind), r[17] = static_cast<char>(user);
    std::memcpy(r + 18, &angle, 2), std::memcpy(r + 20, &source, 2), std::memcpy(r + 22, &time, 8);
  }
};

class Point14Coder {
 public:
  void start(const char* record) {
    Point14 first;
    first.load(record);
    at_ = first.channel;
    channels_[at_] = std::make_unique<Channel>(first);
  }
  unsigned channel() const { return at_; }

  /// Codes a record in place. Returns whether its scanner channel is another than that of the record before.
  template <class Coder>
  bool code(std::array<Layer<Coder>, kPoint14Layers>& layers, char* record) {
    Point14 now;
    if constexpr (Coder::kEncodes) now.load(record);
    Coder& xy = layers[kXy].coder;
    const Channel& before = *channels_[at_];
    SymbolModel& changes = channels_[at_]->changed[before.context()];
    unsigned target = at_;
    unsigned changed = 0;
    if constexpr (Coder::kEncodes) {
      target = now.channel;
      open(target);
      changed = difference(now, channels_[target]->last) | (target != at_ ? kOtherChannel : 0u);
    }
    changed = xy.symbol(changes, changed);
    const bool switched = (changed & kOtherChannel) != 0;
    if (switched) {
      const unsigned steps = xy.symbol(channels_[at_]->channel_step, (target + 3 - at_) & 3u);
      target = (at_ + steps + 1) & 3u;
      open(target);
      at_ = target;
    }
    Channel& c = *channels_[at_];
    c.last.channel = static_cast<std::uint8_t>(at_);
    code_returns(xy, c, changed, now);
    code_position(layers, c, changed, now);
    code_rest(layers, c, changed, now);
    c.time_changed = (changed & kTimeChanged) != 0;
    c.last.store(record);
    return switched;
  }

 private:
  enum Changed : unsigned {
    kNumber = 3,  ///< 1: the next, 2: the one before, 3: another
    kOf = 4,
    kAngleChanged = 8,
    kTimeChanged = 16,
    kSourceChanged = 32,
    kOtherChannel = 64,
  };

  struct Channel {
    explicit Channel(const Point14& first) : last(first) {
      heights.fill(first.z);
      intensities.fill(first.intensity);
      times.start(first.time);
    }
    /// First and last return, and whether the time changed.
    unsigned context() const {
      return (last.number == 1 ? 1u : 0u) | (last.number >= last.of ? 2u : 0u) | (time_changed ? 4u : 0u);
    }

    Point14 last;
    bool time_changed = false;
    std::array<std::int32_t, 8> heights;
    std::array<std::uint16_t, 8> intensities;
    std::array<StreamingMedian, 12> steps_x, steps_y;
    ModelSet<8, 128> changed;
    SymbolModel channel_step{3}, number_same_time{13};
    ModelSet<16, 16> of, number;
    ModelSet<64, 256> kinds, users;
    ModelSet<64, 64> flags;
    IntegerCoder x{32, 2}, y{32, 22}, z{32, 20}, intensity{16, 4}, angle{16, 2}, source{16};
    GpsTimeCoder<false> times;
  };

  /// A channel begins with the last point of the one before it.
  void open(unsigned channel) {
    if (!channels_[channel]) channels_[channel] = std::make_unique<Channel>(channels_[at_]->last);
  }

  static unsigned difference(const Point14& now, const Point14& last) {
    const unsigned number = (now.number - last.number) & 15u;
    return (number == 0    ? 0u
            : number == 1  ? 1u
            : number == 15 ? 2u
                           : 3u) |
           (now.of != last.of ? kOf : 0u) | (now.angle != last.angle ? kAngleChanged : 0u) |
           (now.time != last.time ? kTimeChanged : 0u) | (now.source != last.source ? kSourceChanged : 0u);
  }

  template <class Coder>
  static void code_returns(Coder& xy, Channel& c, unsigned changed, const Point14& now) {
    Point14& last = c.last;
    if (changed & kOf) last.of = static_cast<std::uint8_t>(xy.symbol(c.of[last.of], now.of));
    const unsigned kind = changed & kNumber;
    unsigned number = last.number;
    if (kind == 1) number += 1;
    if (kind == 2) number += 15;
    if (kind == 3) {
      if (changed & kTimeChanged)
        number = xy.symbol(c.number[number], now.number);
      else
        number += 2 + xy.symbol(c.number_same_time, (now.number - number - 2) & 15u);
    }
    last.number = number & 15u;
  }

  template <class Coder>
  static void code_position(std::array<Layer<Coder>, kPoint14Layers>& layers, Channel& c, unsigned changed,
                            const Point14& now) {
    Point14& last = c.last;
    const unsigned steps = return_context_6(last.number, last.of) << 1 | (changed & kTimeChanged ? 1u : 0u);
    const unsigned single = last.of == 1 ? 1 : 0;
    const std::int32_t dx =
        c.x.code(layers[kXy].coder, c.steps_x[steps].middle(), minus(now.x, last.x), single);
    c.steps_x[steps].add(dx);
    const std::int32_t dy = c.y.code(layers[kXy].coder, c.steps_y[steps].middle(), minus(now.y, last.y),
                                     single + even_up_to(c.x.length(), 20));
    c.steps_y[steps].add(dy);
    last.x = plus(last.x, dx);
    last.y = plus(last.y, dy);
    if (!layers[kZ].on) return;
    std::int32_t& height = c.heights[return_level(last.number, last.of)];
    height =
        c.z.code(layers[kZ].coder, height, now.z, single + even_up_to((c.x.length() + c.y.length()) / 2, 18));
    last.z = height;
  }

  /// Layers that may be missing.
  template <class Coder>
  static void code_rest(std::array<Layer<Coder>, kPoint14Layers>& layers, Channel& c, unsigned changed,
                        const Point14& now) {
    Point14& last = c.last;
    const unsigned return_kind = (last.number == 1 ? 2u : 0u) | (last.number >= last.of ? 1u : 0u);
    const unsigned new_time = changed & kTimeChanged ? 1 : 0;
    const auto byte = [](Layer<Coder>& layer, SymbolModel& model, std::uint8_t& value, std::uint8_t actual) {
      if (!layer.on) return;
      layer.changed |= value != actual;
      value = static_cast<std::uint8_t>(layer.coder.symbol(model, actual));
    };
    byte(layers[kKind], c.kinds[(last.kind & 31u) << 1 | (return_kind == 3 ? 1u : 0u)], last.kind, now.kind);
    byte(layers[kFlags], c.flags[last.flags], last.flags, now.flags);
    if (Layer<Coder>& layer = layers[kIntensity]; layer.on) {
      layer.changed |= last.intensity != now.intensity;
      std::uint16_t& like = c.intensities[return_kind << 1 | new_time];
      like = last.intensity =
          static_cast<std::uint16_t>(c.intensity.code(layer.coder, like, now.intensity, return_kind));
    }
    if (Layer<Coder>& layer = layers[kAngle]; layer.on && (changed & kAngleChanged)) {
      layer.changed = true;
      last.angle = static_cast<std::int16_t>(c.angle.code(layer.coder, last.angle, now.angle, new_time));
    }
    byte(layers[kUser], c.users[last.user / 4], last.user, now.user);
    if (Layer<Coder>& layer = layers[kSource]; layer.on && (changed & kSourceChanged)) {
      layer.changed = true;
      last.source = static_cast<std::uint16_t>(c.source.code(layer.coder, last.source, now.source));
    }
    if (Layer<Coder>& layer = layers[kTime]; layer.on && new_time) {
      layer.changed = true;
      last.time = c.times.code(layer.coder, now.time);
    }
  }

  std::array<std::unique_ptr<Channel>, 4> channels_;
  unsigned at_ = 0;
};

/// What an item other than the point keeps by scanner channel: models, and the record before. Version 3 goes on from
/// the record of the channel before when it comes back to a channel that it knows, and takes every record that does not
/// switch for one of channel 0; version 4 does neither. Files hold what their version does.
template <class Models>
class ByChannel {
 public:
  /// \param bytes  of the item
  ByChannel(std::size_t bytes, bool version_4) : bytes_(bytes), version_4_(version_4) {}

  void start(unsigned channel, const char* record) {
    at_ = channel;
    states_[at_] = std::make_unique<State>(bytes_, record);
  }
  /// Calls code(models, last) for the record of this channel, which writes what it codes over `last`.
  template <class Code>
  void with(unsigned channel, bool switched, const Code& code) {
    if (!version_4_ && !switched) channel = 0;
    State* last = states_[at_].get();
    if (channel != at_) {
      at_ = channel;
      const bool known = states_[at_] != nullptr;
      if (!known) states_[at_] = std::make_unique<State>(bytes_, last->record.data());
      if (!known || version_4_) last = states_[at_].get();
    }
    code(states_[at_]->models, last->record.data());
  }

 private:
  struct State {
    State(std::size_t bytes, const char* from) : models(bytes), record(from, from + bytes) {}
    Models models;
    std::vector<char> record;
  };
  std::size_t bytes_;
  bool version_4_;
  std::array<std::unique_ptr<State>, 4> states_;
  unsigned at_ = 0;
};

/// RGB14 and RGBNIR14: 6 or 8 bytes in one layer or two.
struct Rgb14Models {
  explicit Rgb14Models(std::size_t) {}
  RgbCoder colours;
  NirCoder infrared;

  template <class Coder>
  void code(Layer<Coder>* layers, std::size_t bytes, char* last, char* record) {
    if (layers[0].on) {
      Rgb before, now;
      std::memcpy(before.data(), last, sizeof before);
      std::memcpy(now.data(), record, sizeof now);
      layers[0].changed |= before != now;
      now = colours.code(layers[0].coder, before, now);
      std::memcpy(last, now.data(), sizeof now);
    }
    if (bytes == 8 && layers[1].on) {
      std::uint16_t before, now;
      std::memcpy(&before, last + 6, 2), std::memcpy(&now, record + 6, 2);
      layers[1].changed |= before != now;
      now = infrared.code(layers[1].coder, before, now);
      std::memcpy(last + 6, &now, 2);
    }
  }
};

/// WAVEPACKET14: 29 bytes in one layer.
struct WavePacket14Models {
  explicit WavePacket14Models(std::size_t) {}
  WaveCoder waves;

  template <class Coder>
  void code(Layer<Coder>* layers, std::size_t bytes, char* last, char* record) {
    if (!layers[0].on) return;
    layers[0].changed |= std::memcmp(last, record, bytes) != 0;
    waves.code(layers[0].coder, last, record);
    std::memcpy(last, record, bytes);
  }
};

/// BYTE14: a layer for every extra byte.
struct Byte14Models {
  explicit Byte14Models(std::size_t bytes) : models(bytes) {
    for (SymbolModel& m : models) m = SymbolModel(256);
  }
  std::vector<SymbolModel> models;

  template <class Coder>
  void code(Layer<Coder>* layers, std::size_t bytes, char* last, char* record) {
    for (std::size_t b = 0; b < bytes; ++b) {
      if (!layers[b].on) continue;
      layers[b].changed |= last[b] != record[b];
      last[b] = static_cast<char>(code_byte(layers[b].coder, models[b], static_cast<std::uint8_t>(last[b]),
                                            static_cast<std::uint8_t>(record[b])));
    }
  }
};

/// An item beside the point: its layers, and its records one after the other, in place.
template <class Models>
class LayeredItem {
 public:
  LayeredItem(std::size_t bytes, bool version_4) : bytes_(bytes), channels_(bytes, version_4) {}
  void start(unsigned channel, const char* record) { channels_.start(channel, record); }
  template <class Coder>
  void code(Layer<Coder>* layers, unsigned channel, bool switched, char* record) {
    channels_.with(channel, switched, [&](Models& models, char* last) {
      models.code(layers, bytes_, last, record);
      std::memcpy(record, last, bytes_);
    });
  }

 private:
  std::size_t bytes_;
  ByChannel<Models> channels_;
};

}  // namespace tessera::laz
