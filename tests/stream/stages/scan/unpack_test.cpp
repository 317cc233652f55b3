#include <catch2/catch.hpp>

#include "stream/stages/scan/unpack_stage.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

namespace unpack_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// Two files, the second one packed; points of several classes.
std::shared_ptr<PointInputs> inputs_of(const std::vector<TestPoint>& points, const ChainSetup& setup) {
  std::vector<std::unique_ptr<PointFile>> files;
  for (int f = 0; f < 2; ++f) {
    std::vector<TestPoint> half;
    for (std::size_t i = static_cast<std::size_t>(f); i < points.size(); i += 2) half.push_back(points[i]);
    auto file = std::make_unique<MemoryPoints>(half, 700, 300);
    file->edit().packed = f == 1;
    files.push_back(std::move(file));
  }
  return std::make_shared<PointInputs>(std::move(files), setup.options, setup.task_points * 24);
}

}  // namespace

TEST_CASE("unpack: what the passes read of packed inputs afterwards is what they read before", "[unit]") {
  auto points = sphere_points(5000, 30.0, {0, 0, 0});
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].echo = Echo{static_cast<std::uint8_t>(i % 3 == 0 ? 7 : 2), 1, 1};
    points[i].rgba = static_cast<std::uint32_t>(i);
  }
  ChainSetup setup;
  const TempFolder work;
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = inputs_of(points, setup);
  CHECK(inputs->has_packed());
  const auto read = [&] {
    SerialContext context(work.path());
    std::vector<std::uint32_t> colours;
    ReadCounts sum;
    for (std::size_t k = 0; k < inputs->task_count(); ++k) {
      const ReadCounts c = inputs->read(k, context, true, [&](std::uint32_t file, const PointChunk& chunk) {
        colours.push_back(file);
        colours.insert(colours.end(), chunk.rgba.begin(), chunk.rgba.end());
      });
      sum.points += c.points;
      sum.other_class += c.other_class;
    }
    CHECK(context.advanced == inputs->bytes());
    CHECK(sum.points == 5000);
    CHECK(sum.other_class == 1667);
    return colours;
  };
  const auto before = read();
  const auto stage = make_unpack_stage(job, inputs);
  const auto report = run_stage(*stage, job.work);
  CHECK(report.at("bytes").get<std::uint64_t>() > 0);
  for (std::size_t k = 0; k < inputs->task_count(); ++k)
    CHECK(std::filesystem::exists(job.work / PointInputs::unpacked_file(k)) == inputs->is_packed(k));
  inputs->read_unpacked_of(job.work, true);
  CHECK(read() == before);
}

TEST_CASE("unpack: nothing to do where nothing is packed", "[unit]") {
  ChainSetup setup;
  const TempFolder work;
  const JobState job = chain_job(work.path(), setup);
  const auto stage = make_unpack_stage(job, chain_inputs(sphere_points(500, 30.0, {0, 0, 0}), setup));
  CHECK(stage->task_count() == 0);
  CHECK(run_stage(*stage, job.work).contains("skipped"));
}

}  // namespace unpack_test
