/// \file manual.h
/// The manual page and the completion of the shell, from the tables that make the help.
#pragma once
#include <string>
#include <vector>

#include "tools/frame/cli.h"

namespace tessera::cli {

/// tessera.1 in roff, section 1.
std::string man_page(const std::string& name, const std::string& description,
                     const std::vector<Command>& commands);

/// For bash: commands, options of the command, words that an option takes, files elsewhere.
std::string bash_completion(const std::string& name, const std::vector<Command>& commands);

}  // namespace tessera::cli
