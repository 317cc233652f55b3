// What users and programs do to commands by mistake: a documented code in the first seconds, and nothing lost.
#include <catch2/catch.hpp>

#include <sys/stat.h>

#include <cstring>

#include "tests/helpers/command.h"
#include "tests/helpers/serial_job.h"

namespace hard_to_break_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// A unit cube whose x begin at `low`.
std::string cube(const std::string& low = "0", const std::string& high = "1") {
  std::string text = "OFF\n8 12 0\n";
  for (int v = 0; v < 8; ++v)
    text += (v & 1 ? high : low) + " " + (v & 2 ? high : "0") + " " + (v & 4 ? high : "0") + "\n";
  return text +
         "3 0 2 3\n3 0 3 1\n3 4 5 7\n3 4 7 6\n3 0 1 5\n3 0 5 4\n3 2 6 7\n3 2 7 3\n3 0 4 6\n3 0 6 2\n3 1 3 "
         "7\n3 1 7 5\n";
}

struct Files {
  TempFolder folder;
  std::string at(const std::string& name) const { return (folder.path() / name).string(); }
  std::string put(const std::string& name, const std::string& content) const {
    std::ofstream(folder.path() / name, std::ios::binary) << content;
    return at(name);
  }
};

CommandResult refused(int code, const std::vector<std::string>& words, unsigned max_ms = 0) {
  const CommandResult r = tessera_command(words, max_ms);
  INFO(words[0] << " " << words[1] << ": " << r.errors);
  CHECK(r.code == code);
  CHECK(r.errors.find("tessera: error: ") != std::string::npos);
  return r;
}

}  // namespace

TEST_CASE("hard to break: no command writes over what it reads, or over what is there", "[fault]") {
  const Files f;
  const std::string mesh = f.put("m.off", cube()), other = f.put("r.off", cube());
  const std::string scan = f.put("s.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n");
  const std::string job = f.put("job.json", "{}");
  const std::string list = f.put("list.txt", "s.xyz\n");
  const std::string mine = f.put("mine", "somebody's"), png = f.put("mine.png", "somebody's"),
                    ply = f.put("mine.ply", "somebody's");
  fs::copy_file(mesh, f.at("in.ply"));
  fs::create_hard_link(mesh, f.at("hard.ply"));
  f.put("z.ply.truth.json", "somebody's");
  const std::vector<std::vector<std::string>> lines = {
      {"check", mesh, "--json", mesh, "--force"},
      {"check", mesh, "--reference", other, "--tolerance", "1", "--json", other, "--force"},
      {"check", mesh, "--json", mine},
      {"reconstruct", scan, "-o", f.at("a.ply"), "--report", scan},
      {"reconstruct", scan, "-o", f.at("a.ply"), "--log", scan},
      {"reconstruct", scan, "-o", f.at("a.ply"), "--report", f.at("a.ply")},
      {"reconstruct", scan, "-o", f.at("a.ply"), "--log", mine},
      {"reconstruct", scan, "-o", f.at("a.ply"), "--report", mine},
      {"reconstruct", "@" + list, "-o", f.at("a.ply"), "--report", list, "--force"},
      {"plan", scan, "--report", scan, "--force"},
      {"smooth", mesh, "-o", f.at("hard.ply"), "--force"},
      {"decimate", mesh, "-o", f.at("hard.ply"), "--tolerance", "1", "--force"},
      {"decimate", mesh, "--reference", f.at("in.ply"), "-o", f.at("in.ply"), "--tolerance", "1", "--force"},
      {"parameterize", mesh, "-o", f.at("hard.ply"), "--force"},
      {"convert", mesh, "-o", f.at("hard.ply"), "--force"},
      {"smooth", mesh, "-o", f.at("b.ply"), "--job", job, "--report", job, "--force"},
      {"render", mesh, "-o", png},
      {"synth", "--points", "100", "-o", ply},
      {"synth", "--points", "100", "-o", f.at("z.ply")}};
  for (const auto& line : lines) refused(2, line);
  CHECK(text_of(mesh) == cube());
  CHECK(text_of(other) == cube());
  CHECK(text_of(f.at("in.ply")) == cube());
  CHECK(text_of(scan) == "0 0 0\n1 0 0\n0 1 0\n1 1 0\n");
  CHECK(text_of(list) == "s.xyz\n");
  for (const std::string& path : {mine, png, ply, f.at("z.ply.truth.json")})
    CHECK(text_of(path) == "somebody's");
  CHECK(lines.size() == 19);
}

