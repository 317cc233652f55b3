/// \file task_counts.h
/// Sums of what the tasks of a stage counted, by key.
#pragma once
#include <vector>

#include "stream/files/json.h"

namespace tessera {

/// Integers are summed, of other numbers the largest counts, objects go member by member; all else is left out.
void add_counts(Json& sum, const Json& part);

/// Counts of all tasks. \param sum  what the sums begin with, for keys that no task may have
Json sum_counts(const std::vector<Json>& summaries, Json sum = Json::object());

}  // namespace tessera
