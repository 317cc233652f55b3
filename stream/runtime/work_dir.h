/// \file work_dir.h
/// The work directory of a job, and whose it is.
#pragma once
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/stage.h"

namespace tessera {

inline constexpr int kWorkSchema = 2;  ///< of job.json, the journal and every tile file together

/// Enough of an input to tell whether it is still the same file.
struct InputFingerprint {
  std::string path;  ///< absolute
  std::uint64_t bytes = 0;
  std::int64_t modified_ns = 0;
  std::uint64_t xxh3 = 0;  ///< of blocks sampled at start, end and evenly between
};
/// \throws InputError
InputFingerprint fingerprint_input(const std::filesystem::path& path);
Json to_json(const InputFingerprint& fingerprint);

/// \throws InputError when an input of this identity is not of the size and time that it was begun with
void require_same_inputs(const Json& identity);

/// What makes a job this job: schema, tool version, command, effective options, inputs.
Json job_identity(const std::string& command, const JobState& state,
                  const std::vector<InputFingerprint>& inputs);

/// <output>.tessera beside the output, or of that name in `temp`.
std::filesystem::path work_path(const std::filesystem::path& output, const std::filesystem::path& temp);

/// Whether a process of this machine drives the job of this work directory, or runs a task of it; false where there is none.
bool work_in_use(const std::filesystem::path& work);

/// Where a work directory keeps what concerns its batch queue; kQueueMark is there while the queue has the job.
inline constexpr const char* kQueueFolder = "queue";
inline constexpr const char* kQueueMark = "queue/active.json";
/// Variable of the environment by which the queue's own processes are known: the `token` of kQueueMark.
inline constexpr const char* kQueueToken = "TESSERA_QUEUE";

/// \throws UsageError when a batch queue has the job of this work directory and this process is not of the queue
void require_not_queued(const std::filesystem::path& work);

/// An open work directory. While it is open no other process of this machine drives the same job.
class WorkDir {
 public:
  enum class Use {
    kDrive,  ///< run the whole job: exclusive
    kTask    ///< run one task: shared with other tasks, refused while somebody drives
  };
  /// Creates the directory for this job, or opens the one that is there.
  /// \throws UsageError when it belongs to another job (and `force` does not discard it), is in use by another
  ///         process, or is no work directory; ResourceError when the disk is full
  static WorkDir open_job(const std::filesystem::path& path, const Json& identity, bool force);
  /// Whether a work directory of this very job is there; changes nothing.
  static bool holds(const std::filesystem::path& path, const Json& identity);
  /// Opens what open_job made. \param locked false: the parent process holds the lock
  /// \throws InputError when it is no work directory or of another schema or version
  static WorkDir open_existing(const std::filesystem::path& path, bool locked);

  ~WorkDir();
  WorkDir(WorkDir&& other) noexcept;
  WorkDir& operator=(WorkDir&&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path journal_folder() const { return path_ / "journal"; }
  bool created() const { return created_; }  ///< false: it was there and goes on
  const Json& identity() const { return identity_; }
  std::string job_hash() const;
  int lock() const { return lock_; }  ///< descriptor that holds the lock

  /// job.json also holds what `tessera task` needs to know: the output and how the job runs.
  void write_run(const JobState& state);
  JobState read_state() const;

  /// Files in it, by relative name, that are neither `known` nor the runtime's own (job.json, journal, log,
  /// ...).
  std::vector<std::string> unknown_files(const std::set<std::string>& known) const;

  void remove_empty_folders() const;

  /// Removes it with everything in it; killed in between, nothing of it is ever taken for a work directory.
  void remove();
  /// Removes what a killed remove() of this directory left. \param path  of the work directory
  static void remove_discarded(const std::filesystem::path& path);

 private:
  WorkDir() = default;
  std::filesystem::path path_;
  Json identity_;
  bool created_ = false;
  int lock_ = -1;
};

}  // namespace tessera
