/// \file shell.h
/// Programs run as a user runs them.
#pragma once
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/helpers/temp_folder.h"

namespace tessera::test {

inline void spill(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

struct Outcome {
  int code = 0;      ///< exit code, or 128 + signal
  std::string said;  ///< stdout and stderr together
};

/// A shell command.
inline Outcome shell(const std::string& command) {
  TempFolder scratch;
  const std::string out = (scratch / "out").string();
  const int status = std::system(("exec >" + out + " 2>&1; " + command).c_str());
  Outcome outcome;
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  outcome.said = file_bytes(out);
  return outcome;
}

}  // namespace tessera::test
