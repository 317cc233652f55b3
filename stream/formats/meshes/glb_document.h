/// \file glb_document.h
/// The JSON chunk of a GLB, read in a stream: only what a mesh needs of it is kept, whatever else it holds.
#pragma once
#include <cstdint>
#include <string>

#include "stream/files/json.h"
#include "stream/formats/byte_window.h"

namespace tessera {

/// \param version  of the file's header \throws InputError where it is none that is read
void require_glb_version(std::uint64_t version, const std::string& name);

/// \param bytes  the chunk
/// \param name   of the file, for messages
/// \returns the document with the keys that GlbMeshReader and open_textures() look at; at most some 50 MiB, whatever the chunk holds
/// \throws InputError when the chunk is no JSON object, nests deeper than 64, or holds more than fits that
Json read_glb_document(ByteWindow bytes, const std::string& name);

/// An entry of one of the document's lists. \throws InputError naming the file, the list and the index where there is none
const Json& glb_item(const Json& document, const char* list, std::uint64_t index, const std::string& name);

}  // namespace tessera
