/// \file resume.h
/// What of a job is already done: the journal against the files that are there.
///
/// A record counts if its basis is the hash of the job and of everything that earlier stages committed. A
/// stage is complete if its finish and all its tasks have records of one plan, and every file is there with
/// its size and hash or was deleted because a later complete stage, or its own finish, made it obsolete.
#pragma once
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "stream/runtime/journal.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// The records of one complete stage.
struct StageRecords {
  std::vector<TaskRecord> tasks;  ///< in task order
  TaskRecord finish;
  std::vector<Json> summaries() const;
};

/// TaskRecord::plan of a job that runs like this.
std::string plan_hash(const RunOptions& run);

/// Basis of the stage after one with these records.
std::string next_basis(const std::string& basis, const StageRecords& records);

/// The records of a stage with this basis, if there is one of every task and of finish; files are not looked
/// at.
bool find_complete(const Journal& journal, const std::string& stage, const std::string& basis,
                   StageRecords& records);

class Resume {
 public:
  /// \param hash  false: trust sizes (a task process, whose parent has hashed)
  Resume(const JobState& state, std::vector<std::string> stages, std::string job_hash, bool hash);

  /// Stages from `first` on that are complete, given that all before `first` are; [first, result) can be skipped.
  /// \param basis       of stage `first`; on return of stage `result`
  /// \param[out] found  records of the stages skipped
  std::size_t complete_until(const Journal& journal, std::size_t first, std::string& basis,
                             std::vector<StageRecords>& found);
  /// Tasks of a stage that need not be done again.
  std::map<std::int64_t, TaskRecord> done_tasks(const Journal& journal, const std::string& stage,
                                                const std::string& basis, const std::string& plan);
  const std::string& first_basis() const { return job_hash_; }

 private:
  bool intact(const TaskRecord& record, const std::vector<std::string>& obsolete);

  const JobState& state_;
  std::vector<std::string> stages_;
  std::string job_hash_;
  bool hash_;
  std::set<std::string> verified_;  ///< journal lines whose files were hashed in this process
};

}  // namespace tessera
