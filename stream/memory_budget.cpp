#include "stream/memory_budget.h"

#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>

#include "octree/error.h"

namespace tessera {

std::uint64_t parse_bytes(const std::string& text) {
  const auto refuse = [&]() -> std::uint64_t {
    throw UsageError(
        fmt::format("'{}' is not a size: write a number and K, M, G or T, like 512M or 2GiB", text));
  };
  if (text.empty() || !std::isdigit(static_cast<unsigned char>(text[0]))) return refuse();
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  std::string unit(end);
  while (!unit.empty() && unit.front() == ' ') unit.erase(unit.begin());
  for (char& c : unit) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  constexpr std::array<std::string_view, 5> kUnits = {"b", "k", "m", "g", "t"};
  double scale = unit.empty() ? 1.0 : 0.0;
  double factor = 1.0;
  for (const std::string_view prefix : kUnits) {
    const std::string p(prefix);
    if (unit == p || (p != "b" && (unit == p + "b" || unit == p + "ib"))) scale = factor;
    factor *= 1024.0;
  }
  // 2^53 bytes: beyond it a double no longer counts single bytes, and no machine has them.
  if (scale == 0.0 || !std::isfinite(number) || number * scale > 9007199254740992.0) return refuse();
  return static_cast<std::uint64_t>(number * scale);
}

std::string format_bytes(std::uint64_t bytes) {
  if (bytes < 1024) return fmt::format("{} B", bytes);
  double value = static_cast<double>(bytes);
  std::size_t unit = 0;
  constexpr std::array<const char*, 6> kNames = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  while (value >= 1024.0 && unit + 1 < kNames.size()) {
    value /= 1024.0;
    ++unit;
  }
  return fmt::format("{:.{}f} {}", value, value < 10 ? 2 : value < 100 ? 1 : 0, kNames[unit]);
}

}  // namespace tessera
