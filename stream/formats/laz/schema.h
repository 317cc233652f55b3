/// \file schema.h
/// How the points of a LAZ file are coded: what its "laszip encoded" record says (record 22204). Source: ASPRS LAZ
/// specification 1.4.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace tessera::laz {

enum class ItemType : std::uint16_t {
  kBytes = 0,
  kPoint10 = 6,
  kGpsTime11 = 7,
  kRgb12 = 8,
  kWavePacket13 = 9,
  kPoint14 = 10,
  kRgb14 = 11,
  kRgbNir14 = 12,
  kWavePacket14 = 13,
  kBytes14 = 14,
};

struct Item {
  ItemType type = ItemType::kBytes;
  std::uint16_t bytes = 0;
  std::uint16_t version = 0;
};

enum class Compressor : std::uint16_t { kPointwise = 1, kPointwiseChunked = 2, kLayered = 3 };

struct Schema {
  static constexpr std::string_view kUserId = "laszip encoded";
  static constexpr std::uint16_t kRecordId = 22204;
  static constexpr std::uint32_t kVariable = 0xffffffffu;

  Compressor compressor = Compressor::kPointwise;
  std::uint32_t chunk_points = kVariable;  ///< kVariable: the chunk table has the number of every chunk
  std::vector<Item> items;                 ///< in the order in which they lie in a record

  bool layered() const { return compressor == Compressor::kLayered; }
  bool chunked() const { return compressor != Compressor::kPointwise; }
  std::size_t record_bytes() const;
};

/// Items of a point format, 0 to 10, and of `extra` bytes beyond it.
Schema schema_for(int point_format, std::size_t extra, std::uint32_t chunk_points);
/// \throws Damage for what is cut off, unknown, or not what records of this format and length have
Schema parse_schema(std::string_view record, int point_format, std::size_t record_bytes);
/// The record without its header.
std::vector<char> schema_record(const Schema& schema);

}  // namespace tessera::laz
