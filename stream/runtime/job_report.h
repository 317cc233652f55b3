/// \file job_report.h
/// What a job leaves for its user: report, page, and the files that are made of the report; of a refused job too.
#pragma once
#include <chrono>
#include <functional>
#include <string>

#include "octree/error.h"
#include "stream/runtime/job.h"

namespace tessera {

/// Of processors, by this process and children waited for.
double cpu_seconds();
double seconds_since(std::chrono::steady_clock::time_point start);

/// What a job took, from its report: "12.3 s, peak 141 MiB".
std::string cost_text(const Json& report);

/// Of a job that is done. The page is made first, so that the report counts what it took.
/// \param report  gets the files beside the output, and what the page took
void write_reports(const JobState& state, const JobDescription& job, Json& report,
                   std::chrono::steady_clock::time_point start);

/// What was found until a job was refused: what stood in the input, what it would have taken. Where no
/// report can be written there is none: the refusal itself is what the user must hear of.
void report_refusal(const JobState& state, const JobDescription& job, const Error& refusal,
                    const std::function<Json()>& report_now);

}  // namespace tessera
