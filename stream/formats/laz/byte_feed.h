/// \file byte_feed.h
/// The bytes that a decoder takes, in order: a stretch of memory, or a window that a derived class moves along a file.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

namespace tessera::laz {

/// Compressed bytes that no compressor can have written. Callers know the file and turn it into an InputError.
struct Damage : std::runtime_error {
  using std::runtime_error::runtime_error;
};
/// The bytes end before the points do: the file was cut off, or a length is wrong.
struct EndOfBytes : Damage {
  EndOfBytes() : Damage("its bytes end before its points do") {}
};

class ByteFeed {
 public:
  explicit ByteFeed(std::string_view bytes = {}) { show(bytes); }
  virtual ~ByteFeed() = default;
  ByteFeed(const ByteFeed&) = delete;
  ByteFeed& operator=(const ByteFeed&) = delete;

  /// \throws EndOfBytes
  std::uint8_t next() {
    if (pos_ == end_) refill_or_throw();
    return *pos_++;
  }
  void take(void* to, std::size_t bytes) {
    auto* out = static_cast<std::uint8_t*>(to);
    for (std::size_t i = 0; i < bytes; ++i) out[i] = next();
  }
  std::uint32_t next_u32() {
    std::uint32_t value = 0;
    take(&value, sizeof value);
    return value;
  }
  /// The next four bytes, first one highest, and whether there are as many without a refill.
  bool ahead(std::uint32_t& four) const {
    if (end_ - pos_ < 4) return false;
    std::uint32_t raw;
    std::memcpy(&raw, pos_, sizeof raw);
    four = __builtin_bswap32(raw);
    return true;
  }
  /// \pre  ahead() said so, bytes <= 4
  void skip_ahead(std::size_t bytes) { pos_ += bytes; }
  /// Whether not one byte is left.
  bool empty() { return pos_ == end_ && !refill_shown(); }
  /// Bytes taken so far.
  std::uint64_t taken() const { return before_ + static_cast<std::uint64_t>(pos_ - begin_); }

 protected:
  /// The bytes after those shown so far; empty at the end.
  virtual std::string_view refill() { return {}; }

 private:
  void show(std::string_view bytes) {
    begin_ = pos_ = reinterpret_cast<const std::uint8_t*>(bytes.data());
    end_ = begin_ + bytes.size();
  }
  bool refill_shown() {
    before_ += static_cast<std::uint64_t>(pos_ - begin_);
    begin_ = pos_ = end_;
    const std::string_view more = refill();
    if (!more.empty()) show(more);
    return !more.empty();
  }
  void refill_or_throw() {
    if (!refill_shown()) throw EndOfBytes();
  }

  const std::uint8_t* begin_ = nullptr;
  const std::uint8_t* pos_ = nullptr;
  const std::uint8_t* end_ = nullptr;
  std::uint64_t before_ = 0;  ///< bytes of windows that were shown before this one
};

}  // namespace tessera::laz
