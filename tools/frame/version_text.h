/// \file version_text.h
/// What `--version` says: the version, how it was built, and the libraries that are loaded with their licences.
#pragma once
#include <string>

namespace tessera::cli {

/// \param program  its name, first in the text
std::string version_text(const std::string& program);

}  // namespace tessera::cli
