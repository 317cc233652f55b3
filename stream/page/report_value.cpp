#include "stream/page/report_value.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kernels/picture/caption.h"
#include "stream/files/json_text.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"

namespace tessera {

using nlohmann::json;

namespace {

/// Numbers made here may be of a signed type, those read from a file are not: both are to look the same.
bool is_count(const json& value) {
  return value.is_number_unsigned() || (value.is_number_integer() && value >= 0);
}

}  // namespace

const json& value_at(const json& j, const std::string& pointer) {
  static const json kNull;
  const json::json_pointer at(pointer);
  return j.contains(at) ? j.at(at) : kNull;
}

std::string text_at(const json& j, const std::string& pointer) {
  const json& value = value_at(j, pointer);
  if (value.is_string()) return value.get<std::string>();
  return value.is_number() ? dump_json(value) : "";
}

double number_at(const json& j, const std::string& pointer) {
  const json& value = value_at(j, pointer);
  return value.is_number() ? value.get<double>() : 0.0;
}

double tolerance_of_job(const json& report) {
  const json& taken = value_at(report, "/tolerance/taken");
  return taken.is_number() ? taken.get<double>() : number_at(report, "/options/tolerance");
}

const json& stage_result(const json& report, const std::string& stage) {
  static const json kNull;
  const json& stages = value_at(report, "/stages");
  if (stages.is_array())
    for (const json& entry : stages)
      if (text_at(entry, "/name") == stage) return value_at(entry, "/result");
  return kNull;
}

std::string coverage_text(const json& report) {
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

std::string count_text(const json& value) {
  if (is_count(value)) return with_commas(value.get<std::uint64_t>());
  return value.is_number() ? number_text(value.get<double>()) : "";
}

std::string bytes_text(const json& value) {
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
