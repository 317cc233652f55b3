/// \file lzf_block.h
/// Packs a block as LZF, greedily: for readers that unpack.
#pragma once
#include <algorithm>
#include <cstring>
#include <map>
#include <string>

namespace tessera::test {

inline std::string lzf_block(const std::string& bytes) {
  std::string out;
  std::string literals;
  const auto flush = [&] {
    for (std::size_t i = 0; i < literals.size(); i += 32) {
      const std::string run = literals.substr(i, 32);
      out += static_cast<char>(run.size() - 1);
      out += run;
    }
    literals.clear();
  };
  std::map<std::string, std::size_t> last;  // of three bytes: where they stood
  for (std::size_t at = 0; at < bytes.size();) {
    const std::string three = bytes.substr(at, 3);
    const auto seen = last.find(three);
    std::size_t length = 0;
    std::size_t distance = 0;
    if (three.size() == 3 && seen != last.end() && at - seen->second <= 8192) {
      distance = at - seen->second;
      while (length < 264 && at + length < bytes.size() &&
             bytes[at + length - distance] == bytes[at + length])
        ++length;
    }
    last[three] = at;
    if (length < 3) {
      literals += bytes[at++];
      continue;
    }
    flush();
    const std::size_t coded = length - 2;
    out += static_cast<char>(std::min<std::size_t>(coded, 7) << 5 | (distance - 1) >> 8);
    if (coded >= 7) out += static_cast<char>(coded - 7);
    out += static_cast<char>((distance - 1) & 0xff);
    at += length;
  }
  flush();
  return out;
}

}  // namespace tessera::test
