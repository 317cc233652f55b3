#include "stream/formats/lzf_reader.h"

#include <algorithm>
#include <string>

#include "octree/error.h"

namespace tessera {

namespace {

constexpr std::size_t kBuffer = std::size_t{1} << 16;

}  // namespace

LzfReader::LzfReader(const ReadFile& file, const LzfPosition& from, std::uint64_t end, bool release)
    : file_(file), window_(file, from.packed, end, kBuffer, release), state_(from) {}

std::uint64_t LzfReader::read(char* to, std::uint64_t bytes) {
  LzfPosition& p = state_;
  std::uint64_t done = 0;
  const auto put = [&](char c) {
    p.ring[p.unpacked++ % LzfPosition::kWindow] = c;
    if (to) to[done] = c;
    ++done;
  };
  while (done < bytes) {
    if (p.literals > 0) {
      const std::string_view text = window_.peek(1);
      const std::uint64_t n = std::min<std::uint64_t>({p.literals, bytes - done, text.size()});
      if (n == 0) return done;
      for (std::uint64_t i = 0; i < n; ++i) put(text[i]);
      window_.skip(n);
      p.packed += n;
      p.literals -= static_cast<std::uint32_t>(n);
    } else if (p.copies > 0) {
      for (; p.copies > 0 && done < bytes; --p.copies)
        put(p.ring[(p.unpacked - p.distance) % LzfPosition::kWindow]);
    } else if (!next_instruction()) {
      return done;
    }
  }
  return done;
}

/// Below 32: so many literals and one more follow. Else the high three bits are a length (7: the next byte is added),
/// the low five and the byte after it a distance, both counted from the least that makes sense: 2 and 1.
bool LzfReader::next_instruction() {
  const std::string_view text = window_.peek(3);
  if (text.empty()) return false;
  const auto byte = [&](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
  };
  std::size_t used = 1;
  if (byte(0) < 32) {
    state_.literals = byte(0) + 1;
  } else {
    const bool is_long = byte(0) >> 5 == 7;
    used = is_long ? 3 : 2;
    if (text.size() < used) return false;
    state_.copies = (byte(0) >> 5) + (is_long ? byte(1) : 0) + 2;
    state_.distance = ((byte(0) & 31u) << 8 | byte(used - 1)) + 1;
    if (state_.distance > state_.unpacked) {
      throw InputError(
          file_.path().string() + ": byte " + std::to_string(state_.packed) +
          ": the compressed points refer to what is before their beginning; the file is damaged");
    }
  }
  window_.skip(used);
  state_.packed += used;
  return true;
}

}  // namespace tessera
