#include "stream/formats/laz/chunk_table.h"

#include <cstring>
#include <string>

#include "stream/formats/laz/arithmetic_decoder.h"
#include "stream/formats/laz/arithmetic_encoder.h"
#include "stream/formats/laz/integer_coder.h"

namespace tessera::laz {

namespace {

/// Both numbers of every chunk, predicted by those of the one before.
template <class Coder>
void code_chunk(Coder& coder, IntegerCoder& integers, bool variable, const ChunkSize& last, ChunkSize& now) {
  const auto number = [&](std::uint32_t before, std::uint32_t& value, unsigned context) {
    value = static_cast<std::uint32_t>(
        integers.code(coder, static_cast<std::int32_t>(before), static_cast<std::int32_t>(value), context));
  };
  if (variable) number(last.points, now.points, 0);
  number(last.bytes, now.bytes, 1);
}

}  // namespace

std::vector<ChunkSize> read_chunk_table(ByteFeed& feed, bool variable, std::uint64_t space) {
  const std::uint32_t version = feed.next_u32();
  if (version != 0) throw Damage("has version " + std::to_string(version) + ", 0 is known");
  const std::uint32_t count = feed.next_u32();
  if (count > space)
    throw Damage("lists " + std::to_string(count) + " chunks in " + std::to_string(space) + " bytes");
  if (count > kMaxChunks)
    throw Damage("lists " + std::to_string(count) + " chunks, at most " + std::to_string(kMaxChunks) +
                 " can be read; compress the file anew with larger chunks");
  std::vector<ChunkSize> chunks;
  if (count == 0) return chunks;
  chunks.reserve(count);
  ArithmeticDecoder decoder;
  decoder.start(feed);
  IntegerCoder integers(32, 2);
  ChunkSize last;
  std::uint64_t sum = 0;
  while (chunks.size() < count) {
    code_chunk(decoder, integers, variable, ChunkSize(last), last);
    sum += last.bytes;
    if (last.bytes == 0 || sum > space)
      throw Damage("gives chunk " + std::to_string(chunks.size() + 1) + " of " + std::to_string(count) + " " +
                   std::to_string(last.bytes) + " bytes, which cannot be");
    chunks.push_back(last);
  }
  return chunks;
}

std::vector<char> chunk_table(const std::vector<ChunkSize>& chunks, bool variable) {
  std::vector<char> out(8);
  const auto count = static_cast<std::uint32_t>(chunks.size());
  std::memcpy(out.data() + 4, &count, 4);
  if (count == 0) return out;
  ArithmeticEncoder encoder;
  IntegerCoder integers(32, 2);
  ChunkSize last;
  for (const ChunkSize& chunk : chunks) {
    ChunkSize now = chunk;
    code_chunk(encoder, integers, variable, last, now);
    last = chunk;
  }
  encoder.finish();
  out.insert(out.end(), encoder.bytes().begin(), encoder.bytes().end());
  return out;
}

}  // namespace tessera::laz
