/// \file commit.h
/// One task from its start to its journal line.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "stream/runtime/journal.h"
#include "stream/runtime/progress.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Where a name of TaskContext::create() lies in the end.
std::filesystem::path committed_path(const JobState& state, const std::string& name);

/// What a file is called until it is committed.
std::filesystem::path aside_path(const std::filesystem::path& final_path);

/// True if every file of the record is there with its size and (if `hash`) its content.
bool files_match(const JobState& state, const TaskRecord& record, bool hash);

/// Runs a task, or finish() for kFinishTask, and commits it: its files are synced, get their names, and one
/// journal line says so. Killed anywhere, the task is either committed or as if it had never run.
/// \param summaries    of all tasks in order; finish only
/// \param stage_stats  called for finish only, just before its line is written: TaskRecord::stage_stats
/// \param progress     may be null
/// \throws what the stage throws; std::runtime_error naming stage and task for what is no tessera::Error
TaskRecord run_and_commit(const Stage& stage, std::int64_t task, const std::vector<nlohmann::json>& summaries,
                          const JobState& state, const std::string& basis, const std::string& plan,
                          JournalWriter& journal, const std::function<nlohmann::json()>& stage_stats,
                          Progress* progress);

}  // namespace tessera
