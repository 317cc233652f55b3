#include "stream/formats/laz/schema.h"

#include <cstring>
#include <string>

#include "stream/formats/laz/byte_feed.h"
#include "stream/formats/scalar.h"

namespace tessera::laz {

namespace {

constexpr std::size_t kHeadBytes = 34;
constexpr std::size_t kItemBytes = 6;
constexpr std::size_t kMaxExtraBytes = 4096;  ///< each has a model of a kilobyte

bool is_layered_type(ItemType type) {
  return type >= ItemType::kPoint14;
}

std::uint16_t default_version(ItemType type) {
  if (type == ItemType::kWavePacket13) return 1;
  return is_layered_type(type) ? 3 : 2;
}

bool known_version(const Item& item) {
  if (item.type == ItemType::kWavePacket13) return item.version == 1;
  if (is_layered_type(item.type)) return item.version == 3 || item.version == 4;
  return item.version == 1 || item.version == 2;
}

}  // namespace

std::size_t Schema::record_bytes() const {
  std::size_t sum = 0;
  for (const Item& item : items) sum += item.bytes;
  return sum;
}

Schema schema_for(int point_format, std::size_t extra, std::uint32_t chunk_points) {
  const bool wide = point_format >= 6;
  Schema schema;
  schema.compressor = wide ? Compressor::kLayered : Compressor::kPointwiseChunked;
  schema.chunk_points = chunk_points;
  const auto add = [&](ItemType type, std::size_t bytes) {
    schema.items.push_back({type, static_cast<std::uint16_t>(bytes), default_version(type)});
  };
  const auto is_one_of = [&](std::initializer_list<int> formats) {
    for (const int f : formats)
      if (f == point_format) return true;
    return false;
  };
  wide ? add(ItemType::kPoint14, 30) : add(ItemType::kPoint10, 20);
  if (is_one_of({1, 3, 4, 5})) add(ItemType::kGpsTime11, 8);
  if (is_one_of({2, 3, 5})) add(ItemType::kRgb12, 6);
  if (is_one_of({7})) add(ItemType::kRgb14, 6);
  if (is_one_of({8, 10})) add(ItemType::kRgbNir14, 8);
  if (is_one_of({4, 5})) add(ItemType::kWavePacket13, 29);
  if (is_one_of({9, 10})) add(ItemType::kWavePacket14, 29);
  if (extra > 0) add(wide ? ItemType::kBytes14 : ItemType::kBytes, extra);
  return schema;
}

Schema parse_schema(std::string_view record, int point_format, std::size_t record_bytes) {
  if (record.size() < kHeadBytes)
    throw Damage("has " + std::to_string(record.size()) + " bytes, at least 34 are needed");
  const auto compressor = load_scalar<std::uint16_t>(record.data());
  const auto coder = load_scalar<std::uint16_t>(record.data() + 2);
  const auto count = load_scalar<std::uint16_t>(record.data() + 32);
  if (compressor < 1 || compressor > 3)
    throw Damage("names compressor " + std::to_string(compressor) + ", 1 to 3 are known");
  if (coder != 0) throw Damage("names coder " + std::to_string(coder) + ", only 0 is known");
  if (record.size() < kHeadBytes + kItemBytes * count)
    throw Damage("is cut off within its " + std::to_string(count) + " items");
  Schema schema;
  schema.compressor = static_cast<Compressor>(compressor);
  const auto points = load_scalar<std::uint32_t>(record.data() + 12);
  schema.chunk_points = points == 0 ? Schema::kVariable : points;
  for (std::size_t i = 0; i < count; ++i) {
    const char* at = record.data() + kHeadBytes + kItemBytes * i;
    schema.items.push_back({static_cast<ItemType>(load_scalar<std::uint16_t>(at)),
                            load_scalar<std::uint16_t>(at + 2), load_scalar<std::uint16_t>(at + 4)});
  }
  const std::size_t bare = schema_for(point_format, 0, 0).record_bytes();
  if (record_bytes - bare > kMaxExtraBytes)
    throw Damage("codes " + std::to_string(record_bytes - bare) + " extra bytes a point, at most " +
                 std::to_string(kMaxExtraBytes) + " can be read");
  const Schema wanted = schema_for(point_format, record_bytes - bare, 0);
  bool same = schema.items.size() == wanted.items.size() && schema.layered() == wanted.layered();
  for (std::size_t i = 0; same && i < wanted.items.size(); ++i)
    same = schema.items[i].type == wanted.items[i].type && schema.items[i].bytes == wanted.items[i].bytes;
  if (!same)
    throw Damage("lists items that are not those of records of " + std::to_string(record_bytes) +
                 " bytes of point format " + std::to_string(point_format));
  for (const Item& item : schema.items)
    if (!known_version(item))
      throw Damage("names version " + std::to_string(item.version) + " of item type " +
                   std::to_string(static_cast<int>(item.type)) + ", which is not known");
  return schema;
}

std::vector<char> schema_record(const Schema& schema) {
  std::vector<char> record(kHeadBytes + kItemBytes * schema.items.size());
  const auto put = [&](std::size_t at, auto value) { std::memcpy(record.data() + at, &value, sizeof value); };
  put(0, schema.compressor);
  record[4] = 3, record[5] = 4;  // version of LASzip whose format this is
  put(12, schema.chunk_points);
  put(16, std::int64_t{-1});  // special extended records: none
  put(24, std::int64_t{-1});
  put(32, static_cast<std::uint16_t>(schema.items.size()));
  for (std::size_t i = 0; i < schema.items.size(); ++i) {
    const std::size_t at = kHeadBytes + kItemBytes * i;
    put(at, schema.items[i].type), put(at + 2, schema.items[i].bytes), put(at + 4, schema.items[i].version);
  }
  return record;
}

}  // namespace tessera::laz
