#include "stream/formats/text_scanner.h"

#include <algorithm>

#include "octree/error.h"
#include "stream/formats/scalar.h"

namespace tessera {
namespace {

constexpr std::size_t kScanBuffer = std::size_t{1} << 18;

/// A word of the file for a message: printable, short.
std::string quoted(std::string_view word) {
  std::string text = "'";
  for (const char c : word.substr(0, 40)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + "'";
}

}  // namespace

std::uint64_t byte_order_mark(const ReadFile& file) {
  char start[3] = {};
  if (file.size() < sizeof start) return 0;
  file.read_at(0, start, sizeof start);
  return std::string_view(start, sizeof start) == "\xef\xbb\xbf" ? sizeof start : 0;
}

TextScanner::TextScanner(const ReadFile& file, std::uint64_t begin, std::uint64_t line, char line_end,
                         char comment)
    : file_(&file),
      window_(file, begin, file.size(), kScanBuffer, true),
      line_(line),
      line_end_(line_end),
      comment_(comment) {}

void TextScanner::skip_to_line_end() {
  for (;;) {
    const std::string_view text = window_.peek(1);
    const std::size_t end = text.find(line_end_);
    if (end != std::string_view::npos) {
      window_.skip(end);
      return;
    }
    if (text.empty()) return;
    window_.skip(text.size());
  }
}

bool TextScanner::at_word() {
  for (;;) {
    const std::string_view text = window_.peek(1);
    if (text.empty()) return false;
    std::size_t i = 0;
    while (i < text.size() && text[i] != line_end_ && is_space(text[i])) ++i;
    window_.skip(i);
    if (i == text.size()) continue;
    if (text[i] == line_end_) return false;
    if (comment_ == '\0' || text[i] != comment_) return true;
    skip_to_line_end();
    return false;
  }
}

std::string_view TextScanner::take_word() {
  const std::string_view text = window_.peek(std::min<std::uint64_t>(kLongestWord + 1, window_.remaining()));
  std::size_t n = 0;
  while (n < text.size() && text[n] != line_end_ && !is_space(text[n])) ++n;
  if (n > kLongestWord) {
    throw InputError(where() + ": a word longer than " + std::to_string(kLongestWord) +
                     " characters; the file is damaged or not text");
  }
  window_.skip(n);
  return text.substr(0, n);
}

std::string_view TextScanner::word_in_line() {
  return at_word() ? take_word() : std::string_view{};
}

bool TextScanner::next_line() {
  skip_to_line_end();
  if (window_.peek(1).empty()) return false;
  window_.skip(1);
  ++line_;
  return true;
}

std::string_view TextScanner::word() {
  while (!at_word()) {
    if (!next_line()) return {};
  }
  return take_word();
}

double TextScanner::number(const char* wanted, bool in_line) {
  const std::string_view found = in_line ? word_in_line() : word();
  std::string_view text = found;
  double value = 0.0;
  if (take_number(text, value) && text.empty()) return value;
  throw InputError(
      where() + ": " +
      (found.empty() ? std::string(in_line ? "the line" : "the file") + " ends" : quoted(found) + " stands") +
      " where " + wanted + " should be");
}

std::uint64_t TextScanner::count(const char* wanted) {
  const std::string_view found = word();
  std::string_view text = found;
  std::uint64_t value = 0;
  if (take_count(text, value) && text.empty()) return value;
  throw InputError(where() + ": " +
                   (found.empty() ? std::string("the file ends") : quoted(found) + " stands") + " where " +
                   wanted + " should be");
}

std::string TextScanner::where() const {
  return file_->path().string() + ": line " + std::to_string(line_);
}

}  // namespace tessera
