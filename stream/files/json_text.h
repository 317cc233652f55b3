/// \file json_text.h
/// JSON from text and to text. Parser and serializer are templates: compiled here once, not in every file that calls them.
#pragma once
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace tessera {

/// JSON that people wrote. \param name  of the file, for messages
/// \throws InputError naming it and the byte where it is no JSON, or that a number is beyond all reading
nlohmann::json parse_json(const std::string& text, const std::string& name);

/// JSON that the program wrote itself. \throws nlohmann::json::exception
nlohmann::json parse_json(const std::string& text);

/// A discarded value where the text is no JSON.
nlohmann::json try_parse_json(const std::string& text);

/// What is no UTF-8 becomes U+FFFD. \param indent  spaces a level; negative: all in one line
std::string dump_json(const nlohmann::json& value, int indent = -1);

}  // namespace tessera
