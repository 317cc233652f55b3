/// \file byte_window.h
/// The bytes [begin, end) of a file in order, through one bounded, aligned buffer.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string_view>

#include "stream/files/read_file.h"

namespace tessera {

class ByteWindow {
 public:
  static constexpr std::size_t kDefaultCapacity = std::size_t{1} << 20;

  /// \pre  begin <= end <= file.size(); `file` outlives the window
  /// \param capacity  bytes of the buffer and the longest peek(); no more are taken than the range has
  /// \param release   tell the system that bytes passed are not needed again
  ByteWindow(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
             std::size_t capacity = kDefaultCapacity, bool release = false);

  std::uint64_t offset() const { return window_ + pos_; }  ///< file offset of the next byte
  std::uint64_t remaining() const { return end_ - offset(); }
  std::size_t capacity() const { return capacity_; }

  /// At least min(wanted, remaining()) next bytes, contiguous, valid until the next call; often more.
  /// \pre    wanted <= capacity(), or the whole range is smaller
  /// \throws InputError naming file and offset when the system refuses, or the file shrank meanwhile; or, with its last
  ///         bytes, when it was written to meanwhile
  std::string_view peek(std::size_t wanted) {
    if (filled_ - pos_ < wanted && window_ + filled_ < end_) refill();
    return {buffer_.get() + pos_, filled_ - pos_};
  }
  /// Passes over min(bytes, remaining()) bytes; what is not yet buffered is never read.
  void skip(std::uint64_t bytes);

 private:
  struct Free {
    void operator()(char* p) const { std::free(p); }
  };
  void refill();

  const ReadFile* file_;
  std::uint64_t end_;
  std::size_t capacity_;
  bool release_;
  std::uint64_t window_;    ///< file offset of buffer_[0]
  std::size_t pos_ = 0;     ///< next byte
  std::size_t filled_ = 0;  ///< bytes in the buffer
  std::unique_ptr<char, Free> buffer_;
};

}  // namespace tessera
