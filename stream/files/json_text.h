/// \file json_text.h
/// JSON that people wrote.
#pragma once
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace tessera {

/// \param name  of the file, for messages
/// \throws InputError naming it and the byte where it is no JSON, or that a number is beyond all reading
nlohmann::json parse_json(const std::string& text, const std::string& name);

}  // namespace tessera