TEST_CASE("hard to break: an output that is a folder is refused at the start", "[fault]") {
  const Files f;
  const std::string mesh = f.put("m.off", cube()), scan = f.put("s.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n");
  for (const char* name : {"d.ply", "d.png", "d.json"}) fs::create_directory(f.at(name));
  refused(2, {"reconstruct", scan, "-o", f.at("d.ply"), "--force"});
  refused(2, {"smooth", mesh, "-o", f.at("d.ply"), "--force"});
  refused(2, {"convert", mesh, "-o", f.at("d.ply"), "--force"});
  refused(2, {"render", mesh, "-o", f.at("d.png"), "--force"});
  refused(2, {"check", mesh, "--json", f.at("d.json"), "--force"});
  refused(2, {"smooth", mesh, "-o", f.at("a.ply"), "--report", f.at("d.json"), "--force"});
  refused(2, {"smooth", mesh, "-o", f.at("a.ply"), "--log", f.at("d.json"), "--force"});
  refused(2, {"synth", "--points", "100", "-o", f.at("d.ply"), "--force"});
  CHECK_FALSE(fs::exists(f.at("a.ply")));
}

TEST_CASE("hard to break: cubes that end at powers of two and begin a little below zero", "[pipeline]") {
  const Files f;
  for (const char* low : {"-6e-17", "-5e-324", "-1e-300", "-0"}) {
    const std::string mesh = f.put("m.off", cube(low));
    INFO(low);
    CHECK(tessera_command({"decimate", mesh, "-o", f.at("d.ply"), "--tolerance", "0.01", "--force"}).code ==
          0);
    CHECK(tessera_command({"smooth", mesh, "-o", f.at("s.ply"), "--force"}).code == 0);
    CHECK(tessera_command({"check", mesh, "--reference", mesh, "--tolerance", "0.01"}).code == 0);
  }
}

TEST_CASE("hard to break: names that are no UTF-8 work like others", "[pipeline]") {
  const Files f;
  const std::string mesh = f.put("m\xff.off", cube()),
                    scan = f.put("s\xfe.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n");
  CHECK(tessera_command({"smooth", mesh, "-o", f.at("o\xff.ply")}).code == 0);
  CHECK(tessera_command({"smooth", mesh, "-o", f.at("o\xff.ply")}).code == 0);  // done already
  CHECK(tessera_command({"info", "--json", scan}).code == 0);
  CHECK(tessera_command({"check", mesh, "--json", f.at("c\xff.json")}).code == 0);
  CHECK(tessera_command({"synth", "--points", "100", "-o", f.at("y\xff.ply")}).code == 0);
  // stopped and gone on with
  CHECK(tessera_command(
            {"decimate", mesh, "-o", f.at("d\xff.ply"), "--tolerance", "0.1", "--until", "mesh-read"})
            .code == 7);
  CHECK(tessera_command({"decimate", mesh, "-o", f.at("d\xff.ply"), "--tolerance", "0.1"}).code == 0);
  CHECK(fs::exists(f.at("d\xff.ply")));
}

TEST_CASE("hard to break: pipes, folders and wrong job files are refused, not waited for", "[fault]") {
  const Files f;
  const std::string mesh = f.put("m.off", cube());
  for (const char* name : {"p.ply", "p.off", "p.xyz", "p.json"})
    REQUIRE(::mkfifo(f.at(name).c_str(), 0600) == 0);
  constexpr unsigned kMax = 10000;
  refused(3, {"check", f.at("p.ply")}, kMax);
  refused(3, {"smooth", f.at("p.off"), "-o", f.at("a.ply")}, kMax);
  refused(3, {"reconstruct", f.at("p.xyz"), "-o", f.at("a.ply")}, kMax);
  refused(3, {"convert", f.at("p.xyz"), "-o", f.at("a.ply")}, kMax);
  refused(3, {"render", f.at("p.ply"), "-o", f.at("a.png")}, kMax);
  refused(3, {"check", mesh, "--truth", f.at("p.json")}, kMax);
  refused(3, {"smooth", mesh, "-o", f.at("a.ply"), "--job", f.folder.path().string()});
  refused(2, {"reconstruct", f.put("s.xyz", "0 0 0\n1 0 0\n0 1 0\n"), "-o", f.at("a.ply"), "--holes",
              "fill-to:nan"});
  CHECK_FALSE(fs::exists(f.at("a.ply.tessera")));
}

