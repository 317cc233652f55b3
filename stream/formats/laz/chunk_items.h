/// \file chunk_items.h
/// All items of one chunk together, for decoder and encoder alike.
#pragma once
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "stream/formats/laz/layered_items.h"
#include "stream/formats/laz/pointwise_items.h"
#include "stream/formats/laz/schema.h"

namespace tessera::laz {

/// Items of one stream, record by record.
class PointwiseItems {
 public:
  /// \pre  schema has been parsed, or made by schema_for
  explicit PointwiseItems(const Schema& schema) {
    std::size_t at = 0;
    const auto construct = [&](const Item& item, auto& version_1, auto& version_2, auto... sizes) {
      if (item.version == 1)
        version_1.emplace(at, sizes...);
      else
        version_2.emplace(at, sizes...);
    };
    for (const Item& item : schema.items) {
      if (item.type == ItemType::kPoint10) construct(item, point_1_, point_2_);
      if (item.type == ItemType::kGpsTime11) construct(item, gps_1_, gps_2_);
      if (item.type == ItemType::kRgb12) construct(item, rgb_1_, rgb_2_);
      if (item.type == ItemType::kWavePacket13) wave_.emplace(at);
      if (item.type == ItemType::kBytes) construct(item, bytes_1_, bytes_2_, std::size_t{item.bytes});
      at += item.bytes;
    }
  }
  void start(const char* record) {
    each([&](auto& item) { item.coder.start(record + item.at); });
  }
  template <class Coder>
  void code(Coder& coder, char* record) {
    each([&](auto& item) { item.coder.code(coder, record + item.at); });
  }

 private:
  template <class ItemCoder>
  struct Placed {
    template <class... Sizes>
    explicit Placed(std::size_t offset, Sizes... sizes) : at(offset), coder(sizes...) {}
    std::size_t at;  ///< offset in the record
    ItemCoder coder;
  };
  template <class Call>
  void each(const Call& call) {
    const auto one = [&](auto& item) {
      if (item) call(*item);
    };
    one(point_2_), one(point_1_), one(gps_2_), one(gps_1_), one(rgb_2_), one(rgb_1_), one(wave_),
        one(bytes_2_), one(bytes_1_);
  }

  std::optional<Placed<Point10Coder>> point_2_;
  std::optional<Placed<Point10CoderV1>> point_1_;
  std::optional<Placed<GpsTime11Coder>> gps_2_;
  std::optional<Placed<GpsTime11CoderV1>> gps_1_;
  std::optional<Placed<Rgb12Coder>> rgb_2_;
  std::optional<Placed<Rgb12CoderV1>> rgb_1_;
  std::optional<Placed<WavePacket13Coder>> wave_;
  std::optional<Placed<BytesCoder>> bytes_2_;
  std::optional<Placed<BytesCoderV1>> bytes_1_;
};

/// Number of layers that an item has.
inline std::size_t layers_of(const Item& item) {
  if (item.type == ItemType::kPoint14) return kPoint14Layers;
  if (item.type == ItemType::kRgbNir14) return 2;
  return item.type == ItemType::kBytes14 ? item.bytes : 1;
}

/// Items in layers, and the coder of every layer.
template <class Coder>
class LayeredItems {
 public:
  explicit LayeredItems(const Schema& schema) {
    std::size_t at = 0;
    std::size_t others = 0;
    for (const Item& item : schema.items) {
      const bool version_4 = item.version == 4;
      if (item.type == ItemType::kRgb14 || item.type == ItemType::kRgbNir14)
        colour_.emplace(at, others, item.bytes, version_4);
      if (item.type == ItemType::kWavePacket14) wave_.emplace(at, others, item.bytes, version_4);
      if (item.type == ItemType::kBytes14) bytes_.emplace(at, others, item.bytes, version_4);
      at += item.bytes;
      if (item.type != ItemType::kPoint14) others += layers_of(item);
    }
    others_.resize(others);
  }
  std::size_t layer_count() const { return kPoint14Layers + others_.size(); }
  Layer<Coder>& layer(std::size_t i) {
    return i < kPoint14Layers ? point_layers_[i] : others_[i - kPoint14Layers];
  }
  void start(const char* record) {
    point_.start(record);
    each([&](auto& item) { item.coder.start(point_.channel(), record + item.at); });
  }
  void code(char* record) {
    const bool switched = point_.code(point_layers_, record);
    each([&](auto& item) {
      item.coder.code(others_.data() + item.first_layer, point_.channel(), switched, record + item.at);
    });
  }

 private:
  template <class Models>
  struct Placed {
    Placed(std::size_t offset, std::size_t layer, std::size_t bytes, bool version_4)
        : at(offset), first_layer(layer), coder(bytes, version_4) {}
    std::size_t at;           ///< offset in the record
    std::size_t first_layer;  ///< in others_
    LayeredItem<Models> coder;
  };
  template <class Call>
  void each(const Call& call) {
    if (colour_) call(*colour_);
    if (wave_) call(*wave_);
    if (bytes_) call(*bytes_);
  }

  Point14Coder point_;
  std::array<Layer<Coder>, kPoint14Layers> point_layers_;
  std::vector<Layer<Coder>> others_;
  std::optional<Placed<Rgb14Models>> colour_;
  std::optional<Placed<WavePacket14Models>> wave_;
  std::optional<Placed<Byte14Models>> bytes_;
};

}  // namespace tessera::laz
