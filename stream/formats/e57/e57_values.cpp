#include "stream/formats/e57/e57_values.h"

#include "stream/formats/scalar.h"

namespace tessera {

namespace {

template <class T>
void unpack_floats(const char* bytes, std::size_t count, double* out) {
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<double>(load_scalar<T>(bytes + i * sizeof(T)));
}

/// Calls use(i, stored) for every value.
template <class F>
void unpack_bits(unsigned bits, const char* bytes, unsigned skip, std::size_t count, F&& use) {
  if (bits == 0) {
    for (std::size_t i = 0; i < count; ++i) use(i, std::uint64_t{0});
    return;
  }
  const std::uint64_t mask = ~std::uint64_t{0} >> (64 - bits);
  std::uint64_t at = skip;
  if (bits <= 57) {  // with up to 7 bits of the value before, one load has them all
    for (std::size_t i = 0; i < count; ++i, at += bits)
      use(i, load_scalar<std::uint64_t>(bytes + at / 8) >> (at % 8) & mask);
    return;
  }
  for (std::size_t i = 0; i < count; ++i, at += bits) {
    const auto low = load_scalar<std::uint64_t>(bytes + at / 8) >> (at % 8);
    const std::uint64_t high = load_scalar<std::uint8_t>(bytes + at / 8 + 8);
    use(i, (at % 8 == 0 ? low : low | high << (64 - at % 8)) & mask);
  }
}

}  // namespace

void unpack_e57(const E57Field& field, const char* bytes, unsigned skip, std::size_t count, double* out) {
  const auto base = static_cast<std::uint64_t>(field.minimum);
  switch (field.code) {
    case E57Code::kSingle:
      return unpack_floats<float>(bytes, count, out);
    case E57Code::kDouble:
      return unpack_floats<double>(bytes, count, out);
    case E57Code::kInteger:
      return unpack_bits(field.bits, bytes, skip, count, [&](std::size_t i, std::uint64_t stored) {
        out[i] = static_cast<double>(static_cast<std::int64_t>(base + stored));
      });
    case E57Code::kScaled:
      break;
  }
  unpack_bits(field.bits, bytes, skip, count, [&](std::size_t i, std::uint64_t stored) {
    out[i] = static_cast<double>(static_cast<std::int64_t>(base + stored)) * field.scale + field.offset;
  });
}

}  // namespace tessera
