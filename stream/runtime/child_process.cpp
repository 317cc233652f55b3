#include "stream/runtime/child_process.h"

#include <cerrno>
#include <csignal>
#include <cstring>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr int kStopCheckMs = 100;
constexpr int kTries = 3;
constexpr int kLockDescriptor = STDERR_FILENO + 1;
constexpr std::size_t kMessageLimit = 16384;

std::string task_argument(std::int64_t task) {
  return task == kFinishTask ? "finish" : std::to_string(task);
}

/// Reads the child's stderr until it ends; passes a stop signal on, once.
std::string watch(pid_t child, int pipe) {
  std::string text;
  bool forwarded = false;
  char buffer[1024];
  for (;;) {
    pollfd entry = {pipe, POLLIN, 0};
    const int ready = ::poll(&entry, 1, kStopCheckMs);
    if (!forwarded && stop_signal() != 0) {
      ::kill(child, stop_signal());
      forwarded = true;
    }
    if (ready <= 0) continue;
    const ssize_t got = ::read(pipe, buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return text;
    if (text.size() < kMessageLimit) text.append(buffer, static_cast<std::size_t>(got));
  }
}

/// \param words  its name first \param lock  kept open in the child; -1 = none
ChildResult run_once(const char* program, std::vector<std::string> words, int lock) {
  int ends[2] = {-1, -1};
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    throw ResourceError(fmt::format("cannot start {}: {}", words.front(), std::strerror(errno)));
  }
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  if (lock >= 0) ::posix_spawn_file_actions_adddup2(&actions, lock, kLockDescriptor);
  pid_t child = 0;
  const int error = ::posix_spawn(&child, program, &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  ChildResult result;
  if (error == 0) result.message = watch(child, ends[0]);
  ::close(ends[0]);
  if (error != 0)
    throw ResourceError(fmt::format("cannot start {}: {}", words.front(), std::strerror(error)));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  while (!result.message.empty() && result.message.back() == '\n') result.message.pop_back();
  return result;
}

}  // namespace

ChildResult run_task_process(const std::filesystem::path& work, const std::string& stage, std::int64_t task,
                             const std::string& writer, int lock) {
  const std::vector<std::string> words = {"tessera",
                                          "task",
                                          work.string(),
                                          stage,
                                          task_argument(task),
                                          "--writer",
                                          writer,
                                          "--driven",
                                          std::to_string(::getpid())};
  ChildResult result;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    throw_if_stopped();
    result = run_once("/proc/self/exe", words, lock);
    if (result.signal != SIGKILL) break;
  }
  return result;
}

std::filesystem::path program_beside(const std::string& name, const std::string& advice) {
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
  if (::access(program.c_str(), X_OK) != 0)
    throw ResourceError(fmt::format("{}: is not there or cannot be run; {}", program.string(), advice));
  return program;
}

ChildResult run_program(const std::filesystem::path& program, const std::vector<std::string>& words) {
  std::vector<std::string> all = {program.filename().string()};
  all.insert(all.end(), words.begin(), words.end());
  return run_once(program.c_str(), std::move(all), -1);
}

void throw_child_failure(const ChildResult& result, const std::string& stage, std::int64_t task) {
  throw_child_failure(result, fmt::format("stage {}, task {}", stage, task_argument(task)));
}

void throw_child_failure(const ChildResult& result, const std::string& who) {
  throw_if_stopped();
  if (result.signal != 0) {
    const std::string sentence = fmt::format("{}: its process was ended by signal {} ({})", who,
                                             result.signal, ::strsignal(result.signal));
    if (result.signal == SIGKILL) throw ResourceError(sentence + "; the same command goes on");
    throw std::runtime_error(sentence);
  }
  std::string message = result.message;
  const std::string prefix = "tessera: error: ";
  if (const std::size_t at = message.rfind(prefix); at != std::string::npos)
    message = message.substr(at + prefix.size());
  if (message.empty()) message = who + ": its process failed";
  switch (result.exit_code) {
    case static_cast<int>(ExitCode::kUsage):
    case static_cast<int>(ExitCode::kInput):
    case static_cast<int>(ExitCode::kResources):
    case static_cast<int>(ExitCode::kEmpty):
    case static_cast<int>(ExitCode::kValidation):
    case static_cast<int>(ExitCode::kStopped):
      throw Error(static_cast<ExitCode>(result.exit_code), message);
    default:
      throw std::runtime_error(message);
  }
}

void follow_parent(int parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) throw StoppedError("the process that drives this job has ended");
}

}  // namespace tessera
