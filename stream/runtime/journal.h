/// \file journal.h
/// What a job has committed: one append-only file of JSON lines per writer, so that no two machines append to
/// one. A line is {"xxh3":"<16 hex digits of the record's text>","record":{...}}; a torn or damaged line
/// counts as never written, and its task is done again.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "stream/files/json.h"

namespace tessera {

/// A committed file: name relative to the work directory, kOutputName for the job's output, or after kSidecarName.
struct FileRecord {
  std::string name;
  std::uint64_t bytes = 0;
  std::uint64_t xxh3 = 0;
  bool operator==(const FileRecord&) const = default;
};

inline constexpr const char* kOutputName = "@output";  ///< name of the job's output in TaskContext::create()
/// Begins the names of files of an output that is more than one: "@beside/tiles/0.glb" lies in the output's folder.
inline constexpr const char* kSidecarName = "@beside/";
inline constexpr std::int64_t kFinishTask = -1;  ///< TaskRecord::task of a stage's finish()

/// One committed task.
struct TaskRecord {
  std::string stage;
  std::int64_t task = 0;
  std::string basis;  ///< hash of the job's identity and of everything that earlier stages committed
  /// How work was cut (cap, threads, tile size); records of a stage count together only if equal.
  std::string plan;
  std::vector<FileRecord> files;
  double seconds = 0.0;
  double cpu_seconds = 0.0;
  std::uint64_t peak_bytes = 0;
  std::optional<std::uint64_t> need_bytes;  ///< tasks only: Stage::task_bytes(), which says when it starts
  std::uint64_t bytes_read = 0;
  std::uint64_t bytes_written = 0;
  std::uint64_t units = 0;  ///< of progress
  Json summary;
  std::uint64_t tasks = 0;            ///< finish only: tasks of the stage
  std::vector<std::string> obsolete;  ///< finish only: Stage::obsolete()
  Json stage_stats;                   ///< finish only: wall, cpu, peak, bytes of the whole stage

  /// All but the files, whose hashes are written in hexadecimal digits.
  static void fields(auto& self, auto&& field) {
    field("stage", self.stage);
    field("task", self.task);
    field("basis", self.basis);
    field("plan", self.plan);
    field("seconds", self.seconds);
    field("cpu_seconds", self.cpu_seconds);
    field("peak_bytes", self.peak_bytes);
    field("need_bytes", self.need_bytes);
    field("bytes_read", self.bytes_read);
    field("bytes_written", self.bytes_written);
    field("units", self.units);
    field("summary", self.summary);
    if (self.task != kFinishTask) return;
    field("tasks", self.tasks);
    field("obsolete", self.obsolete);
    field("stage_stats", self.stage_stats);
  }
};

/// Lines, without the newline. parse_line returns false for a torn or damaged one.
std::string journal_line(const TaskRecord& record);
bool parse_journal_line(const std::string& line, TaskRecord& record);

/// Appends to one file; thread-safe.
class JournalWriter {
 public:
  /// The file of whoever drives the job on one machine. Cuts a torn last line off.
  /// \throws UsageError when another process of this machine writes it
  explicit JournalWriter(const std::filesystem::path& file);
  /// A new file that nobody else ever writes, on whatever machine: host, process and time are in its name, and it is
  /// created or refused by the file server. \param prefix  of its name
  JournalWriter(const std::filesystem::path& folder, const std::string& prefix);
  ~JournalWriter();
  JournalWriter(const JournalWriter&) = delete;
  JournalWriter& operator=(const JournalWriter&) = delete;
  /// \param durable  is when it returns; false: with the next that is
  /// \throws ResourceError when the disk is full; the line then does not exist
  void append(const TaskRecord& record, bool durable = true);
  /// Makes durable what was appended without.
  void sync();
  /// Stem of the file: tells this writer from every other of the job.
  std::string name() const { return path_.stem().string(); }

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t bytes_ = 0;
  std::mutex mutex_;
};

/// All lines of all writers of a folder, by stage and task. Of two lines for one task that agree in basis and
/// plan the later read wins: they describe the same bytes. Files are opened anew by every look, so that on a network file
/// system what other machines had closed by then is seen.
struct Journal {
  std::map<std::string, std::vector<TaskRecord>> stages;
  std::uint64_t damaged_lines = 0;

  /// The records of a stage with this basis and plan, by task.
  std::map<std::int64_t, const TaskRecord*> find(const std::string& stage, const std::string& basis,
                                                 const std::string& plan) const;
};
/// \param prefix  of the names of the files to read
Journal read_journal(const std::filesystem::path& folder, const std::string& prefix = "");
/// Makes a network file system forget what it remembers of the names in a folder: a client does when it makes one itself.
void refresh_names(const std::filesystem::path& folder);
/// One writer's file alone. \throws InputError when it cannot be read
Journal read_journal_file(const std::filesystem::path& file);

}  // namespace tessera
