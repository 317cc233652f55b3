#include "tools/frame/pipes.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>

#include "octree/error.h"
#include "stream/files/output_file.h"
#include "stream/files/read_file.h"
#include "stream/files/system_reason.h"
#include "stream/runtime/stop.h"

namespace tessera::cli {
namespace {

constexpr std::size_t kPipeBytes = std::size_t{1} << 20;

void copy_standard_input(const std::filesystem::path& to) {
  OutputFile file(to);
  std::uint64_t sum = 0;
  for (;;) {
    throw_if_stopped();
    char* const at = file.reserve(kPipeBytes);
    const ssize_t n = ::read(STDIN_FILENO, at, kPipeBytes);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw InputError("standard input cannot be read: " + os_reason(errno));
    if (n == 0) break;
    file.commit(static_cast<std::size_t>(n));
    sum += static_cast<std::uint64_t>(n);
  }
  if (sum == 0) throw InputError("standard input is empty");
  file.finish();
}

}  // namespace

bool is_pipe(const std::filesystem::path& path) {
  return path == "-";
}

std::filesystem::path PipeFolder::file(const char* stem, const std::string& format, const char* option) {
  if (format.empty())
    throw UsageError(std::string("a pipe has no name that tells its format: give ") + option + ", e.g. ply");
  if (format.find('/') != std::string::npos)
    throw UsageError(std::string(option) + " is an extension, e.g. ply");
  if (!scratch_) scratch_ = std::make_unique<ScratchFolder>(std::filesystem::temp_directory_path(), "pipe");
  return scratch_->path() / (stem + ("." + format.substr(format.front() == '.' ? 1 : 0)));
}

PipedInput::PipedInput(std::vector<std::string>& inputs, const std::string& format) {
  const auto pipes =
      std::count_if(inputs.begin(), inputs.end(), [](const std::string& i) { return is_pipe(i); });
  if (pipes > 1)
    throw UsageError("standard input (-) can be read once, and is given " + std::to_string(pipes) + " times");
  if (pipes == 0 && !format.empty()) throw UsageError("--input-format is of an input that is a pipe (-)");
  if (pipes == 0) return;
  if (::isatty(STDIN_FILENO) == 1)
    throw UsageError("-: standard input is a terminal; send a file or a program's output into it");
  const std::filesystem::path spooled = folder_.file("input", format, "--input-format");
  copy_standard_input(spooled);
  for (std::string& input : inputs)
    if (is_pipe(input)) input = spooled.string();
}

PipedInput::PipedInput(std::filesystem::path& input, const std::string& format) {
  std::vector<std::string> inputs = {input.string()};
  *this = PipedInput(inputs, format);
  input = inputs.front();
}

void add_input_format(OptionTable& t, std::string& format) {
  t.add("input-format", &format, "format of an input that is a pipe (-), as an extension, e.g. las");
}

Pipes::Pipes(std::vector<std::string>& inputs, const std::string& input_format, std::filesystem::path& output,
             const std::string& output_format) {
  if (!is_pipe(output) && !output_format.empty())
    throw UsageError("--output-format is of an output that is a pipe (-o -)");
  if (is_pipe(output)) {
    if (::isatty(STDOUT_FILENO) == 1)
      throw UsageError("-o -: standard output is a terminal; send it into a file or a program");
    output = output_ = folder_.file("output", output_format, "--output-format");
    std::signal(SIGPIPE, SIG_IGN);  // a reader that ends early is an error with a sentence
  }
  input_ = PipedInput(inputs, input_format);
}

void Pipes::finish() const {
  if (!writes()) return;
  const ReadFile file(output_);
  const auto buffer = std::make_unique<char[]>(kPipeBytes);
  for (std::uint64_t at = 0; at < file.size();) {
    throw_if_stopped();
    const std::uint64_t n = std::min<std::uint64_t>(kPipeBytes, file.size() - at);
    file.read_at(at, buffer.get(), n);
    for (std::uint64_t done = 0; done < n;) {
      const ssize_t wrote = ::write(STDOUT_FILENO, buffer.get() + done, static_cast<std::size_t>(n - done));
      if (wrote < 0 && errno == EINTR) continue;
      if (wrote < 0)
        throw ResourceError("standard output takes no more after " + std::to_string(at + done) + " of " +
                            std::to_string(file.size()) + " bytes: " + os_reason(errno));
      done += static_cast<std::uint64_t>(wrote);
    }
    at += n;
  }
}

}  // namespace tessera::cli
