/// \file json_text.h
/// JSON from text and to text, by nlohmann::json.
#pragma once
#include <string>

#include "stream/files/json.h"

namespace tessera {

/// JSON that people wrote. \param name  of the file, for messages
/// \throws InputError naming it and the byte where it is no JSON, or that a number is beyond all reading
Json parse_json(const std::string& text, const std::string& name);

/// JSON that the program wrote itself. \throws JsonError
Json parse_json(const std::string& text);

/// A discarded value where the text is no JSON.
Json try_parse_json(const std::string& text);

/// What is no UTF-8 becomes U+FFFD. \param indent  spaces a level; negative: all in one line
/// \param ascii  everything beyond ASCII is escaped
std::string dump_json(const Json& value, int indent = -1, bool ascii = false);

}  // namespace tessera
