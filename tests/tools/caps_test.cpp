// What a cap allows: jobs that cannot work are refused at once, and name a cap that does; what tasks allocate is reserved.
#include <catch2/catch.hpp>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "tests/helpers/command.h"
#include "tests/helpers/temp_folder.h"

namespace caps_test {

namespace {

using namespace tessera;
using test::CommandResult;
using test::tessera_command;
using Words = std::vector<std::string>;

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

/// A scan, a mesh of it and a smaller one, in a folder.
class Files {
 public:
  Files() {
    run({"synth", "--scene", "terrain", "--points", "60k", "-o", at("scan.las")});
    run({"reconstruct", at("scan.las"), "-o", at("mesh.ply")});
    run({"synth", "--scene", "csg", "--points", "60k", "--normals", "-o", at("solid.ply")});
    run({"reconstruct", at("solid.ply"), "-o", at("body.ply")});
    run({"synth", "--scene", "terrain", "--points", "40k", "--missing", "0.2", "-o", at("beside.las")});
    run({"reconstruct", at("beside.las"), "-o", at("beside.ply")});
    run({"synth", "--scene", "sphere", "--points", "20k", "--normals", "--colour", "-o", at("ball.ply")});
    run({"reconstruct", at("ball.ply"), "-o", at("part.ply")});
    std::ofstream(at("edit.json")) << R"({"regions": [{"role": "support", "all": true},
      {"role": "fixed", "vertices": [0]}, {"role": "handle", "name": "a", "vertices": [200]}],
      "handles": {"a": {"move": [0.1, 0, 0]}}})";
  }
  std::string at(const std::string& name) const { return (folder_.path() / name).string(); }
  CommandResult with(Words words, const std::string& cap, const std::string& environment = {}) const {
    if (std::find(words.begin(), words.end(), "-o") == words.end())
      words.insert(words.end(), {"-o", at("out.ply")});
    words.insert(words.end(), {"--force", "-t", "2", "--memory", cap});
    return tessera_command(words, 0, environment);
  }
  /// Whether a job has left a work directory.
  bool has_work() const {
    const auto is_work = [](const std::filesystem::directory_entry& e) {
      return e.path().extension() == ".tessera";
    };
    for (const auto& e : std::filesystem::directory_iterator(folder_.path()))
      if (is_work(e)) return true;
    return false;
  }

 private:
  static void run(const Words& words) {
    const CommandResult r = tessera_command(words);
    INFO(r.errors);
    REQUIRE(r.code == 0);
  }
  test::TempFolder folder_;
};

std::uint64_t named_cap(const CommandResult& refused) {
  INFO(refused.errors);
  REQUIRE(refused.code == 4);
  const auto at = refused.errors.find("would do is --memory ");
  REQUIRE(at != std::string::npos);
  return std::stoull(refused.errors.substr(at + 21));
}

std::vector<Words> jobs(const Files& files) {
  return {
      {"reconstruct", files.at("scan.las"), "--tolerance", "0.1"},
      {"reconstruct", files.at("scan.las"), "--levels", "3", "--resolution", "15"},
      {"decimate", files.at("mesh.ply"), "--tolerance", "0.1"},
      {"decimate", files.at("body.ply"), "--target-faces", "5000"},
      {"smooth", files.at("mesh.ply"), "--method", "denoise"},
      {"smooth", files.at("body.ply"), "--lambda", "500"},
      {"remesh", files.at("body.ply"), "--faces", "20000"},
      {"resample", files.at("body.ply")},
      {"resurface", files.at("body.ply"), "--resolution", "0.02"},
      {"resurface", files.at("body.ply"), "--resolution", "0.02", "--offset", "0.1"},
      {"csg", files.at("body.ply"), "-", files.at("part.ply"), "--resolution", "0.02"},
      {"merge", files.at("mesh.ply"), files.at("beside.ply")},
      {"field", files.at("body.ply"), "--resolution", "0.02", "-o", files.at("out.vdb")},
      {"tiles", files.at("mesh.ply"), "--tile-faces", "8000", "-o", files.at("site/")},
      {"bake", files.at("part.ply"), "--from", files.at("ball.ply"), "-o", files.at("out.glb"), "--no-html"},
      {"deform", files.at("body.ply"), files.at("edit.json"), "--base-vertices", "4000", "--no-html"},
  };
}

}  // namespace

