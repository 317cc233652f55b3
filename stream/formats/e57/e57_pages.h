/// \file e57_pages.h
/// The bytes of an E57 file (ASTM E2807): pages of 1024 bytes, each with a CRC-32C of the 1020 before it. What the
/// format calls logical offsets leaves the checksums out; offsets in the file ("physical") count them.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "stream/files/read_file.h"

namespace tessera {

inline constexpr std::uint64_t kE57Page = 1024;
inline constexpr std::uint64_t kE57Payload = kE57Page - 4;  ///< of a page, before its checksum

/// Where a logical byte lies in the file.
constexpr std::uint64_t e57_physical(std::uint64_t logical) {
  return logical / kE57Payload * kE57Page + logical % kE57Payload;
}

/// CRC-32C (polynomial 0x1EDC6F41, reflected), as iSCSI and E57 have it.
std::uint32_t crc32c(const char* bytes, std::size_t count);

/// What the first 48 bytes say, verified against the file.
struct E57Header {
  std::uint64_t xml_begin = 0;  ///< logical
  std::uint64_t xml_bytes = 0;
  std::string warning;  ///< one sentence if the length that the header declares is not the file's
};
/// \throws InputError naming file and byte: too short, a version or page size that is not known, an XML section that
///   lies outside the file (it is the last part of most, so a truncated file ends here)
E57Header read_e57_header(const ReadFile& file);

/// Verified payload through one bounded buffer.
class E57Pages {
 public:
  static constexpr std::size_t kLongestView = (std::size_t{1} << 16) + 8;

  /// \param ahead    pages that one read takes at least
  /// \param release  tell the system that bytes passed are not needed again
  /// \pre `file` outlives this
  E57Pages(const ReadFile& file, std::size_t ahead, bool release = false);

  const ReadFile& file() const { return file_; }
  /// Logical bytes that the file has; a last page that is cut off has no checksum and does not count.
  std::uint64_t bytes() const { return pages_ * kE57Payload; }
  /// Logical bytes [at, at + count), valid until the next call. \pre they are there, count <= kLongestView
  /// \throws InputError naming the byte of a page whose checksum is wrong
  std::string_view view(std::uint64_t at, std::size_t count) {
    if (at < begin_ || at + count > begin_ + filled_) load(at, count);
    return {buffer_.data() + (at - begin_), count};
  }
  /// A place that other parts of the file name. \throws InputError naming `what` when it is not in a page's payload
  std::uint64_t logical(std::uint64_t physical, const std::string& what) const;
  /// \throws InputError "file: byte N: what", N the place in the file of logical byte `at`
  [[noreturn]] void fail(std::uint64_t at, const std::string& what) const;

 private:
  void load(std::uint64_t at, std::size_t count);

  const ReadFile& file_;
  std::uint64_t pages_;
  std::size_t ahead_;
  bool release_;
  std::vector<char> buffer_;  ///< payload, without checksums
  std::uint64_t begin_ = 0;   ///< logical offset of buffer_[0]
  std::uint64_t filled_ = 0;
};

}  // namespace tessera
