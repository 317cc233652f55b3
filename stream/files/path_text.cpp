#include "stream/files/path_text.h"

#include <cstddef>
#include <cstdint>

namespace tessera {
namespace {

constexpr std::uint32_t kFirst = 0x10f700;  ///< stands for the byte 0

std::uint32_t byte_at(const std::string& text, std::size_t i) {
  return static_cast<unsigned char>(text[i]);
}

/// Bytes of the character that begins at `at`, and the character; 0 where the bytes are no UTF-8.
std::size_t character(const std::string& text, std::size_t at, std::uint32_t& value) {
  const std::uint32_t first = byte_at(text, at);
  value = first;
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xc2 && first < 0xe0   ? 2
                             : first >= 0xe0 && first < 0xf0 ? 3
                             : first >= 0xf0 && first < 0xf5 ? 4
                                                             : 0;
  if (length == 0 || text.size() - at < length) return 0;
  value = first & (0x7fu >> length);
  for (std::size_t i = 1; i < length; ++i) {
    const std::uint32_t byte = byte_at(text, at + i);
    if ((byte & 0xc0u) != 0x80u) return 0;
    value = value << 6 | (byte & 0x3fu);
  }
  constexpr std::uint32_t kMin[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = value >= 0xd800 && value < 0xe000;
  return value < kMin[length] || value > 0x10ffff || surrogate ? 0 : length;
}

bool stands_for_byte(std::uint32_t value) {
  return value >= kFirst && value < kFirst + 256;
}

}  // namespace

std::string json_text(const std::string& bytes) {
  std::string text;
  for (std::size_t at = 0; at < bytes.size();) {
    std::uint32_t value = 0;
    const std::size_t length = character(bytes, at, value);
    if (length > 0 && !stands_for_byte(value)) {
      text.append(bytes, at, length);
      at += length;
      continue;
    }
    const std::uint32_t c = kFirst + byte_at(bytes, at++);
    text += static_cast<char>(0xf0u | c >> 18);
    for (const unsigned shift : {12u, 6u, 0u}) text += static_cast<char>(0x80u | (c >> shift & 0x3fu));
  }
  return text;
}

std::string bytes_of_json_text(const std::string& text) {
  std::string bytes;
  for (std::size_t at = 0; at < text.size();) {
    std::uint32_t value = 0;
    const std::size_t length = character(text, at, value);
    if (length > 0 && stands_for_byte(value)) {
      bytes += static_cast<char>(value - kFirst);
    } else {
      bytes.append(text, at, length == 0 ? 1 : length);
    }
    at += length == 0 ? 1 : length;
  }
  return bytes;
}

}  // namespace tessera
