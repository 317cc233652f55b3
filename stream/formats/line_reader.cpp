#include "stream/formats/line_reader.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "octree/error.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

constexpr bool is_separator(char c) {
  return c == ' ' || c == '\t' || c == ',' || c == ';' || c == '\r';
}

std::size_t separators(std::string_view text) {
  std::size_t n = 0;
  while (n < text.size() && is_separator(text[n])) ++n;
  return n;
}

/// One byte before the slice tells whether a line starts at its first byte.
std::uint64_t window_begin(const LineLayout& layout, std::uint64_t begin) {
  return begin > layout.data_begin ? begin - 1 : begin;
}

}  // namespace

char detect_line_end(const ReadFile& file) {
  ByteWindow window(file, 0, file.size(), std::size_t{1} << 16);
  const std::string_view text = window.peek(window.capacity());
  return text.find('\n') == std::string_view::npos && text.find('\r') != std::string_view::npos ? '\r' : '\n';
}

LineReader::LineReader(const ReadFile& file, const LineLayout& layout, std::uint64_t begin, std::uint64_t end,
                       bool release, std::size_t buffer)
    : file_(&file),
      window_(file, window_begin(layout, begin), file.size(), buffer, release),
      end_(end),
      line_end_(layout.line_end),
      line_number_(layout.first_line - 1),
      counting_(begin == layout.data_begin) {
  if (begin > layout.data_begin) {
    while (window_.remaining() > 0) {
      const std::string_view text = window_.peek(1);
      const std::size_t at = text.find(line_end_);
      if (at != std::string_view::npos) {
        window_.skip(at + 1);
        break;
      }
      window_.skip(text.size());
      if (window_.offset() >= end_) break;  // no line starts in this slice
    }
  }
}

bool LineReader::next(std::string_view& line) {
  line_offset_ = window_.offset();
  if (line_offset_ >= end_) return false;
  std::string_view text = window_.peek(1);
  if (text.empty()) return false;
  if (counting_) ++line_number_;
  const char* hit = static_cast<const char*>(std::memchr(text.data(), line_end_, text.size()));
  if (!hit && window_.remaining() > text.size()) {
    text = window_.peek(window_.capacity());
    hit = static_cast<const char*>(std::memchr(text.data(), line_end_, text.size()));
    if (!hit && window_.remaining() > text.size()) {
      throw InputError(where() + ": a line of more than " + std::to_string(window_.capacity()) +
                       " bytes; this is not a text file of points");
    }
  }
  complete_ = hit != nullptr;
  std::size_t bytes = hit ? static_cast<std::size_t>(hit - text.data()) : text.size();
  window_.skip(bytes + (hit ? 1 : 0));  // the buffer stays as it is until the next peek
  while (bytes > 0 && text[bytes - 1] == '\r') --bytes;
  line = text.substr(0, bytes);
  return true;
}

std::string LineReader::where() const {
  const std::string path = file_->path().string();
  return counting_ ? path + ": line " + std::to_string(line_number_)
                   : path + ": byte " + std::to_string(line_offset_);
}

std::string LineReader::torn_line() const {
  return "the last line, at byte " + std::to_string(line_offset_) + ", is torn; it is left out";
}

namespace {

/// Takes the rest of a number whose exponent Fortran wrote with a D, 1.0D+03: `text` stands at it, `mantissa` before.
bool take_d_exponent(std::string_view mantissa, std::string_view& text, double& value) {
  std::size_t n = 1;
  if (n < text.size() && (text[n] == '+' || text[n] == '-')) ++n;
  const std::size_t digits = n;
  while (n < text.size() && text[n] >= '0' && text[n] <= '9') ++n;
  constexpr std::size_t kLongest = 200;
  if (n == digits || mantissa.size() > kLongest || n > kLongest ||
      mantissa.find_first_of("eE") != std::string_view::npos)
    return false;
  std::string number(mantissa);
  number += 'e';
  number += text.substr(1, n - 1);
  std::string_view all = number;
  if (!take_number(all, value) || !all.empty()) return false;
  text.remove_prefix(n);
  return true;
}

}  // namespace

bool next_number(std::string_view& line, double& value) {
  std::string_view text = line;
  text.remove_prefix(separators(text));
  const std::string_view begin = text;
  if (!take_number(text, value)) return false;
  if (!text.empty() && (text.front() == 'D' || text.front() == 'd') &&
      !take_d_exponent(begin.substr(0, begin.size() - text.size()), text, value))
    return false;
  if (!text.empty() && text.front() == '#') {  // "1.#QNAN", "-1.#IND", "1.#INF" of old Microsoft libraries
    const bool infinite = text.substr(0, 4) == "#INF";
    value = infinite ? std::copysign(std::numeric_limits<double>::infinity(), value)
                     : std::numeric_limits<double>::quiet_NaN();
    while (!text.empty() && !is_separator(text.front())) text.remove_prefix(1);
  }
  if (!text.empty() && !is_separator(text.front())) return false;
  line = text;
  return true;
}

bool skip_field(std::string_view& line) {
  line.remove_prefix(separators(line));
  if (line.empty()) return false;
  std::size_t n = 0;
  while (n < line.size() && !is_separator(line[n])) ++n;
  line.remove_prefix(n);
  return true;
}

bool is_blank(std::string_view line) {
  return separators(line) == line.size();
}

}  // namespace tessera
