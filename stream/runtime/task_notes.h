/// \file task_notes.h
/// What a job is at, for `tessera status`: beside its journal file every writer keeps a file of notes, JSON lines about
/// stages begun, tasks started and failed, and signs of life. Nothing is decided by them: they are not synced, a torn
/// line is passed over, and where they cannot be written the work goes on.
#pragma once
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace tessera {

class TaskNotes {
 public:
  static constexpr int kAliveSeconds = 10;  ///< between signs of life

  /// \param journal_folder  of the work directory; \param writer  stem of this writer's journal file
  TaskNotes(const std::filesystem::path& journal_folder, const std::string& writer);
  ~TaskNotes();
  TaskNotes(const TaskNotes&) = delete;
  TaskNotes& operator=(const TaskNotes&) = delete;

  void stage(const std::string& stage, std::uint64_t tasks, std::uint64_t units, const std::string& unit);
  void started(const std::string& stage, std::int64_t task);
  /// \param why  the sentence that the user is told
  void failed(const std::string& stage, std::int64_t task, const std::string& why);
  /// Any thread, as often as one likes.
  void alive();

 private:
  void write(const std::string& line);

  int fd_ = -1;
  std::mutex mutex_;
  std::atomic<std::int64_t> last_{0};
};

struct NotedStage {
  std::uint64_t tasks = 0;
  std::uint64_t units = 0;
  std::string unit;
  double begun = 0.0;  ///< seconds since 1970 by the clock of whoever began it first
};

/// A task that a writer began; whether it is done stands in the journal.
struct NotedTask {
  std::string stage;
  std::int64_t task = 0;
  std::string host;
  double begun = 0.0;
  double silent_s = 0.0;  ///< since its writer's last sign of life
  bool ended = false;     ///< its writer has failed or passed on to another task of the same thread
  std::string failure;    ///< why it failed; empty unless it did
};

struct Notes {
  std::map<std::string, NotedStage> stages;
  std::vector<NotedTask> tasks;
};

/// Notes of all writers. Silence is told by the clock of the file system, so clocks of machines may differ.
Notes read_notes(const std::filesystem::path& journal_folder);

}  // namespace tessera
