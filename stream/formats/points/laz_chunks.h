/// \file laz_chunks.h
/// Where the chunks of a LAZ file lie and how many points each has, from chunk table, header and heads of chunks, none of
/// which is believed before it fits the others.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stream/files/read_file.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/laz/byte_feed.h"
#include "stream/formats/laz/schema.h"
#include "stream/formats/points/las_header.h"

namespace tessera {

/// Bytes [begin, end) of a file through a window of bounded size.
class FileFeed final : public laz::ByteFeed {
 public:
  static constexpr std::size_t kWindow = std::size_t{1} << 18;
  FileFeed(const ReadFile& file, std::uint64_t begin, std::uint64_t end, bool release = false)
      : window_(file, begin, end, kWindow, release) {}

 private:
  std::string_view refill() override {
    window_.skip(shown_);
    const std::string_view bytes = window_.peek(1);
    shown_ = bytes.size();
    return bytes;
  }
  ByteWindow window_;
  std::size_t shown_ = 0;
};

struct LazChunk {
  std::uint64_t begin = 0;
  std::uint64_t first_point = 0;
};

struct LazChunks {
  /// One more than there are chunks: the last one is where they end.
  std::vector<LazChunk> edges;
  /// Of chunks that were picked; empty = each ends where the next one begins.
  std::vector<std::uint64_t> ends;
  bool in_order = false;  ///< one run of chunks whose borders only reading tells
  bool cut_off = false;   ///< the last chunk may end before its points do
  std::uint64_t missing = 0;
  std::vector<std::string> warnings;

  std::size_t size() const { return edges.size() - 1; }
  std::uint64_t end_of(std::size_t chunk) const {
    return ends.empty() ? edges[chunk + 1].begin : ends[chunk];
  }
  /// These chunks alone, ascending.
  LazChunks picked(const std::vector<std::size_t>& chunks) const;
  std::uint64_t points() const { return edges.back().first_point; }
  std::uint64_t points_of(std::size_t chunk) const {
    return edges[chunk + 1].first_point - edges[chunk].first_point;
  }
};

/// \throws InputError when the chunks cannot be found
LazChunks find_laz_chunks(const ReadFile& file, const LasHeader& header, const laz::Schema& schema);
/// The "laszip encoded" record. \throws InputError when it is missing or makes no sense
laz::Schema find_laz_schema(const ReadFile& file, const LasHeader& header);

}  // namespace tessera
