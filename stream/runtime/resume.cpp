#include "stream/runtime/resume.h"

#include <algorithm>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/commit.h"

namespace tessera {
namespace {

bool is_obsolete(const std::string& name, const std::vector<std::string>& obsolete) {
  return std::any_of(obsolete.begin(), obsolete.end(), [&](const std::string& gone) {
    return gone.back() == '/' ? name.rfind(gone, 0) == 0 : name == gone;
  });
}

std::string content(const TaskRecord& record) {
  std::string text;
  for (const FileRecord& file : record.files) {
    text += file.name + " " + std::to_string(file.bytes) + " " + hex64(file.xxh3) + "\n";
  }
  return text + dump_json(record.summary) + "\n";
}

}  // namespace

std::vector<Json> StageRecords::summaries() const {
  std::vector<Json> list;
  for (const TaskRecord& record : tasks) list.push_back(record.summary);
  return list;
}

std::string plan_hash(const RunOptions& run) {
  return hex64(hash_text(dump_json(plan_to_json(run))));
}

std::string next_basis(const std::string& basis, const StageRecords& records) {
  std::string text = basis + "\n" + records.finish.stage + " " + records.finish.plan + "\n";
  for (const TaskRecord& record : records.tasks) text += content(record);
  return hex64(hash_text(text + content(records.finish)));
}

bool find_complete(const Journal& journal, const std::string& stage, const std::string& basis,
                   StageRecords& records) {
  const auto at = journal.stages.find(stage);
  if (at == journal.stages.end()) return false;
  // The newest finish wins: a stage done again under another plan leaves an older one behind.
  for (auto finish = at->second.rbegin(); finish != at->second.rend(); ++finish) {
    if (finish->task != kFinishTask || finish->basis != basis) continue;
    const auto found = journal.find(stage, basis, finish->plan);
    if (found.size() != finish->tasks + 1) continue;
    records = {};
    records.finish = *finish;
    for (const auto& [task, record] : found) {
      if (task != kFinishTask) records.tasks.push_back(*record);
    }
    return true;
  }
  return false;
}

Resume::Resume(const JobState& state, std::vector<std::string> stages, std::string job_hash, bool hash)
    : state_(state), stages_(std::move(stages)), job_hash_(std::move(job_hash)), hash_(hash) {}

bool Resume::intact(const TaskRecord& record, const std::vector<std::string>& obsolete) {
  TaskRecord needed = record;
  std::erase_if(needed.files, [&](const FileRecord& file) { return is_obsolete(file.name, obsolete); });
  if (needed.files.empty()) return true;
  std::string key =
      record.stage + " " + std::to_string(record.task) + " " + record.plan + " " + content(needed);
  // Sizes are looked at every time, contents once.
  const bool known = verified_.count(key) > 0;
  if (!files_match(state_, needed, hash_ && !known)) return false;
  verified_.insert(std::move(key));
  return true;
}

std::size_t Resume::complete_until(const Journal& journal, std::size_t first, std::string& basis,
                                   std::vector<StageRecords>& found) {
  std::vector<StageRecords> candidates;
  std::vector<std::string> bases = {basis};
  for (std::size_t s = first; s < stages_.size(); ++s) {
    StageRecords records;
    if (!find_complete(journal, stages_[s], bases.back(), records)) break;
    bases.push_back(next_basis(bases.back(), records));
    candidates.push_back(std::move(records));
  }
  // From the last backwards: what a complete stage made obsolete need not be there. A stage with a damaged
  // file is not complete, and then nothing that it or later ones deleted may be missing either: look again
  // without them.
  std::size_t complete = candidates.size();
  for (bool converged = false; !converged;) {
    converged = true;
    std::vector<std::string> obsolete;
    for (std::size_t s = complete; s-- > 0;) {
      const StageRecords& records = candidates[s];
      bool whole = intact(records.finish, obsolete);
      // What its own finish took in, its tasks need not have any more.
      obsolete.insert(obsolete.end(), records.finish.obsolete.begin(), records.finish.obsolete.end());
      whole = whole && std::all_of(records.tasks.begin(), records.tasks.end(),
                                   [&](const TaskRecord& record) { return intact(record, obsolete); });
      if (!whole) {
        complete = s;
        converged = false;
        break;
      }
    }
  }
  found.assign(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(complete));
  basis = bases[complete];
  return first + complete;
}

std::map<std::int64_t, TaskRecord> Resume::done_tasks(const Journal& journal, const std::string& stage,
                                                      const std::string& basis, const std::string& plan) {
  std::map<std::int64_t, TaskRecord> done;
  for (const auto& [task, record] : journal.find(stage, basis, plan)) {
    if (task != kFinishTask && intact(*record, {})) done.emplace(task, *record);
  }
  return done;
}

}  // namespace tessera
