/// \file jobs.h
/// Every job that a work directory may hold, by its name.
#pragma once
#include <string>

#include "stream/runtime/job.h"

namespace tessera {

/// The job of this name with these options (JobState::settings): a JobFinder.
/// \throws InputError for a name that is none, UsageError for options that are not this job's
JobDescription find_job(const std::string& command, const std::string& settings);

}  // namespace tessera
