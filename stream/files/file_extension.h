/// \file file_extension.h
/// The ending that tells a file's format.
#pragma once
#include <filesystem>
#include <string>

namespace tessera {

/// Extension with its dot, ASCII letters in lower case; empty without one. The same in every locale.
inline std::string lower_extension(const std::filesystem::path& path) {
  std::string text = path.extension().string();
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

}  // namespace tessera
