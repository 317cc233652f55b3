/// \file unpacked_bytes.h
/// What a gzip or zstd file unpacks to, or text in UTF-16 as UTF-8, by position: forwards as it comes, a little back from
/// memory, further back by starting anew. In bounded memory: a quarter of a megabyte and the window of the format, at most
/// 8 MiB.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include "stream/files/read_file.h"

namespace tessera {

/// "gzip", "zstd" or "UTF-16" (a byte order mark, which the text loses) by the first four bytes, empty for anything else.
std::string_view packed_format(std::string_view head);

class UnpackedBytes {
 public:
  static constexpr std::size_t kBlock = std::size_t{1} << 17;

  /// \throws InputError when packed_format() knows it not
  explicit UnpackedBytes(const std::filesystem::path& path);
  ~UnpackedBytes();

  const ReadFile& file() const { return file_; }
  std::string_view format() const { return format_; }
  /// Up to `bytes` from `offset` on; fewer at the end.
  /// \throws InputError naming file and byte: damaged, truncated, a zstd window of more than 8 MiB
  std::uint64_t read_at(std::uint64_t offset, char* to, std::uint64_t bytes);
  /// Unpacks to the end. \throws InputError as read_at
  std::uint64_t size();

  /// One of the formats.
  class Decoder {
   public:
    virtual ~Decoder() = default;
    /// Takes from `in` and appends to `out` until one is used up. Returns true at the end of a member or frame.
    /// \throws std::runtime_error saying what is wrong
    virtual bool decode(std::string_view& in, std::vector<char>& out, std::size_t limit) = 0;
  };

 private:
  void restart();
  bool refill();
  bool next_block();

  ReadFile file_;
  std::string_view format_;
  std::unique_ptr<Decoder> decoder_;
  std::vector<char> packed_;
  std::string_view rest_;        ///< of packed_, not yet taken
  std::uint64_t packed_at_ = 0;  ///< file offset behind packed_
  bool member_ended_ = false;
  bool pending_ = false;              ///< the block was full: the decoder may hold more
  std::vector<char> before_, block_;  ///< the last two blocks
  std::uint64_t begin_ = 0;           ///< offset of block_[0]
};

}  // namespace tessera
