// Pipes: what comes and goes there is what files would hold, and nothing of a failure is handed on.
#include <catch2/catch.hpp>

#include <string>
#include <utility>

#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace pipes_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("pipes: points and meshes go through as through files", "[pipeline]") {
  const TempFolder folder;
  const std::string tessera = std::string(TESSERA_BINARY) + " ";
  const auto path = [&](const char* name) { return (folder / name).string(); };
  REQUIRE(shell(tessera + "synth --scene terrain --points 20k -o " + path("scan.las")).code == 0);
  REQUIRE(shell(tessera + "convert " + path("scan.las") + " -o " + path("want.ply")).code == 0);
  const Outcome points = shell("cat " + path("scan.las") + " | " + tessera +
                               "convert - --input-format las -o - --output-format ply > " + path("got.ply"));
  INFO(points.said);
  REQUIRE(points.code == 0);
  CHECK((file_bytes(folder / "got.ply") == file_bytes(folder / "want.ply")));
  CHECK_THAT(points.said, Catch::Contains("standard output: 20000 points"));

  WholeMesh mesh = counted(made_bracket(3));
  write_whole(folder / "part.ply", mesh);
  REQUIRE(shell(tessera + "convert " + path("part.ply") + " -o " + path("want.obj")).code == 0);
  const Outcome part =
      shell(tessera + "convert " + path("part.ply") + " -o - --output-format .stl | " + tessera +
            "convert - --input-format stl -o - --output-format obj > " + path("got.obj"));
  INFO(part.said);
  REQUIRE(part.code == 0);
  CHECK(read_whole(folder / "got.obj").faces.size() == mesh.faces.size());
  // Pipes of jobs that leave nothing: no scratch file stays.
  REQUIRE(shell("mkdir " + path("tmp") + "; TMPDIR=" + path("tmp") + " " + tessera + "convert " +
                path("part.ply") + " -o - --output-format obj > " + path("got.obj"))
              .code == 0);
  CHECK((file_bytes(folder / "got.obj") == file_bytes(folder / "want.obj")));
  CHECK(std::filesystem::is_empty(folder / "tmp"));
}

TEST_CASE("pipes: commands that only read say the same of what comes through one", "[pipeline]") {
  const TempFolder folder;
  const std::string tessera = std::string(TESSERA_BINARY) + " ";
  const auto path = [&](const std::string& name) { return (folder / name).string(); };
  REQUIRE(shell(tessera + "synth --scene terrain --points 20k -o " + path("scan.las")).code == 0);
  // Named as the scratch file: pictures show the name.
  write_whole(folder / "input.ply", counted(made_bracket(3)));
  // \param words  with one input, "@", in place; \param made  what it writes, "" for its words
  const auto same = [&](const std::string& words, const std::string& input, const std::string& made) {
    const auto filled = [&](const std::string& name, const std::string& output) {
      std::string line = words;
      for (const auto& [key, value] : {std::pair{std::string("@"), name}, {std::string("OUT"), output}})
        if (const auto at = line.find(key); at != std::string::npos) line.replace(at, key.size(), value);
      return line;
    };
    const Outcome file = shell(tessera + filled(path(input), path("file" + made)) + " > " + path("file.txt"));
    const Outcome pipe =
        shell("cat " + path(input) + " | " + tessera + filled("-", path("pipe" + made)) + " --input-format " +
              input.substr(input.find('.') + 1) + " > " + path("pipe.txt"));
    INFO(words << file.said << pipe.said);
    REQUIRE(file.code == 0);
    REQUIRE(pipe.code == 0);
    const std::string suffix = made.empty() ? ".txt" : made;
    return file_bytes(folder / ("file" + suffix)) == file_bytes(folder / ("pipe" + suffix));
  };
  CHECK(same("check @ --cleanliness", "input.ply", ""));
  CHECK(same("section @ --horizontal --spacing 0.5 -o OUT", "input.ply", ".csv"));
  CHECK(same("render @ -o OUT --size 200x150 --view iso", "input.ply", ".png"));
  CHECK(same("deviate @ --to " + path("input.ply") + " -o OUT --max-distance 100", "scan.las", ".las"));
  const Outcome info = shell("cat " + path("scan.las") + " | " + tessera + "info - --input-format las");
  INFO(info.said);
  CHECK(info.code == 0);
  CHECK_THAT(info.said, Catch::Contains("20000 read"));
  const Outcome nameless = shell("cat " + path("input.ply") + " | " + tessera + "check -");
  CHECK(nameless.code == 2);
  CHECK_THAT(nameless.said, Catch::Contains("--input-format"));
  const Outcome both = shell(tessera + "check " + path("input.ply") + " --input-format ply");
  CHECK(both.code == 2);
}

TEST_CASE("pipes: what cannot work is refused, and nothing of it comes out", "[pipeline]") {
  const TempFolder folder;
  const std::string tessera = std::string(TESSERA_BINARY) + " ";
  write_whole(folder / "part.ply", counted(made_bracket(2)));
  const std::string part = (folder / "part.ply").string();
  const auto refused = [&](const std::string& words, int code, const std::string& sentence) {
    const Outcome r = shell(tessera + "convert " + words + " > " + (folder / "out").string());
    INFO(words << r.said);
    CHECK(r.code == code);
    CHECK_THAT(r.said, Catch::Contains(sentence));
    CHECK(file_bytes(folder / "out").empty());
  };
  refused("- -o " + (folder / "a.ply").string() + " < " + part, 2, "--input-format");
  refused(part + " -o -", 2, "--output-format");
  refused(part + " -o " + (folder / "a.obj").string() + " --input-format ply", 2,
          "is of an input that is a pipe");
  refused("- - --input-format ply -o - --output-format ply < " + part, 2, "given 2 times");
  refused("- --input-format ply -o - --output-format obj < /dev/null", 3, "standard input is empty");
  refused(part + " -o - --output-format x/ply", 2, "is an extension");
  const Outcome full = shell(tessera + "convert " + part + " -o - --output-format obj > /dev/full");
  INFO(full.said);
  CHECK(full.code == 4);
  CHECK_THAT(full.said, Catch::Contains("standard output takes no more"));
}

}  // namespace pipes_test
