/// \file e57_values.h
/// Values of one field of E57 records: bits to numbers, a block at a time.
#pragma once
#include <cstddef>
#include <cstdint>

#include "stream/formats/e57/e57_scans.h"

namespace tessera {

/// Bytes that unpacking may look at behind the last value.
inline constexpr std::size_t kE57Slack = 16;

/// Decodes `count` values. Integers are packed without gaps, the lowest bit first, and stand above the field's minimum;
/// scaled ones come out as (minimum + stored) * scale + offset, floats as they are.
/// \param bytes  of the stream, from the one that holds the first bit; kE57Slack more may be read
/// \param skip   bits of the first byte that belong to the value before, 0 to 7
void unpack_e57(const E57Field& field, const char* bytes, unsigned skip, std::size_t count, double* out);

}  // namespace tessera
