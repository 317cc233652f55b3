/// \file chunk_table.h
/// Where the chunks of a LAZ file lie: the coded table behind the last one. Source: ASPRS LAZ specification 1.4.
#pragma once
#include <cstdint>
#include <vector>

#include "stream/formats/laz/byte_feed.h"

namespace tessera::laz {

struct ChunkSize {
  std::uint32_t points = 0;  ///< 0 where all chunks but the last have the same number
  std::uint32_t bytes = 0;
};

/// A file of more chunks is refused: their list must stay small (a chunk mostly has 50,000 points).
inline constexpr std::uint32_t kMaxChunks = 1u << 20;

/// \param feed        from the first byte of the table on
/// \param variable    whether the table has the numbers of points
/// \param space       bytes that the chunks have together, at most
/// \throws Damage for a version that is unknown, more chunks than kMaxChunks or than fit, sizes that add up to more
///   than `space`, and a table that is cut off
std::vector<ChunkSize> read_chunk_table(ByteFeed& feed, bool variable, std::uint64_t space);
std::vector<char> chunk_table(const std::vector<ChunkSize>& chunks, bool variable);

}  // namespace tessera::laz
