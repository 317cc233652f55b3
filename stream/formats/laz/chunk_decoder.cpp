#include "stream/formats/laz/chunk_decoder.h"

#include <cstring>
#include <vector>

#include "stream/formats/laz/arithmetic_decoder.h"
#include "stream/formats/laz/chunk_items.h"

namespace tessera::laz {

namespace {

[[noreturn]] void refuse_leftovers() {
  throw Damage("bytes are left over after its last point");
}

class PointwiseDecoder final : public ChunkDecoder {
 public:
  PointwiseDecoder(const Schema& schema, ByteFeed& feed)
      : bytes_(schema.record_bytes()), feed_(feed), items_(schema) {}

  void decode(char* records, std::size_t count) override {
    for (std::size_t i = 0; i < count; ++i, records += bytes_) {
      if (decoded_ > 0) {
        items_.code(decoder_, records);
      } else {
        feed_.take(records, bytes_);
        items_.start(records);
        decoder_.start(feed_);
      }
      ++decoded_;
    }
  }
  void require_used_up() override {
    if (!feed_.empty()) refuse_leftovers();
  }

 private:
  std::size_t bytes_;
  ByteFeed& feed_;
  ArithmeticDecoder decoder_;
  PointwiseItems items_;
};

std::size_t layer_count(const Schema& schema) {
  std::size_t sum = 0;
  for (const Item& item : schema.items) sum += layers_of(item);
  return sum;
}

std::uint64_t head_bytes(const Schema& schema) {
  return schema.record_bytes() + 4 + 4 * layer_count(schema);
}

class LayeredDecoder final : public ChunkDecoder {
 public:
  LayeredDecoder(const Schema& schema, const OpenBytes& open, Layers layers)
      : bytes_(schema.record_bytes()), items_(schema), first_(bytes_) {
    const std::unique_ptr<ByteFeed> head = open(0, head_bytes(schema));
    head->take(first_.data(), first_.size());
    head->next_u32();  // number of points
    std::vector<std::uint32_t> sizes(items_.layer_count());
    for (std::uint32_t& s : sizes) s = head->next_u32();
    std::uint64_t at = head_bytes(schema);
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      Layer<ArithmeticDecoder>& layer = items_.layer(i);
      layer.on = sizes[i] > 0 && wanted(schema, layers, i);
      if (i == kXy && !layer.on) throw EndOfBytes();
      if (layer.on) {
        feeds_.push_back(open(at, at + sizes[i]));
        layer.coder.start(*feeds_.back());
      }
      at += sizes[i];
    }
    items_.start(first_.data());
  }

  void decode(char* records, std::size_t count) override {
    for (std::size_t i = 0; i < count; ++i, records += bytes_) {
      if (decoded_ == 0) {
        std::memcpy(records, first_.data(), bytes_);
      } else {
        items_.code(records);
      }
      ++decoded_;
    }
  }
  void require_used_up() override {
    for (const auto& feed : feeds_)
      if (!feed->empty()) refuse_leftovers();
  }

 private:
  static bool wanted(const Schema& schema, Layers layers, std::size_t layer) {
    if (layers == Layers::kAll) return true;
    if (layer < kPoint14Layers) return layer <= kFlags;
    if (layers == Layers::kNoColours || layer > kPoint14Layers) return false;
    // Colours follow the point, and near infrared is their second layer.
    const ItemType second = schema.items[1].type;
    return second == ItemType::kRgb14 || second == ItemType::kRgbNir14;
  }

  std::size_t bytes_;
  LayeredItems<ArithmeticDecoder> items_;
  std::vector<char> first_;
  std::vector<std::unique_ptr<ByteFeed>> feeds_;
};

}  // namespace

std::unique_ptr<ChunkDecoder> decode_pointwise(const Schema& schema, ByteFeed& feed) {
  return std::make_unique<PointwiseDecoder>(schema, feed);
}

LayeredHead read_layered_head(const Schema& schema, const OpenBytes& open) {
  const std::unique_ptr<ByteFeed> feed = open(schema.record_bytes(), head_bytes(schema));
  LayeredHead head;
  head.points = feed->next_u32();
  head.bytes = head_bytes(schema);
  for (std::size_t i = layer_count(schema); i > 0; --i) head.bytes += feed->next_u32();
  return head;
}

std::unique_ptr<ChunkDecoder> decode_layered(const Schema& schema, const OpenBytes& open, Layers layers) {
  return std::make_unique<LayeredDecoder>(schema, open, layers);
}

}  // namespace tessera::laz
