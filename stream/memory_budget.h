/// \file memory_budget.h
/// Sizes as people write them.
#pragma once
#include <cstdint>
#include <string>

namespace tessera {

/// "2G", "512M", "1.5GiB", "64KB", "1000000": a number and a unit, in powers of 1024, letter case ignored.
/// \throws UsageError for anything else
std::uint64_t parse_bytes(const std::string& text);

/// "1.50 GiB": three digits, powers of 1024.
std::string format_bytes(std::uint64_t bytes);

}  // namespace tessera
