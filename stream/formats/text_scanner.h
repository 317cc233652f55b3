/// \file text_scanner.h
/// Words of a text file in order, with their line numbers, in bounded memory whatever the length of lines.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "stream/files/read_file.h"
#include "stream/formats/byte_window.h"

namespace tessera {

/// Bytes of the mark that some programs put before text in UTF-8: 3 or 0.
std::uint64_t byte_order_mark(const ReadFile& file);

class TextScanner {
 public:
  /// \param line       number of the line that `begin` is in
  /// \param line_end   '\n', or '\r' in files of old Macintosh programs; the other counts as a space
  /// \param comment    a word that starts with it hides the rest of its line; '\0' = no comments
  TextScanner(const ReadFile& file, std::uint64_t begin, std::uint64_t line, char line_end, char comment);

  /// The next word of any line, empty at the end of the file. Valid until the next call.
  /// \throws InputError for a word longer than kLongestWord
  std::string_view word();
  /// The next word of this line, empty at its end.
  std::string_view word_in_line();
  /// Nothing but blanks and comments is left on this line.
  bool line_done() { return !at_word(); }
  /// Passes over the rest of this line. False at the end of the file.
  bool next_line();
  /// The next word must be a number. `in_line`: on this line. \throws InputError saying what was wanted
  double number(const char* wanted, bool in_line = false);
  /// The next word must be a count. \throws InputError
  std::uint64_t count(const char* wanted);

  std::uint64_t line() const { return line_; }
  /// "file: line 12"
  std::string where() const;

  static constexpr std::size_t kLongestWord = 4096;

 private:
  bool at_word();  ///< moves to the next word of the line; false at its end
  std::string_view take_word();
  void skip_to_line_end();
  bool is_space(char c) const {
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f' || c == '\0';
  }

  const ReadFile* file_;
  ByteWindow window_;
  std::uint64_t line_;
  const char line_end_;
  const char comment_;
};

}  // namespace tessera
