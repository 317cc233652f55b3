/// \file pipes.h
/// `-` as input and output of a command: formats are read from any place of a file, so what comes from a pipe waits in a scratch file,
/// and what goes into one does until it is complete.
#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stream/files/scratch_folder.h"

namespace tessera::cli {

/// Whether a path stands for a pipe.
bool is_pipe(const std::filesystem::path& path);

class Pipes {
 public:
  /// \param inputs  `-` among them becomes a scratch file of what standard input holds, named by its format
  /// \param output  `-` becomes a scratch file too
  /// \param input_format,output_format  extensions, "las" or ".las"
  /// \throws UsageError where a format is not named, one is named for a file, or the pipe is a terminal; ResourceError for a full disk
  Pipes(std::vector<std::string>& inputs, const std::string& input_format, std::filesystem::path& output,
        const std::string& output_format);

  /// Results go to standard output: words belong on standard error.
  bool writes() const { return !output_.empty(); }
  /// Once the command is done. \throws ResourceError where standard output takes no more
  void finish() const;

 private:
  std::filesystem::path scratch_file(const char* stem, const std::string& format, const char* option);

  std::unique_ptr<ScratchFolder> scratch_;
  std::filesystem::path output_;
};

}  // namespace tessera::cli