TEST_CASE("caps: jobs on meshes refuse a small cap before their first stage and name one that does",
          "[memory]") {
  const Files files;
  for (const Words& words : jobs(files)) {
    if (words[0] == "reconstruct") continue;  // its survey decides: reconstruct_test.cpp
    CAPTURE(words);
    const std::uint64_t named = named_cap(files.with(words, "8M"));
    CHECK_FALSE(files.has_work());
    const CommandResult done = files.with(words, std::to_string(named) + "M");
    INFO(done.errors);
    CHECK(done.code == 0);
    CHECK(done.peak_bytes <= named * kMiB);
  }
}

TEST_CASE("caps: no job is refused behind its first stage", "[memory]") {
  const Files files;
  for (const Words& words : jobs(files)) {
    if (words[0] == "reconstruct") continue;
    const std::uint64_t named = named_cap(files.with(words, "8M"));
    for (const std::uint64_t less : {std::uint64_t{2}, named / 16, named / 8, named / 4}) {
      CAPTURE(words, named, less);
      const CommandResult r = files.with(words, std::to_string(named - less) + "M");
      if (r.code == 0) continue;  // it took less than it may
      named_cap(r);
      CHECK_FALSE(files.has_work());
    }
  }
}

TEST_CASE("caps: an edit is refused before its passes, not after them", "[memory]") {
  const Files files;
  const Words words = {"deform", files.at("body.ply"), files.at("edit.json"), "--base-vertices",
                       "4000",   "--no-html"};
  const std::uint64_t named = named_cap(files.with(words, "8M"));
  for (const std::uint64_t less : {std::uint64_t{4}, named / 16, named / 8}) {
    CAPTURE(named, less);
    const CommandResult refused = files.with(words, std::to_string(named - less) + "M");
    if (refused.code == 0) continue;  // the base that came out is smaller than one may be
    named_cap(refused);
    CHECK_FALSE(std::filesystem::exists(files.at("out.ply.tessera")));
  }
}

TEST_CASE("caps: a narrow and a wide cap, and no command goes over one", "[memory]") {
  const Files files;
  for (const Words& words : jobs(files)) {
    CAPTURE(words);
    std::uint64_t named = named_cap(files.with(words, "8M"));
    if (words[0] == "reconstruct")  // its survey knows more
      named = named_cap(files.with(words, std::to_string(named) + "M"));
    for (const std::uint64_t cap : {named + named / 4, 4 * named}) {
      CAPTURE(cap);
      const CommandResult done = files.with(words, std::to_string(cap) + "M");
      INFO(done.errors);
      CHECK(done.code == 0);
      CHECK(done.peak_bytes <= cap * kMiB);
    }
  }
}

TEST_CASE("caps: what tasks allocate is reserved", "[memory]") {
  const Files files;
  const std::string layer = TESSERA_ALLOCATION_LAYER;
  for (const Words& words : jobs(files)) {
    CAPTURE(words);
    const std::string log_path = files.at("allocations.txt");
    ::setenv("TESSERA_ALLOCATIONS", log_path.c_str(), 1);
    std::filesystem::remove(log_path);
    const CommandResult done = files.with(words, "1G", "LD_PRELOAD=" + layer);
    ::unsetenv("TESSERA_ALLOCATIONS");
    INFO(done.errors);
    REQUIRE(done.code == 0);
    std::ifstream file(log_path);
    std::string word;
    std::int64_t beyond = 0, unreserved = 0, bytes = 0;  // of the command and of what it started
    while (file >> word >> bytes)
      (word == "beyond" ? beyond : unreserved) = std::max(word == "beyond" ? beyond : unreserved, bytes);
    REQUIRE(unreserved > 0);
    CHECK(beyond <= static_cast<std::int64_t>(kMiB));
    CHECK(unreserved <= static_cast<std::int64_t>(kMiB));
  }
}

}  // namespace caps_test
