#include "stream/api/job_call.h"

#include <catch2/catch.hpp>

#include <atomic>
#include <cmath>
#include <stdexcept>
#include <thread>

#include "octree/error.h"
#include "stream/runtime/stop.h"
#include "tests/helpers/shell.h"

namespace job_call_test {

namespace {

using namespace tessera;
using test::file_bytes;
using test::TempFolder;

/// A sheet with a wave, as OFF.
void write_sheet(const std::filesystem::path& path, int side) {
  std::string text =
      "OFF\n" + std::to_string(side * side) + " " + std::to_string(2 * (side - 1) * (side - 1)) + " 0\n";
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(std::sin(0.2 * x)) + "\n";
  for (int y = 0; y + 1 < side; ++y)
    for (int x = 0; x + 1 < side; ++x) {
      const int v = y * side + x;
      text += "3 " + std::to_string(v) + " " + std::to_string(v + 1) + " " + std::to_string(v + side + 1) +
              "\n3 " + std::to_string(v) + " " + std::to_string(v + side + 1) + " " +
              std::to_string(v + side) + "\n";
    }
  test::spill(path, text);
}

RunOptions small_run() {
  RunOptions how;
  how.memory_bytes = std::uint64_t{256} << 20;
  how.threads = 2;
  how.page = false;
  return how;
}

}  // namespace

TEST_CASE("call: a job by types and one by keys give the same bytes, and tell how far they are",
          "[pipeline]") {
  const TempFolder folder;
  const std::string input = (folder / "in.off").string();
  write_sheet(input, 60);
  DecimateJob job{{input}, folder / "typed.ply", {}, small_run()};
  job.options.tolerance = 0.02;
  std::size_t stages = 0, notes = 0;
  const Json report = job.run([&](const JobProgress& p) {
    ++notes;
    stages += p.stage_done;
    CHECK(p.stage_index < p.stages);
    CHECK_FALSE(p.stage.empty());
    return true;
  });
  CHECK(stages > 3);  // those without a task tell nothing
  CHECK(stages <= report.at("stages").size());
  CHECK(notes >= stages);
  CHECK(report.at("mesh").at("faces").get<std::uint64_t>() < 2000);
  JobRequest named = request_job("decimate", Json{{"tolerance", 0.02}}, {input});
  named.state.output = folder / "named.ply";
  named.state.run = small_run();
  CHECK(call_job(named).at("mesh").at("faces") == report.at("mesh").at("faces"));
  CHECK(file_bytes(folder / "typed.ply") == file_bytes(folder / "named.ply"));
}

TEST_CASE("call: a no stops the job, and the next call goes on", "[pipeline]") {
  const TempFolder folder;
  const std::string input = (folder / "in.off").string();
  write_sheet(input, 60);
  DecimateJob job{{input}, folder / "out.ply", {}, small_run()};
  job.options.tolerance = 0.02;
  CHECK_THROWS_AS(static_cast<void>(job.run([](const JobProgress&) { return false; })), StoppedError);
  CHECK(stop_signal() == 0);
  CHECK_FALSE(std::filesystem::exists(folder / "out.ply"));
  CHECK_THROWS_AS(static_cast<void>(
                      job.run([](const JobProgress&) -> bool { throw std::out_of_range("of the caller"); })),
                  std::out_of_range);
  CHECK(stop_signal() == 0);
  const Json report = job.run();
  CHECK(std::filesystem::exists(folder / "out.ply"));
  CHECK(report.at("mesh").at("faces").get<std::uint64_t>() > 0);
}

TEST_CASE("call: of two jobs in one process one is cancelled, and the other ends whole", "[pipeline]") {
  const TempFolder folder;
  const std::string input = (folder / "in.off").string();
  write_sheet(input, 60);
  const auto job = [&](const char* name) {
    DecimateJob made{{input}, folder / name, {}, small_run()};
    made.options.tolerance = 0.02;
    return made;
  };
  static_cast<void>(job("alone.ply").run());
  // The first is under way when the second begins, and goes on when that has been cancelled.
  std::atomic<bool> begun{false}, cancelled{false};
  std::thread whole([&] {
    static_cast<void>(job("whole.ply").run([&](const JobProgress&) {
      begun = true;
      while (!cancelled) std::this_thread::yield();
      return true;
    }));
  });
  while (!begun) std::this_thread::yield();
  bool stopped = false;
  try {
    static_cast<void>(job("cut.ply").run([](const JobProgress&) { return false; }));
  } catch (const StoppedError&) {
    stopped = true;
  }
  cancelled = true;
  whole.join();
  CHECK(stopped);
  CHECK_FALSE(std::filesystem::exists(folder / "cut.ply"));
  CHECK(std::filesystem::exists(folder / "cut.ply.tessera"));
  CHECK(file_bytes(folder / "whole.ply") == file_bytes(folder / "alone.ply"));
  static_cast<void>(job("cut.ply").run());  // goes on
  CHECK(file_bytes(folder / "cut.ply") == file_bytes(folder / "alone.ply"));
}

TEST_CASE("call: failures are the documented classes", "[unit]") {
  const TempFolder folder;
  const std::string input = (folder / "in.off").string();
  write_sheet(input, 4);
  const auto run = [](const auto& job) { static_cast<void>(job.run()); };
  CHECK_THROWS_AS(run(DecimateJob{{}, folder / "out.ply"}), UsageError);
  CHECK_THROWS_AS(run(DecimateJob{{input}, ""}), UsageError);
  CHECK_THROWS_AS(run(DecimateJob{{input, "x.ply"}, folder / "out.ply"}), Error);
  CHECK_THROWS_AS(run(RemeshJob{{(folder / "none.ply").string()}, folder / "out.ply"}), InputError);
  CHECK_THROWS_AS(run(SmoothJob{{input}, folder / "out.doc"}), UsageError);
  CHECK_THROWS_AS(run(MergeJob{{input}, folder / "out.ply"}), UsageError);
  CHECK_THROWS_AS(static_cast<void>(request_job("decimate", Json{{"tolerence", 1}}, {input})), UsageError);
  CHECK_THROWS_AS(static_cast<void>(request_job("bake", Json::object(), {input})), UsageError);
}

TEST_CASE("call: check tells figures, and what is beyond a tolerance", "[pipeline]") {
  const TempFolder folder;
  write_sheet(folder / "in.off", 20);
  CheckCall check{folder / "in.off"};
  check.how = small_run();
  const Json figures = check.run();
  CHECK(figures.at("faces") == 2 * 19 * 19);
  CHECK_FALSE(figures.contains("deviation"));
  test::spill(folder / "flat.off", "OFF\n4 2 0\n0 0 0\n19 0 0\n19 19 0\n0 19 0\n3 0 1 2\n3 0 2 3\n");
  check.reference = folder / "flat.off";
  check.compare.tolerance = 0.5;
  CHECK_FALSE(check.run().at("deviation").at("complaint").get<std::string>().empty());
  check.compare.tolerance = 2.0;
  CHECK(check.run().at("deviation").at("complaint") == "");
  check.go_on = [] { return false; };
  CHECK_THROWS_AS(check.run(), StoppedError);
}

}  // namespace job_call_test
