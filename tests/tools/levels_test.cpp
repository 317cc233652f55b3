// reconstruct --levels: small cells where points are dense, large ones where they are sparse, one mesh without seams.
#include <catch2/catch.hpp>

#include <string>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/reconstruct_command.h"
#include "tests/helpers/serial_job.h"

namespace levels_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

/// A town from one set-up: dense at the scanner's foot, sparse at the end of the streets.
std::string town(const fs::path& folder, const std::string& points, std::vector<std::string> more = {}) {
  const std::string path = (folder / "town.ply").string();
  std::vector<std::string> words = {"synth", "--scene",  "city", "--mode", "terrestrial", "--views",
                                    "1",     "--points", points, "-o",     path};
  words.insert(words.end(), more.begin(), more.end());
  REQUIRE(tessera_command(words).code == 0);
  return path;
}

}  // namespace

TEST_CASE("reconstruct --levels: same bytes over tiles, threads, caps, processes and kills", "[property]") {
  const TempFolder folder;
  const std::string in = town(folder.path(), "250000", {"--normals"});
  const std::vector<std::string> base = {"--levels", "3"};
  const auto bytes = [&](std::vector<std::string> more) {
    const fs::path out = folder.path() / "out.ply";
    fs::remove(out);
    more.insert(more.end(), base.begin(), base.end());
    const Json report = reconstructed(in, out, more);
    CHECK_FALSE(fs::exists(out.string() + ".tessera"));
    // All levels take part.
    const Json surface = stage_result(report, "surface");
    for (const Json& faces : surface.at("faces_of_level")) CHECK(faces.get<int>() > 500);
    return file_bytes(out);
  };
  const std::string want = bytes({"-t", "1", "--tile-size", "64", "--memory", "2G"});
  CHECK(bytes({"-t", "2", "--tile-size", "256", "--memory", "2G"}) == want);
  CHECK(bytes({"-t", "5", "--memory", "3G"}) == want);
  CHECK(bytes({"-t", "1", "--memory", "512M"}) == want);
  CHECK(bytes({"-t", "2", "--processes"}) == want);

  const fs::path out = folder.path() / "killed.ply";
  const std::vector<std::string> words = reconstruct_words(in, out, {"--levels", "3", "-t", "2"});
  REQUIRE(resumed_after_kills(words).code == 0);
  CHECK(file_bytes(out) == want);
}

TEST_CASE("reconstruct --levels: one manifold, finer where the scan is dense, as large as with one level",
          "[pipeline]") {
  const TempFolder folder;
  const bool estimate = GENERATE(false, true);
  CAPTURE(estimate);
  const std::string in = town(folder.path(), "120000",
                              estimate ? std::vector<std::string>{} : std::vector<std::string>{"--normals"});
  std::vector<std::string> more = {"--border", "raw", "--max-hole", "0", "--vegetation", "drop"};
  if (estimate) more.insert(more.end(), {"--normals", "estimate", "--max-uncertain", "1"});
  const fs::path one = folder.path() / "one.ply", many = folder.path() / "many.ply",
                 small = folder.path() / "small.ply";
  const Json flat = reconstructed(in, one, more);
  const double h = stage_result(flat, "surface").at("h").get<double>();
  more.insert(more.end(), {"--levels", "3"});
  const Json levels = reconstructed(in, many, more);
  CHECK(stage_result(levels, "surface").at("h").get<double>() == h);
  CHECK(stage_result(levels, "surface").at("finest_h").get<double>() == h / 4);
  const MeshCheck a = checked(one, folder.path()), b = checked(many, folder.path());
  CHECK(b.defects().empty());
  CHECK(b.faces > 2 * a.faces);
  CHECK(b.area > 0.99 * a.area);
  CHECK(b.area < 1.05 * a.area);

  more.insert(more.end(), {"--tolerance", dump_json(Json(0.1 * h))});
  const Json decimated = reconstructed(in, small, more);
  CHECK(decimated.at("certificate").at("proven") == true);
  CHECK(checked(small, folder.path()).defects().empty());
  CHECK(decimated.at("mesh").at("faces").get<std::uint64_t>() * 2 < b.faces);
}

TEST_CASE("reconstruct --levels: smoothed before it is decimated", "[pipeline]") {
  const TempFolder folder;
  const std::string in = town(folder.path(), "120000", {"--normals", "--noise", "0.15"});
  const fs::path out = folder.path() / "out.ply";
  const Json report = reconstructed(
      in, out, {"--levels", "3", "--tolerance", "0.6", "--min-component", "1", "--smooth", "implicit"});
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(checked(out, folder.path()).defects().empty());
  const Json& noise = report.at("smoothing").at("noise");
  CHECK(noise.at("after").get<double>() < 0.8 * noise.at("before").get<double>());
}

TEST_CASE("reconstruct --levels: levels that noise forbids are named", "[pipeline]") {
  const TempFolder folder;
  const std::string in = town(folder.path(), "60000", {"--normals", "--noise", "1"});
  const Json report = reconstructed(in, folder.path() / "out.ply", {"--levels", "4"});
  const auto used = stage_result(report, "levels").at("noise_levels").get<int>();
  REQUIRE(used < 4);
  REQUIRE(report.at("warnings").size() == 1);
  CHECK_THAT(report.at("warnings")[0].get<std::string>(),
             Catch::Contains("--levels 4: " + std::to_string(used) + " used"));
}

TEST_CASE("reconstruct --levels: what it cannot do is told before any pass", "[pipeline]") {
  const TempFolder folder;
  const std::string in = town(folder.path(), "20000", {"--normals"});
  const auto refused = [&](const std::vector<std::string>& more, const std::string& word) {
    std::vector<std::string> words = reconstruct_words(in, folder.path() / "out.ply", {"--levels", "2"});
    words.insert(words.end(), more.begin(), more.end());
    const CommandResult r = tessera_command(words);
    INFO(r.errors);
    CHECK(r.code == 2);
    CHECK(r.errors.find(word) != std::string::npos);
    CHECK_FALSE(fs::exists(folder.path() / "out.ply.tessera"));
  };
  refused({"--holes", "close"}, "--holes close");
  refused({"--holes", "fill-to:3"}, "--holes fill-to:3");
  refused({"--vegetation", "keep"}, "--vegetation keep");
  CHECK(tessera_command(reconstruct_words(in, folder.path() / "out.ply", {"--levels", "7"})).code == 2);
  CHECK(tessera_command(reconstruct_words(in, folder.path() / "out.ply", {"--levels", "0"})).code == 2);
  // A lattice of 2^20 cells at most: what is too fine shows when the scan is known.
  const CommandResult r = tessera_command(
      reconstruct_words(in, folder.path() / "out.ply", {"--levels", "6", "--resolution", "0.001"}));
  INFO(r.errors);
  CHECK(r.code == 2);
  CHECK(r.errors.find("2^20") != std::string::npos);
}

}  // namespace levels_test
