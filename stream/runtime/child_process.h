/// \file child_process.h
/// Other processes: a task as a process of its own (`--processes`), this program called as `task WORKDIR STAGE K`; and
/// programs beside this one, which link what this one does not.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

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

/// The program of this name that stands beside this one. \throws ResourceError with `advice` when none is there
std::filesystem::path program_beside(const std::string& name, const std::string& advice);

/// Runs a program with these words and waits, asleep. A stop signal is passed on to it.
ChildResult run_program(const std::filesystem::path& program, const std::vector<std::string>& words);

/// Throws the exception that the child's exit code stands for, with its message.
/// \param who  "stage weld, task 3", for a child that says nothing
[[noreturn]] void throw_child_failure(const ChildResult& result, const std::string& who);
/// Of a task.
[[noreturn]] void throw_child_failure(const ChildResult& result, const std::string& stage, std::int64_t task);

/// In the child: ends this process when the parent ends, whatever ends it. \throws StoppedError when it
/// already has
void follow_parent(int parent);

}  // namespace tessera
