/// \file child_process.h
/// `--processes`: a task as a process of its own, this program called as `task WORKDIR STAGE K`.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

namespace tessera {

struct ChildResult {
  int exit_code = -1;  ///< -1 when a signal ended it
  int signal = 0;
  std::string message;  ///< what it wrote to stderr
};

/// Runs this program as `task WORK STAGE K --writer W --driven PID` and waits, asleep. A stop signal is
/// passed on to it. A child that is killed by someone else is started again, twice at most.
/// \param lock  descriptor that the child holds open: a lock on it lasts until the last child has ended
ChildResult run_task_process(const std::filesystem::path& work, const std::string& stage, std::int64_t task,
                             const std::string& writer, int lock);

/// Throws the exception that the child's exit code stands for, with its message.
[[noreturn]] void throw_child_failure(const ChildResult& result, const std::string& stage, std::int64_t task);

/// In the child: ends this process when the parent ends, whatever ends it. \throws StoppedError when it
/// already has
void follow_parent(int parent);

}  // namespace tessera
