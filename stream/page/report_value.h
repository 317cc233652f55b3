/// \file report_value.h
/// Values of a report by JSON pointer, and as people read them. A report may come from anywhere: what is not there, or is of
/// another kind, is null or empty and never an error.
#pragma once
#include <string>

#include "stream/files/json.h"

namespace tessera {

/// \param pointer  "/mesh/faces" \return null where there is no such value
const Json& value_at(const Json& json, const std::string& pointer);
/// Text as it is, numbers as JSON has them; else empty.
std::string text_at(const Json& json, const std::string& pointer);
double number_at(const Json& json, const std::string& pointer);  ///< 0 if it is none
/// What --tolerance of the job was, also where it was `auto`; 0 = none.
double tolerance_of_job(const Json& report);
/// What a stage reported; null where it did not run.
const Json& stage_result(const Json& report, const std::string& stage);

/// Of `coverage` in the report of a reconstruction: "99.30 % of what was seen is in the mesh, seen from above 99.99 %"; empty
/// where it was not measured. Nothing is 100 % of which a part is missing.
std::string coverage_text(const Json& report);
/// Of `ground`: how much of the terrain is a membrane; empty where the product is another.
std::string ground_text(const Json& report);

std::string count_text(const Json& value);  ///< 1,234,567
std::string bytes_text(const Json& value);  ///< 1.50 GiB
std::string time_text(double seconds);      ///< "2 h 05 min", "3 min 20 s", "4.5 s"

}  // namespace tessera
