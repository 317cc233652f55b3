/// \file laz_records.h
/// The records of a LAZ file, as the uncompressed file has them.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/laz/chunk_decoder.h"
#include "stream/formats/laz/schema.h"
#include "stream/formats/points/laz_chunks.h"

namespace tessera {

/// Records of consecutive chunks, in order. What it is given outlives it.
class LazRecords {
 public:
  LazRecords(const ReadFile& file, const laz::Schema& schema, const LazChunks& chunks, laz::Layers layers,
             bool release)
      : file_(file), schema_(schema), chunks_(chunks), layers_(layers), release_(release) {}

  /// Goes on with the first record of a chunk.
  void seek(std::size_t chunk);
  /// That the last records came from.
  std::size_t chunk() const { return next_ - 1; }
  /// Up to `count` records, fewer where a chunk ends; none only where a file that was cut off ends.
  /// \pre  there are records left  \throws InputError naming the chunk when it is damaged
  std::size_t read(char* records, std::size_t count);

 private:
  void open_next();
  void begin_unit();
  [[noreturn]] void fail(const laz::Damage& e) const;

  const ReadFile& file_;
  const laz::Schema& schema_;
  const LazChunks& chunks_;
  laz::Layers layers_;
  bool release_;
  std::size_t next_ = 0;  ///< chunk after the one being read
  std::uint64_t left_ = 0, unit_left_ = 0;
  bool ended_ = false;  ///< where the file was cut off
  std::uint64_t begin_ = 0, end_ = 0;
  std::unique_ptr<FileFeed> feed_;
  std::unique_ptr<laz::ChunkDecoder> decoder_;
};

}  // namespace tessera
