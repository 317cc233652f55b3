/// \file line_reader.h
/// Lines of a text file, in bounded memory, so that parts of one file can be read apart: a slice [begin, end)
/// has exactly the lines whose first byte lies in it, and reads on past `end` to finish the last one.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "stream/files/read_file.h"
#include "stream/formats/byte_window.h"

namespace tessera {

/// Where the lines of a file are.
struct LineLayout {
  std::uint64_t data_begin = 0;  ///< byte offset of the first data line
  std::uint64_t first_line = 1;  ///< its number, for messages
  char line_end = '\n';          ///< '\n' (also for CRLF), or '\r' in files of old Macintosh programs
};

/// '\r' if the first 64 KiB have it and no '\n', else '\n'.
char detect_line_end(const ReadFile& file);

class LineReader {
 public:
  static constexpr std::size_t kLongestLine = std::size_t{1} << 20;

  /// \pre layout.data_begin <= begin <= end <= file.size()
  /// \param buffer  bytes read at a time, and the longest line
  LineReader(const ReadFile& file, const LineLayout& layout, std::uint64_t begin, std::uint64_t end,
             bool release, std::size_t buffer = kLongestLine);

  /// The next line without its end, or false after the last. Valid until the next call.
  /// \throws InputError for a line longer than the buffer
  bool next(std::string_view& line);
  /// False if the line just given is the last of the file and has no line end: it may be torn.
  bool complete() const { return complete_; }
  /// "file: line 12" as long as lines are counted from the start of the file, else "file: byte 3456".
  std::string where() const;
  /// The warning for a last line that is left out because it is torn.
  std::string torn_line() const;
  std::uint64_t line_offset() const { return line_offset_; }      ///< of the line just given
  std::uint64_t next_offset() const { return window_.offset(); }  ///< of the line after it

 private:
  const ReadFile* file_;
  ByteWindow window_;
  std::uint64_t end_;
  char line_end_;
  bool complete_ = true;
  std::uint64_t line_offset_ = 0;
  std::uint64_t line_number_ = 0;  ///< of the line just given; counted only if counting_
  bool counting_;
};

/// Skips separators (space, tab, comma, semicolon) and takes one number that ends at a separator or at the
/// end of the line. Spellings of not-a-number ("nan", "-1.#IND") give NaN; exponents may be Fortran's, 1.0D+03. False if
/// there is no such number.
bool next_number(std::string_view& line, double& value);
/// Skips one field of any content. False at the end of the line.
bool skip_field(std::string_view& line);
/// True if nothing but separators is left.
bool is_blank(std::string_view line);

}  // namespace tessera
