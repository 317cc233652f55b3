/// \file lzf_reader.h
/// LZF (as liblzf writes it, which unpacks whole blocks only) unpacked in order, through bounded buffers, from any place
/// that was reached before.
#pragma once
#include <array>
#include <cstdint>

#include "stream/files/read_file.h"
#include "stream/formats/byte_window.h"

namespace tessera {

/// A place in the stream with all that unpacking on from it takes: matches reach back 8 KiB at most.
struct LzfPosition {
  static constexpr std::size_t kWindow = 8192;
  std::uint64_t packed = 0;    ///< file offset of the next byte
  std::uint64_t unpacked = 0;  ///< bytes before it
  std::uint32_t literals = 0;  ///< still to come of the instruction at hand
  std::uint32_t copies = 0;
  std::uint32_t distance = 0;  ///< of the copies
  std::array<char, kWindow> ring{};
};

class LzfReader {
 public:
  /// \param end  file offset behind the stream  \pre from.packed <= end <= file.size(); `file` outlives this
  LzfReader(const ReadFile& file, const LzfPosition& from, std::uint64_t end, bool release);

  const LzfPosition& state() const { return state_; }
  /// Unpacks up to `bytes`, to nowhere if `to` is null; fewer where the stream ends, be it in an instruction.
  /// \throws InputError naming file and byte of an instruction that copies from before the beginning
  std::uint64_t read(char* to, std::uint64_t bytes);

 private:
  bool next_instruction();

  const ReadFile& file_;
  ByteWindow window_;
  LzfPosition state_;
};

}  // namespace tessera
