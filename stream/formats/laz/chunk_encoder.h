/// \file chunk_encoder.h
/// The records of one chunk into the bytes of a LAZ file: ChunkDecoder the other way round. Pure.
#pragma once
#include <string_view>
#include <vector>

#include "stream/formats/laz/schema.h"

namespace tessera::laz {

/// One chunk. \param records  one after the other, schema.record_bytes() each; at least one
std::vector<char> encode_chunk(const Schema& schema, std::string_view records);

}  // namespace tessera::laz
