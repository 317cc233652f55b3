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

/// Whether an extension, in lower case, is one of meshes alone: those that are read and are no scans, so all but .ply.
inline bool is_mesh_extension(const std::string& extension) {
  for (const char* known : {".obj", ".stl", ".off", ".glb", ".3mf", ".vtu", ".msh"})
    if (extension == known) return true;
  return false;
}

}  // namespace tessera
