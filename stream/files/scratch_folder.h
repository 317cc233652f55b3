/// \file scratch_folder.h
/// A folder of a command's own that goes with all it holds when the command ends.
#pragma once
#include <filesystem>
#include <string>

namespace tessera {

class ScratchFolder {
 public:
  /// Also removes what killed commands left in `parent` under names of this kind: a living one holds a lock.
  /// \param word  goes into its name: tessera-<word>-XXXXXX. \throws ResourceError when it cannot be made
  ScratchFolder(const std::filesystem::path& parent, const std::string& word);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int lock_ = -1;
};

}  // namespace tessera
