#include "stream/page/report_value.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "stream/files/json.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"

namespace tessera {

namespace {

/// Numbers made here may be of a signed type, those read from a file are not: both are to look the same.
bool is_count(const Json& value) {
  return value.is_number_unsigned() || (value.is_number_integer() && value.integer() >= 0);
}

}  // namespace

const Json& value_at(const Json& j, const std::string& pointer) {
  static const Json kNull;
  const Json* value = j.at_path(pointer);
  return value != nullptr ? *value : kNull;
}

std::string text_at(const Json& j, const std::string& pointer) {
  const Json& value = value_at(j, pointer);
  if (value.is_string()) return value.get<std::string>();
  return value.is_number() ? dump_json(value) : "";
}

double number_at(const Json& j, const std::string& pointer) {
  const Json& value = value_at(j, pointer);
  return value.is_number() ? value.get<double>() : 0.0;
}

double tolerance_of_job(const Json& report) {
  const Json& taken = value_at(report, "/tolerance/taken");
  return taken.is_number() ? taken.get<double>() : number_at(report, "/options/tolerance");
}

const Json& stage_result(const Json& report, const std::string& stage) {
  static const Json kNull;
  const Json& stages = value_at(report, "/stages");
  if (stages.is_array())
    for (const Json& entry : stages)
      if (text_at(entry, "/name") == stage) return value_at(entry, "/result");
  return kNull;
}

std::string coverage_text(const Json& report) {
  const auto percent = [&](const char* pointer) {
    const double share = std::clamp(number_at(report, pointer), 0.0, 1.0);
    return share == 1.0 ? std::string("100 %") : fmt::format("{:.2f} %", std::floor(1e4 * share) / 100.0);
  };
  std::string text;
  if (value_at(report, "/coverage/confirmed").is_number())
    text = percent("/coverage/confirmed") + " of what was seen is in the mesh";
  if (value_at(report, "/coverage/plan").is_number())
    text += (text.empty() ? "" : ", ") + std::string("seen from above ") + percent("/coverage/plan");
  return text;
}

std::string ground_text(const Json& report) {
  const Json& share = value_at(report, "/ground/unseen_share");
  if (!share.is_number()) return "";
  return fmt::format("{:.1f} % of the ground was not seen: a membrane, marked as synthetic, stands for it",
                     100.0 * std::clamp(share.get<double>(), 0.0, 1.0));
}

std::string count_text(const Json& value) {
  if (is_count(value)) return with_commas(value.get<std::uint64_t>());
  return value.is_number() ? number_text(value.get<double>()) : "";
}

std::string bytes_text(const Json& value) {
  return is_count(value) ? format_bytes(value.get<std::uint64_t>()) : "";
}

std::string time_text(double seconds) {
  if (!(seconds >= 60.0)) return fmt::format("{:.3g} s", seconds);
  if (!(seconds < 1e9)) return number_text(seconds) + " s";
  const auto whole = static_cast<std::uint64_t>(std::llround(seconds));
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

}  // namespace tessera
