#include "stream/runtime/task_counts.h"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace tessera {
namespace {

bool is_negative(const Json& value) {
  return value.is_number_integer() && !value.is_number_unsigned() && value.get<std::int64_t>() < 0;
}

/// Integers that the program made are signed or not, those read from a journal are unsigned unless negative: the sum is as
/// if it had been read.
void add_integer(Json& sum, const Json& value) {
  const std::uint64_t total = (sum.is_null() ? 0 : sum.get<std::uint64_t>()) + value.get<std::uint64_t>();
  const auto below_zero = static_cast<std::int64_t>(total);
  if (below_zero < 0 && (is_negative(sum) || is_negative(value)))
    sum = below_zero;
  else
    sum = total;
}

}  // namespace

void add_counts(Json& sum, const Json& part) {
  if (sum.is_null()) sum = Json::object();
  for (const auto& [key, value] : part.items()) {
    if (value.is_number_integer()) add_integer(sum[key], value);
    if (value.is_number_float()) sum[key] = std::max(sum.value(key, 0.0), value.get<double>());
    if (value.is_object()) add_counts(sum[key], value);
  }
}

Json sum_counts(const std::vector<Json>& summaries, Json sum) {
  for (const Json& summary : summaries) add_counts(sum, summary);
  return sum;
}

}  // namespace tessera
