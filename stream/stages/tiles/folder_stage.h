/// \file folder_stage.h
/// A stage of another job inside a folder of this one's work directory: its files, and what it reads of earlier ones,
/// lie below the folder, so that the same stages can run once for every level.
#pragma once
#include <functional>
#include <string>

#include "stream/files/json.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// The entry with JobState::work, names of files and what becomes obsolete below `folder`; its name is "folder-name".
/// Names that begin with '@' (journal.h) stay as they are.
/// \param result_file  if not empty: this file below the folder gets what finish() returned, as JSON
/// \param check  if not empty: called with what finish() returned; may throw
StageEntry stage_in_folder(const std::string& folder, const StageEntry& entry,
                           const std::string& result_file = "",
                           const std::function<void(const Json&)>& check = {});

}  // namespace tessera
