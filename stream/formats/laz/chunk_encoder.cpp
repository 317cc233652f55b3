#include "stream/formats/laz/chunk_encoder.h"

#include <cstdint>
#include <cstring>

#include "stream/formats/laz/arithmetic_encoder.h"
#include "stream/formats/laz/chunk_items.h"

namespace tessera::laz {

namespace {

template <class Bytes>
void append(std::vector<char>& to, const Bytes& from) {
  to.insert(to.end(), from.begin(), from.end());
}

void append_u32(std::vector<char>& to, std::uint32_t value) {
  char bytes[4];
  std::memcpy(bytes, &value, 4);
  to.insert(to.end(), bytes, bytes + 4);
}

/// Calls code(record) with a copy of every record but the first: coders write what they code back.
template <class Code>
void each_after_first(std::string_view records, std::size_t bytes, const Code& code) {
  std::vector<char> record(bytes);
  for (std::size_t at = bytes; at < records.size(); at += bytes) {
    std::memcpy(record.data(), records.data() + at, bytes);
    code(record.data());
  }
}

}  // namespace

std::vector<char> encode_chunk(const Schema& schema, std::string_view records) {
  const std::size_t bytes = schema.record_bytes();
  std::vector<char> out;
  append(out, records.substr(0, bytes));
  if (!schema.layered()) {
    PointwiseItems items(schema);
    ArithmeticEncoder encoder;
    items.start(records.data());
    each_after_first(records, bytes, [&](char* record) { items.code(encoder, record); });
    encoder.finish();
    append(out, encoder.bytes());
    return out;
  }
  LayeredItems<ArithmeticEncoder> items(schema);
  items.start(records.data());
  each_after_first(records, bytes, [&](char* record) { items.code(record); });
  append_u32(out, static_cast<std::uint32_t>(records.size() / bytes));
  const auto written = [&](std::size_t i) { return i == kXy || i == kZ || items.layer(i).changed; };
  for (std::size_t i = 0; i < items.layer_count(); ++i) {
    Layer<ArithmeticEncoder>& layer = items.layer(i);
    layer.coder.finish();
    append_u32(out, written(i) ? static_cast<std::uint32_t>(layer.coder.bytes().size()) : 0);
  }
  for (std::size_t i = 0; i < items.layer_count(); ++i)
    if (written(i)) append(out, items.layer(i).coder.bytes());
  return out;
}

}  // namespace tessera::laz