TEST_CASE("hard to break: coordinates beyond what can be computed with end at once", "[fault]") {
  const Files f;
  constexpr unsigned kMax = 10000;
  refused(3, {"render", f.put("far.xyz", "1e50 0 0\n0 1e50 0\n0 0 1e50\n1e50 1e50 0\n"), "-o", f.at("a.png")},
          kMax);
  std::string grid = "OFF\n2500 4802 0\n";
  for (int i = 0; i < 2500; ++i)
    grid += std::to_string(i % 50) + " " + std::to_string(i / 50) + (i % 400 == 7 ? " 1.5e28\n" : " 0.25\n");
  for (int i = 0; i < 2450; ++i)
    if (i % 50 < 49) {
      const auto v = [&](int d) { return " " + std::to_string(i + d); };
      grid += "3" + v(0) + v(1) + v(50) + "\n3" + v(1) + v(51) + v(50) + "\n";
    }
  const std::string mesh = f.put("far.off", grid);
  refused(6, {"decimate", mesh, "-o", f.at("a.ply"), "--tolerance", "0.01"}, kMax);
  refused(6, {"check", mesh, "--reference", mesh, "--tolerance", "0.01"}, kMax);
  refused(3,
          {"decimate", f.put("wide.off", cube("-1e308", "1e308")), "-o", f.at("b.ply"), "--tolerance", "1"});
  CHECK(refused(3, {"reconstruct", f.put("wide.xyz", "-1e300 0 0\n1e300 1 1\n0 1e300 0\n0 0 1e300\n1 1 1\n"),
                    "-o", f.at("c.ply")})
            .errors.find("zero;") == std::string::npos);
}

TEST_CASE("hard to break: limits on files are told with code 4", "[fault]") {
  const Files f;
  const std::string mesh = f.put("m.off", cube());
  rlimit old = {};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &old) == 0);
  rlimit small = old;
  small.rlim_cur = 4096;
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  const CommandResult full = refused(4, {"synth", "--points", "100000", "-o", f.at("a.ply")});
  ::setrlimit(RLIMIT_FSIZE, &old);
  CHECK(full.errors.find("ulimit -f") != std::string::npos);
  CHECK_FALSE(fs::exists(f.at("a.ply")));
  REQUIRE(::getrlimit(RLIMIT_NOFILE, &old) == 0);
  small = old;
  small.rlim_cur = 9;
  REQUIRE(::setrlimit(RLIMIT_NOFILE, &small) == 0);
  const CommandResult open = tessera_command({"decimate", mesh, "-o", f.at("b.ply"), "--tolerance", "0.1"});
  ::setrlimit(RLIMIT_NOFILE, &old);
  CHECK(open.code == 4);
  CHECK(open.errors.find("ulimit -n") != std::string::npos);
}

TEST_CASE("hard to break: what a killed comparison left is removed by the next one", "[fault]") {
  const Files f;
  const std::string mesh = f.put("m.off", cube());
  fs::create_directory(f.at("tessera-compare-abcdef"));
  f.put("tessera-compare-abcdef/points", "left");
  CHECK(tessera_command({"check", mesh, "--reference", mesh, "--tolerance", "0.1"}).code == 0);
  CHECK_FALSE(fs::exists(f.at("tessera-compare-abcdef")));
}

TEST_CASE("hard to break: what --keep-raw asked for is made again when it is gone", "[pipeline]") {
  const Files f;
  REQUIRE(
      tessera_command({"synth", "--scene", "sphere", "--points", "4000", "--normals", "-o", f.at("s.ply")})
          .code == 0);
  const std::vector<std::string> line = {"reconstruct", f.at("s.ply"), "-o",        f.at("m.ply"),
                                         "--tolerance", "0.01",        "--keep-raw"};
  REQUIRE(tessera_command(line).code == 0);
  const std::string mesh = text_of(f.at("m.ply")), raw = text_of(f.at("m.raw.ply"));
  REQUIRE(!raw.empty());
  fs::remove(f.at("m.raw.ply"));
  CHECK(tessera_command(line).code == 0);
  CHECK(text_of(f.at("m.raw.ply")) == raw);
  CHECK(text_of(f.at("m.ply")) == mesh);
  // what somebody else put there is not
  f.put("m.raw.ply", "somebody's");
  refused(2, line);
  CHECK(text_of(f.at("m.raw.ply")) == "somebody's");
}

}  // namespace hard_to_break_test
