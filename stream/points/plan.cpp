#include "stream/points/plan.h"

#include "kernels/field/field.h"
#include "kernels/points/spacing.h"
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/packed_file.h"

namespace tessera {
namespace {

constexpr int kPlanVersion = 6;
constexpr PackedKind kBricksKind = {"TSBRICK3", "a brick list"};

}  // namespace

Json Plan::to_json() const {
  Json j = fields_to_json(*this);
  j["version"] = kPlanVersion;
  j["buckets"] = Json::array();
  for (const PlanBucket& b : buckets)
    j["buckets"].push_back({b.first_key, b.first_brick, b.bricks, b.points});
  return j;
}

bool Plan::is_sparse() const {
  return auto_resolution && points() < kSparseScan && spacing > lattice.h && noise_cells > kExactNoise;
}

void Plan::save(const std::filesystem::path& file) const {
  write_text(file, dump_json(to_json(), 1) + "\n");
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
    p = fields_from_json<Plan>(j);
    for (const auto& b : j.at("buckets"))
      p.buckets.push_back({b.at(0).get<std::uint64_t>(), b.at(1).get<std::uint64_t>(),
                           b.at(2).get<std::uint64_t>(), b.at(3).get<std::uint64_t>()});
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
