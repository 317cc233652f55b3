/// \file chunk_decoder.h
/// The points of one chunk of a LAZ file: compressed bytes in, records as an uncompressed file has them out, a batch at
/// a time. Pure: knows no file. Memory is that of the models (about 1 MiB at most) and of the feeds.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>

#include "stream/formats/laz/byte_feed.h"
#include "stream/formats/laz/schema.h"

namespace tessera::laz {

class ChunkDecoder {
 public:
  virtual ~ChunkDecoder() = default;
  /// Decodes the next `count` records. \pre  no more than the chunk has  \throws Damage, EndOfBytes; records before the
  ///   one that failed are there, see decoded()
  virtual void decode(char* records, std::size_t count) = 0;
  /// After the last record. \throws Damage when a stream has bytes that no point used: then its points are no points
  virtual void require_used_up() = 0;
  /// Records so far.
  std::uint64_t decoded() const { return decoded_; }

 protected:
  std::uint64_t decoded_ = 0;
};

/// The chunk that begins with the next byte of the feed; afterwards the feed stands at the next chunk.
std::unique_ptr<ChunkDecoder> decode_pointwise(const Schema& schema, ByteFeed& feed);

/// Opens bytes [begin, end) of a chunk. \throws EndOfBytes when the chunk does not have them
using OpenBytes = std::function<std::unique_ptr<ByteFeed>(std::uint64_t begin, std::uint64_t end)>;

/// What the head of a layered chunk says.
struct LayeredHead {
  std::uint64_t points = 0;
  std::uint64_t bytes = 0;  ///< of the chunk, layers and head
};
/// \param open  opens bytes of what may be longer than the chunk
LayeredHead read_layered_head(const Schema& schema, const OpenBytes& open);

/// Which layers to decode: with kNeeded those that a scan is read for (position, class, returns, flags, colour), with
/// kNoColours those but the last; the others keep the values of the chunk's first point.
enum class Layers { kAll, kNeeded, kNoColours };
std::unique_ptr<ChunkDecoder> decode_layered(const Schema& schema, const OpenBytes& open, Layers layers);

}  // namespace tessera::laz
