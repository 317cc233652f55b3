/// \file scratch_folder.h
/// A folder of a command's own that goes with all it holds when the command ends.
#pragma once
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include "stream/files/durable_file.h"

namespace tessera {

class ScratchFolder {
 public:
  /// \param word  goes into its name: tessera-<word>-XXXXXX. \throws ResourceError when it cannot be made
  ScratchFolder(const std::filesystem::path& parent, const std::string& word) {
    std::string name = (parent / ("tessera-" + word + "-XXXXXX")).string();
    if (::mkdtemp(name.data()) == nullptr) throw_write_error(name, errno);
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace tessera
