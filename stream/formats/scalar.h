/// \file scalar.h
/// Numbers in files: typed loads from unaligned bytes of either endianness, and locale-independent parsing.
#pragma once
#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace tessera {

static_assert(std::endian::native == std::endian::little, "files are read on little endian machines");

enum class ScalarType : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64
};

constexpr std::size_t scalar_bytes(ScalarType type) {
  constexpr std::size_t kBytes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}
constexpr bool scalar_is_float(ScalarType type) {
  return type >= ScalarType::kFloat32;
}

/// Loads a T; `kSwap` when the file is big endian.
template <class T, bool kSwap = false>
T load_scalar(const char* p) {
  if constexpr (kSwap && sizeof(T) > 1) {
    char reversed[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) reversed[i] = p[sizeof(T) - 1 - i];
    p = reversed;
    T value;
    std::memcpy(&value, p, sizeof(T));
    return value;
  } else {
    T value;
    std::memcpy(&value, p, sizeof(T));
    return value;
  }
}

/// Calls f with a value of the C++ type that `type` names.
template <class F>
decltype(auto) visit_scalar_type(ScalarType type, F&& f) {
  switch (type) {
    case ScalarType::kInt8:
      return f(std::int8_t{});
    case ScalarType::kUint8:
      return f(std::uint8_t{});
    case ScalarType::kInt16:
      return f(std::int16_t{});
    case ScalarType::kUint16:
      return f(std::uint16_t{});
    case ScalarType::kInt32:
      return f(std::int32_t{});
    case ScalarType::kUint32:
      return f(std::uint32_t{});
    case ScalarType::kInt64:
      return f(std::int64_t{});
    case ScalarType::kUint64:
      return f(std::uint64_t{});
    case ScalarType::kFloat32:
      return f(float{});
    case ScalarType::kFloat64:
      break;
  }
  return f(double{});
}

/// One value of any type as double (64-bit integers beyond 2^53 are rounded).
inline double load_double(ScalarType type, bool big_endian, const char* p) {
  return visit_scalar_type(type, [&](auto zero) {
    using T = decltype(zero);
    return static_cast<double>(big_endian ? load_scalar<T, true>(p) : load_scalar<T>(p));
  });
}

/// One value of an integer type, negative ones as their two's complement. \pre not a float type
inline std::uint64_t load_integer(ScalarType type, bool big_endian, const char* p) {
  return visit_scalar_type(type, [&](auto zero) {
    using T = decltype(zero);
    return static_cast<std::uint64_t>(big_endian ? load_scalar<T, true>(p) : load_scalar<T>(p));
  });
}

/// Reads a number at the front of `text` and removes it; accepts a leading '+', nan and inf; ignores the
/// locale. Out-of-range values become 0 or infinity, as nearest. Returns false and leaves `text` if there is
/// no number.
bool take_number(std::string_view& text, double& value);
/// The same for a whole count. False for signs, fractions and overflow.
bool take_count(std::string_view& text, std::uint64_t& value);

}  // namespace tessera
