#include "stream/formats/e57/e57_pages.h"

#include <nmmintrin.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "octree/error.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

constexpr std::uint64_t kHeaderBytes = 48;

/// The format stores checksums with their highest byte first.
std::uint32_t stored_checksum(const char* page) {
  return load_scalar<std::uint32_t, true>(page + kE57Payload);
}

}  // namespace

std::uint32_t crc32c(const char* bytes, std::size_t count) {
  std::uint64_t crc = 0xffffffffu;
  for (; count >= 8; count -= 8, bytes += 8) crc = _mm_crc32_u64(crc, load_scalar<std::uint64_t>(bytes));
  auto rest = static_cast<std::uint32_t>(crc);
  for (; count > 0; --count, ++bytes) rest = _mm_crc32_u8(rest, static_cast<std::uint8_t>(*bytes));
  return ~rest;
}

E57Header read_e57_header(const ReadFile& file) {
  const std::string name = file.path().string();
  const auto fail = [&](std::uint64_t byte, const std::string& what) {
    throw InputError(name + ": byte " + std::to_string(byte) + " of the E57 header: " + what);
  };
  if (file.size() < kHeaderBytes)
    fail(file.size(), "the file ends here, a header has 48 bytes; it is truncated");
  char head[kHeaderBytes];
  file.read_at(0, head, kHeaderBytes);
  const auto major = load_scalar<std::uint32_t>(head + 8);
  if (major != 1) {
    fail(8, "version " + std::to_string(major) + "." + std::to_string(load_scalar<std::uint32_t>(head + 12)) +
                " is not known, 1.0 is");
  }
  const auto page = load_scalar<std::uint64_t>(head + 40);
  if (page != kE57Page) fail(40, "pages of " + std::to_string(page) + " bytes; the standard has 1024");
  E57Header header;
  const auto length = load_scalar<std::uint64_t>(head + 16);
  const auto xml = load_scalar<std::uint64_t>(head + 24);
  header.xml_bytes = load_scalar<std::uint64_t>(head + 32);
  const E57Pages pages(file, 1);
  header.xml_begin = xml / kE57Page * kE57Payload + xml % kE57Page;
  if (xml % kE57Page >= kE57Payload || header.xml_begin >= pages.bytes() ||
      header.xml_bytes > pages.bytes() - header.xml_begin) {
    fail(24, "the XML section, which says where the points are, is to lie at byte " + std::to_string(xml) +
                 " with " + std::to_string(header.xml_bytes) + " bytes, the file has " +
                 std::to_string(file.size()) + "; it is truncated: get the whole file");
  }
  if (length != file.size()) {
    header.warning = "the header declares a file of " + std::to_string(length) + " bytes, it has " +
                     std::to_string(file.size());
  }
  return header;
}

E57Pages::E57Pages(const ReadFile& file, std::size_t ahead, bool release)
    : file_(file), pages_(file.size() / kE57Page), ahead_(ahead), release_(release) {}

void E57Pages::load(std::uint64_t at, std::size_t count) {
  if (release_ && filled_ > 0) file_.release(e57_physical(begin_), filled_ / kE57Payload * kE57Page);
  const std::uint64_t first = at / kE57Payload;
  const std::uint64_t last = (at + std::max<std::size_t>(count, 1) - 1) / kE57Payload;
  const auto n = static_cast<std::size_t>(
      std::min<std::uint64_t>(std::max<std::uint64_t>(last - first + 1, ahead_), pages_ - first));
  buffer_.resize(n * kE57Page);
  filled_ = 0;  // nothing, should a read below fail
  file_.read_at(first * kE57Page, buffer_.data(), n * kE57Page);
  for (std::size_t i = 0; i < n; ++i) {
    const char* page = buffer_.data() + i * kE57Page;
    if (crc32c(page, kE57Payload) != stored_checksum(page)) {
      throw InputError(
          file_.path().string() + ": byte " + std::to_string((first + i) * kE57Page) +
          ": the checksum of this page of 1024 bytes is wrong; the file is damaged: get it anew");
    }
    std::memmove(buffer_.data() + i * kE57Payload, page, kE57Payload);
  }
  begin_ = first * kE57Payload;
  filled_ = n * kE57Payload;
}

std::uint64_t E57Pages::logical(std::uint64_t physical, const std::string& what) const {
  const std::uint64_t at = physical / kE57Page * kE57Payload + physical % kE57Page;
  if (physical % kE57Page >= kE57Payload || at >= bytes()) {
    throw InputError(file_.path().string() + ": " + what + " is to lie at byte " + std::to_string(physical) +
                     ", where the file of " + std::to_string(file_.size()) +
                     " bytes has none; it is truncated or damaged");
  }
  return at;
}

void E57Pages::fail(std::uint64_t at, const std::string& what) const {
  throw InputError(file_.path().string() + ": byte " + std::to_string(e57_physical(at)) + ": " + what);
}

}  // namespace tessera
