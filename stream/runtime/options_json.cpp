#include "stream/runtime/options_json.h"

#include <fmt/format.h>

namespace tessera {

nlohmann::json to_json(const ReconstructOptions& o) {
  return {{"resolution", o.resolution},
          {"radius", o.radius},
          {"method", o.method},
          {"feature-angle", o.feature_angle_deg},
          {"corner-angle", o.corner_angle_deg},
          {"min-component", o.min_component},
          {"max-hole", o.max_hole},
          {"holes", o.holes},
          {"outliers", o.outliers},
          {"normals", o.normals},
          {"viewpoint", o.viewpoints},
          {"has-up", o.has_up},
          {"up", o.up},
          {"max-uncertain", o.max_uncertain},
          {"max-brick-points", o.max_brick_points},
          {"columns", o.columns},
          {"tolerance", o.tolerance},
          {"reference", o.reference},
          {"keep-raw", o.keep_raw},
          {"local-output", o.local_output}};
}

ReconstructOptions reconstruct_options_from_json(const nlohmann::json& j) {
  ReconstructOptions o;
  j.at("resolution").get_to(o.resolution);
  j.at("radius").get_to(o.radius);
  j.at("method").get_to(o.method);
  j.at("feature-angle").get_to(o.feature_angle_deg);
  j.at("corner-angle").get_to(o.corner_angle_deg);
  j.at("min-component").get_to(o.min_component);
  j.at("max-hole").get_to(o.max_hole);
  j.at("holes").get_to(o.holes);
  j.at("outliers").get_to(o.outliers);
  j.at("normals").get_to(o.normals);
  j.at("viewpoint").get_to(o.viewpoints);
  j.at("has-up").get_to(o.has_up);
  j.at("up").get_to(o.up);
  j.at("max-uncertain").get_to(o.max_uncertain);
  j.at("max-brick-points").get_to(o.max_brick_points);
  j.at("columns").get_to(o.columns);
  j.at("tolerance").get_to(o.tolerance);
  j.at("reference").get_to(o.reference);
  j.at("keep-raw").get_to(o.keep_raw);
  j.at("local-output").get_to(o.local_output);
  return o;
}

nlohmann::json options_of(const JobState& state) {
  return state.settings.empty() ? to_json(state.options) : nlohmann::json::parse(state.settings);
}

nlohmann::json plan_to_json(const RunOptions& run) {
  return {{"memory", run.memory_bytes}, {"threads", run.threads}, {"tile-size", run.tile_cells}};
}

std::string first_difference(const nlohmann::json& was, const nlohmann::json& is) {
  for (const auto& [key, value] : is.items()) {
    const nlohmann::json before = was.is_object() && was.contains(key) ? was.at(key) : nlohmann::json();
    if (before != value) return fmt::format("{} was {} and is {}", key, before.dump(), value.dump());
  }
  return "";
}

}  // namespace tessera
