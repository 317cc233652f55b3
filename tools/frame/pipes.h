/// \file pipes.h
/// `-` as input and output of a command: formats are read from any place of a file, so what comes from a pipe waits in a scratch file,
/// and what goes into one does until it is complete.
#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stream/files/scratch_folder.h"
#include "stream/runtime/option_table.h"

namespace tessera::cli {

/// Whether a path stands for a pipe.
bool is_pipe(const std::filesystem::path& path);

/// Where a pipe's bytes wait: a folder of the system's scratch that goes with it.
class PipeFolder {
 public:
  /// \param option  that names the format, an extension, "las" or ".las"; \throws UsageError where it is not named, or is none
  std::filesystem::path file(const char* stem, const std::string& format, const char* option);

 private:
  std::unique_ptr<ScratchFolder> scratch_;
};

/// `-` among what a command reads: while this lives, a file of what standard input holds, named by its format.
class PipedInput {
 public:
  PipedInput() = default;
  /// \throws UsageError where the format is not named, one is named for a file, or the pipe is a terminal; ResourceError
  PipedInput(std::vector<std::string>& inputs, const std::string& format);
  PipedInput(std::filesystem::path& input, const std::string& format);

 private:
  PipeFolder folder_;
};

/// The option of such a command.
void add_input_format(OptionTable& t, std::string& format);

class Pipes {
 public:
  /// \param inputs  as PipedInput has them
  /// \param output  `-` becomes a scratch file
  /// \param input_format,output_format  extensions, "las" or ".las"
  /// \throws as PipedInput
  Pipes(std::vector<std::string>& inputs, const std::string& input_format, std::filesystem::path& output,
        const std::string& output_format);

  /// Results go to standard output: words belong on standard error.
  bool writes() const { return !output_.empty(); }
  /// Once the command is done. \throws ResourceError where standard output takes no more
  void finish() const;

 private:
  PipeFolder folder_;
  std::filesystem::path output_;
  PipedInput input_;
};

}  // namespace tessera::cli
