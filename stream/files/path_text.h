/// \file path_text.h
/// Names of files may hold any bytes; JSON holds UTF-8 only.
#pragma once
#include <filesystem>
#include <string>

namespace tessera {

/// The same text where it is UTF-8; every other byte b becomes the character U+10F700 + b (private use), so that
/// nothing is lost. Those characters themselves are written byte by byte.
std::string json_text(const std::string& bytes);
inline std::string json_text(const std::filesystem::path& path) {
  return json_text(path.string());
}
/// The inverse.
std::string bytes_of_json_text(const std::string& text);

}  // namespace tessera
