#include "stream/points/plan.h"

#include <utility>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/packed_file.h"

namespace tessera {
namespace {

constexpr int kPlanVersion = 6;
constexpr PackedKind kBricksKind = {"TSBRICK3", "a brick list"};

constexpr std::pair<const char*, std::uint64_t PointDispositions::*> kDispositions[] = {
    {"read", &PointDispositions::read},
    {"withheld", &PointDispositions::withheld},
    {"empty", &PointDispositions::empty},
    {"missing", &PointDispositions::missing},
    {"other_class", &PointDispositions::other_class},
    {"other_return", &PointDispositions::other_return},
    {"outside", &PointDispositions::outside},
    {"thinned", &PointDispositions::thinned},
    {"non_finite", &PointDispositions::non_finite},
    {"absurd", &PointDispositions::absurd},
    {"kept", &PointDispositions::kept}};

}  // namespace

Json Plan::to_json() const {
  Json j;
  j["version"] = kPlanVersion;
  j["h"] = lattice.h;
  j["origin_brick"] = lattice.origin_brick;
  j["radius_cells"] = radius_cells;
  j["noise_cells"] = noise_cells;
  j["metres"] = metres;
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
  for (const auto& [key, count] : kDispositions) j["points"][key] = dispositions.*count;
  j["buckets"] = Json::array();
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
    const Json j = parse_json(text);
    const int version = j.at("version").get<int>();
    if (version != kPlanVersion)
      throw InputError(file.string() + ": plan version " + std::to_string(version) + ", this tool reads " +
                       std::to_string(kPlanVersion) + "; run again with --force");
    j.at("h").get_to(p.lattice.h);
    j.at("origin_brick").get_to(p.lattice.origin_brick);
    j.at("radius_cells").get_to(p.radius_cells);
    j.at("noise_cells").get_to(p.noise_cells);
    j.at("metres").get_to(p.metres);
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
    for (const auto& [key, count] : kDispositions) j.at("points").at(key).get_to(p.dispositions.*count);
    for (const auto& b : j.at("buckets"))
      p.buckets.push_back({b.at(0).get<std::uint64_t>(), b.at(1).get<std::uint64_t>(),
                           b.at(2).get<std::uint64_t>(), b.at(3).get<std::uint64_t>()});
    j.at("warnings").get_to(p.warnings);
  } catch (const JsonError& e) {
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
