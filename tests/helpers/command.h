/// \file command.h
/// Runs the `tessera` binary as a user would and tells how it ended.
/// Jobs get `--no-html`: their pages have a test of their own (tests/tools/report_test.cpp), and take longer than what most
/// tests look at.
#pragma once
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

namespace tessera::test {

struct CommandResult {
  int code = 0;        ///< exit code; 128 + signal when killed
  std::string errors;  ///< all of stderr
  std::uint64_t peak_bytes = 0;
};

/// Whether a job leaves a page that its words do not decline.
inline bool writes_page(const std::vector<std::string>& words) {
  static const std::set<std::string> kJobs = {"csg",    "decimate", "field",     "merge",  "reconstruct",
                                              "remesh", "resample", "resurface", "smooth", "tiles"};
  if (words.empty() || kJobs.count(words.front()) == 0) return false;
  return std::none_of(words.begin(), words.end(),
                      [](const std::string& w) { return w == "--no-html" || w == "--help"; });
}

/// \param kill_after_ms  SIGKILL after this time, if it still runs; 0 = let it end
/// \param environment  NAME=VALUE, added
inline CommandResult tessera_command(const std::vector<std::string>& arguments, unsigned kill_after_ms = 0,
                                     const std::string& environment = {}, bool with_page = false) {
  std::string pattern = (std::filesystem::temp_directory_path() / "tessera-stderr-XXXXXX").string();
  const int log = ::mkstemp(pattern.data());
  std::vector<std::string> words = {TESSERA_BINARY};
  words.insert(words.end(), arguments.begin(), arguments.end());
  if (!with_page && writes_page(arguments)) words.emplace_back("--no-html");
  std::vector<char*> argv;
  for (std::string& w : words) argv.push_back(w.data());
  argv.push_back(nullptr);
  std::string variable = environment;
  const pid_t child = ::fork();
  if (child == 0) {
    const int null = ::open("/dev/null", O_RDWR);
    ::dup2(null, 0);
    ::dup2(null, 1);
    ::dup2(log, 2);
    if (!variable.empty()) ::putenv(variable.data());
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  int status = 0;
  struct rusage usage {};
  bool ended = false;
  for (unsigned waited = 0; waited < kill_after_ms && !ended; ++waited) {
    ended = ::wait4(child, &status, WNOHANG, &usage) == child;
    if (!ended) ::usleep(1000);
  }
  if (!ended) {
    if (kill_after_ms > 0) ::kill(child, SIGKILL);
    ::wait4(child, &status, 0, &usage);
  }
  CommandResult result;
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.peak_bytes = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
  {
    std::ifstream in(pattern, std::ios::binary);
    result.errors.assign(std::istreambuf_iterator<char>(in), {});
  }
  ::close(log);
  std::filesystem::remove(pattern);
  return result;
}

}  // namespace tessera::test
