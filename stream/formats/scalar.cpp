#include "stream/formats/scalar.h"

#include <limits>

namespace tessera {

bool take_number(std::string_view& text, double& value) {
  const char* begin = text.data();
  const char* const end = begin + text.size();
  if (begin != end && *begin == '+' && end - begin > 1 && begin[1] != '-') ++begin;
  const auto [next, error] = std::from_chars(begin, end, value);
  if (error == std::errc::invalid_argument) return false;
  if (error == std::errc::result_out_of_range) {
    // Too small or too large: from_chars leaves the value alone. A negative exponent means too small.
    const std::string_view token(begin, static_cast<std::size_t>(next - begin));
    const std::size_t e = token.find_first_of("eE");
    const bool tiny = e != std::string_view::npos ? token.substr(e + 1, 1) == "-"
                                                  : token.find_first_of("123456789") > token.find('.');
    value = tiny ? 0.0 : std::numeric_limits<double>::infinity();
    if (*begin == '-') value = -value;
  }
  text.remove_prefix(static_cast<std::size_t>(next - text.data()));
  return true;
}

bool take_count(std::string_view& text, std::uint64_t& value) {
  const auto [next, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(next - text.data()));
  return true;
}

}  // namespace tessera
