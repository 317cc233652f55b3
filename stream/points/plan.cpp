#include "stream/points/plan.h"

#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json_text.h"
#include "stream/files/packed_file.h"

namespace tessera {
namespace {

constexpr int kPlanVersion = 5;
constexpr PackedKind kBricksKind = {"TSBRICK3", "a brick list"};

}  // namespace

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PointDispositions, read, withheld, empty, missing, other_class,
                                   other_return, outside, thinned, non_finite, absurd, kept)

nlohmann::json Plan::to_json() const {
  nlohmann::json j;
  j["version"] = kPlanVersion;
  j["h"] = lattice.h;
  j["origin_brick"] = lattice.origin_brick;
  j["radius_cells"] = radius_cells;
  j["noise_cells"] = noise_cells;
  j["spacing"] = spacing;
  j["auto_resolution"] = auto_resolution;
  j["resolution_reason"] = resolution_reason;
  j["has_colour"] = has_colour;
  j["colour_range"] = colour_range;
  j["normal_fraction"] = normal_fraction;
  j["grid_normals"] = grid_normals;
  j["multi_return_fraction"] = multi_return_fraction;
  j["sensors"] = sensors;
  j["brick_min"] = brick_min;
  j["brick_max"] = brick_max;
  j["bricks"] = bricks;
  j["faces_estimate"] = faces_estimate;
  j["points"] = dispositions;
  j["buckets"] = nlohmann::json::array();
  for (const PlanBucket& b : buckets)
    j["buckets"].push_back({b.first_key, b.first_brick, b.bricks, b.points});
  j["warnings"] = warnings;
  return j;
}

void Plan::save(const std::filesystem::path& file) const {
  write_durably(file, dump_json(to_json(), 1) + "\n");
}

Plan Plan::load(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file))
    throw InputError(file.string() + ": cannot be opened: the survey has not written it");
  const std::string text = read_text(file);
  Plan p;
  try {
    const nlohmann::json j = parse_json(text);
    const int version = j.at("version").get<int>();
    if (version != kPlanVersion)
      throw InputError(file.string() + ": plan version " + std::to_string(version) + ", this tool reads " +
                       std::to_string(kPlanVersion) + "; run again with --force");
    j.at("h").get_to(p.lattice.h);
    j.at("origin_brick").get_to(p.lattice.origin_brick);
    j.at("radius_cells").get_to(p.radius_cells);
    j.at("noise_cells").get_to(p.noise_cells);
    j.at("spacing").get_to(p.spacing);
    j.at("auto_resolution").get_to(p.auto_resolution);
    j.at("resolution_reason").get_to(p.resolution_reason);
    j.at("has_colour").get_to(p.has_colour);
    j.at("colour_range").get_to(p.colour_range);
    j.at("normal_fraction").get_to(p.normal_fraction);
    j.at("grid_normals").get_to(p.grid_normals);
    j.at("multi_return_fraction").get_to(p.multi_return_fraction);
    j.at("sensors").get_to(p.sensors);
    j.at("brick_min").get_to(p.brick_min);
    j.at("brick_max").get_to(p.brick_max);
    j.at("bricks").get_to(p.bricks);
    j.at("faces_estimate").get_to(p.faces_estimate);
    j.at("points").get_to(p.dispositions);
    for (const auto& b : j.at("buckets"))
      p.buckets.push_back({b.at(0).get<std::uint64_t>(), b.at(1).get<std::uint64_t>(),
                           b.at(2).get<std::uint64_t>(), b.at(3).get<std::uint64_t>()});
    j.at("warnings").get_to(p.warnings);
  } catch (const nlohmann::json::exception& e) {
    throw InputError(file.string() + ": damaged plan (" + e.what() + "); run again with --force");
  }
  return p;
}

void save_plan_bricks(const std::filesystem::path& file, const std::vector<PlanBrick>& bricks) {
  PackedWriter(file, kBricksKind, std::size_t{1} << 20).finish(bricks);
}

std::vector<PlanBrick> load_plan_bricks(const std::filesystem::path& file) {
  return PackedFile(file, kBricksKind, sizeof(PlanBrick)).table<PlanBrick>();
}

std::vector<PlanBucket> cut_buckets(const std::vector<PlanBrick>& bricks, std::uint64_t target_points,
                                    std::uint64_t max_brick_points) {
  std::vector<PlanBucket> buckets;
  bool closed = true;  // the last bucket takes no more
  for (std::size_t i = 0; i < bricks.size(); ++i) {
    const bool hot = bricks[i].points > max_brick_points;
    if (closed || hot || buckets.back().points + bricks[i].points > target_points)
      buckets.push_back({bricks[i].key, i, 0, 0});
    buckets.back().bricks += 1;
    buckets.back().points += bricks[i].points;
    closed = hot;
  }
  return buckets;
}

}  // namespace tessera
