// Whatever is wrong: a documented exit code, one sentence, no output, no crash.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cstring>
#include <functional>

#include "tests/helpers/command.h"
#include "tests/helpers/serial_job.h"

namespace bad_input_test {

using namespace tessera::test;

namespace {

struct Files {
  TempFolder folder;
  std::filesystem::path out = folder.path() / "out.ply";

  std::string text(const std::string& name, const std::string& content) const {
    const auto path = folder.path() / name;
    std::ofstream(path, std::ios::binary) << content;
    return path.string();
  }
};

std::string ply_header(const std::string& format, const std::string& count, const std::string& properties) {
  return "ply\nformat " + format + " 1.0\nelement vertex " + count + "\n" + properties + "end_header\n";
}
const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

/// LAS 1.2, point format 0, with one edit.
std::string las(std::size_t points, const std::function<void(std::string&)>& edit) {
  std::string h(227, '\0');
  const auto put = [&](std::size_t at, auto value) { std::memcpy(h.data() + at, &value, sizeof value); };
  std::memcpy(h.data(), "LASF", 4);
  h[24] = 1, h[25] = 2;
  put(94, std::uint16_t{227}), put(96, std::uint32_t{227}), put(105, std::uint16_t{20});
  put(107, static_cast<std::uint32_t>(points));
  for (std::size_t a = 0; a < 3; ++a) put(131 + 8 * a, 0.01);
  h.resize(227 + 20 * points);
  for (std::size_t i = 0; i < points; ++i)
    for (std::size_t a = 0; a < 3; ++a)
      put(227 + 20 * i + 4 * a, static_cast<std::int32_t>(i * (a + 3) % 97));
  edit(h);
  return h;
}

void expect(const Files& files, const std::string& what, int code, std::vector<std::string> words) {
  words.insert(words.end(), {"--progress", "none", "-q"});
  const CommandResult r = tessera_command(words);
  INFO(what << ": " << r.errors);
  CHECK(r.code == code);
  CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') == 1);
  CHECK(r.errors.rfind("tessera: error: ", 0) == 0);
  CHECK_FALSE(std::filesystem::exists(files.out));
  std::filesystem::remove_all(files.out.string() + ".tessera");
}

}  // namespace

TEST_CASE("bad input: scans that cannot be read or meshed", "[fault]") {
  const Files f;
  const auto job = [&](const std::string& in, std::vector<std::string> more = {}) {
    std::vector<std::string> w = {"reconstruct", in, "-o", f.out.string()};
    w.insert(w.end(), more.begin(), more.end());
    return w;
  };
  const std::string three = "0 0 0\n1 0 0\n0 1 0\n";
  const auto given = std::vector<std::string>{"--resolution", "1"};
  struct Case {
    const char* what;
    int code;
    std::string name, content;
    bool with_h = true;
  };
  const std::string float_points(12 * 4, '\x3f');
  const std::vector<Case> cases = {
      {"empty file", 3, "a.ply", ""},
      {"empty text", 3, "a.xyz", ""},
      {"only the magic", 3, "a.ply", "ply\n"},
      {"header cut", 3, "a.ply", "ply\nformat ascii 1.0\nelement vertex 3\n"},
      {"no format", 3, "a.ply", "ply\nelement vertex 3\n" + kXyz + "end_header\n"},
      {"unknown format", 3, "a.ply", ply_header("binary_middle_endian", "3", kXyz)},
      {"unknown property type", 3, "a.ply", ply_header("ascii", "3", "property quad x\n") + three},
      {"no vertex element", 3, "a.ply",
       "ply\nformat ascii 1.0\nelement face 1\nproperty int x\nend_header\n1\n"},
      {"no z", 3, "a.ply",
       ply_header("ascii", "3", "property float x\nproperty float y\n") + "0 0\n1 0\n0 1\n"},
      {"negative count", 3, "a.ply", ply_header("ascii", "-3", kXyz) + three},
      {"absurd count, nothing there", 5, "a.ply", ply_header("binary_little_endian", "99999999999999", kXyz)},
      {"letters among numbers", 3, "a.ply", ply_header("ascii", "3", kXyz) + "0 0 0\n1 x 0\n0 1 0\n"},
      {"text with a word", 3, "a.xyz", "0 0 0\n1 0 zero\n0 1 0\n"},
      {"text with two columns", 3, "a.xyz", "0 0\n1 0\n0 1\n"},
      {"binary rubbish", 3, "a.bin", std::string("\x01\x02\x03\xff\x00\x10", 6)},
      {"LAS cut in the header", 3, "a.las", las(0, [](std::string& h) { h.resize(100); })},
      {"LAS without points", 5, "a.las", las(0, [](std::string&) {})},
      {"LAS of version 9", 3, "a.las", las(10, [](std::string& h) { h[24] = 9; })},
      {"LAS of point format 77", 3, "a.las", las(10, [](std::string& h) { h[104] = 77; })},
      {"LAZ without its record", 3, "a.laz",
       las(10, [](std::string& h) { h[104] = static_cast<char>(0x80); })},
      {"LAS with record length 3", 3, "a.las", las(10, [](std::string& h) { h[105] = 3, h[106] = 0; })},
      {"LAS with points behind the end", 5, "a.las",
       las(10, [](std::string& h) { h[96] = h[97] = h[98] = 0x7f; })},
      {"E57", 3, "a.e57", "ASTM-E57" + std::string(100, '\0')},
      {"PTX cut in the pose", 3, "a.ptx", "2\n2\n0 0 0\n1 0 0\n"},
      {"all NaN", 5, "a.xyz", "nan nan nan\nnan nan nan\n"},
      {"all infinite", 5, "a.xyz", "inf 0 0\n0 inf 0\n"},
      {"one point", 5, "a.xyz", "1 2 3\n"},
      {"two points", 5, "a.xyz", "1 2 3\n1 2 4\n"},
      {"one point, no resolution", 3, "a.xyz", "1 2 3\n", false},
      {"all coincident, no resolution", 3, "a.xyz", "1 2 3\n1 2 3\n1 2 3\n1 2 3\n1 2 3\n1 2 3\n", false},
      {"all coincident", 3, "a.xyz", "1 2 3\n1 2 3\n1 2 3\n1 2 3\n1 2 3\n1 2 3\n"},
      {"extent over the lattice", 3, "a.xyz", "0 0 0\n5000000 0 0\n9000000 0 0\n9000000 1 0\n"},
  };
  std::size_t done = 0;
  for (const Case& c : cases) {
    expect(f, c.what, c.code, job(f.text(c.name, c.content), c.with_h ? given : std::vector<std::string>{}));
    ++done;
  }
  CHECK(done >= 30);
}

TEST_CASE("bad input: of many scans the first bad one is named, whatever thread reads it", "[fault]") {
  const Files files;
  const auto none = [](std::string&) {};
  const auto broken = [](std::string& h) { h[24] = 7; };
  std::vector<std::string> words = {"reconstruct"};
  for (int i = 0; i < 40; ++i)
    words.push_back(files.text("s" + std::to_string(100 + i) + ".las",
                               i == 17 || i > 18 ? las(50, broken) : las(50, none)));
  words.insert(words.end(), {"-o", files.out.string(), "-q", "--progress", "none"});
  for (const char* threads : {"1", "4"}) {
    std::vector<std::string> all = words;
    all.insert(all.end(), {"-t", threads});
    const CommandResult r = tessera_command(all);
    INFO(r.errors);
    CHECK(r.code == 3);
    CHECK(r.errors.find("s117.las") != std::string::npos);
    std::filesystem::remove_all(files.out.string() + ".tessera");
  }
}

TEST_CASE("bad input: options, folders, caps", "[fault]") {
  const Files f;
  std::string sheet;
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 40; ++j) sheet += std::to_string(i) + " " + std::to_string(j) + " 0 0 0 1\n";
  const std::string in = f.text("sheet.xyz", sheet);
  const std::string out = f.out.string();
  const std::vector<std::string> base = {"reconstruct", in, "-o", out, "--resolution", "1.5"};
  const auto with = [&](std::vector<std::string> more) {
    std::vector<std::string> w = base;
    w.insert(w.end(), more.begin(), more.end());
    return w;
  };
  expect(f, "no input", 2, {"reconstruct", "-o", out});
  expect(f, "no output", 2, {"reconstruct", in});
  expect(f, "missing file", 3, {"reconstruct", f.folder.path() / "nothing.las", "-o", out});
  expect(f, "glob without match", 3, {"reconstruct", f.folder.path() / "*.las", "-o", out});
  expect(
      f, "empty folder", 3,
      {"reconstruct",
       (std::filesystem::create_directory(f.folder.path() / "empty"), f.folder.path() / "empty"), "-o", out});
  expect(f, "unknown option", 2, with({"--resolutoin", "2"}));
  expect(f, "resolution below zero", 2, with({"--voxel", "-1"}));
  expect(f, "resolution no number", 2, with({"--voxel", "fine"}));
  expect(f, "unknown method", 2, with({"--method", "dual"}));
  expect(f, "unknown output format", 2, {"reconstruct", in, "-o", f.folder.path() / "out.fbx"});
  expect(f, "output below a file", 2, {"reconstruct", in, "-o", std::filesystem::path(in) / "out.ply"});
  expect(f, "cap without sense", 2, with({"--memory", "many"}));
  expect(f, "cap too small", 4, with({"--memory", "8M"}));
  expect(f, "angle over 180", 2, with({"--feature-angle", "400"}));
  expect(f, "up without direction", 2, with({"--normals", "estimate", "--up", "0,0,0"}));
  expect(f, "tile no multiple of 64", 2, with({"--tile-size", "100"}));
  expect(f, "given normals that are not there", 2,
         {"reconstruct", f.text("bare.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n"), "-o", out, "--resolution", "1",
          "--normals", "given"});
  expect(f, "unknown stage", 2, with({"--until", "lunch"}));
  expect(f, "unknown command", 2, {"reconstrut", in, "-o", out});
}

}  // namespace bad_input_test
