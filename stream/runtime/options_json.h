/// \file options_json.h
/// Options as JSON: the effective ones in job.json, and the reason why two jobs differ.
#pragma once
#include <string>

#include <nlohmann/json.hpp>

#include "stream/runtime/options.h"
#include "stream/runtime/stage.h"

namespace tessera {

nlohmann::json to_json(const ReconstructOptions& options);
/// \throws nlohmann::json::exception for a missing or mistyped field
ReconstructOptions reconstruct_options_from_json(const nlohmann::json& json);

/// What a job computes: state.settings if it has any, else state.options.
nlohmann::json options_of(const JobState& state);

/// What of RunOptions decides how work is cut into tasks.
nlohmann::json plan_to_json(const RunOptions& run);

/// "resolution was 0.1 and is 0.2": the first difference between two flat objects, empty if there is none.
std::string first_difference(const nlohmann::json& was, const nlohmann::json& is);

}  // namespace tessera
