#include <sys/resource.h>
#include <unistd.h>

#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace tessera {
namespace {

std::vector<std::string> names(const std::vector<std::string>& arguments) {
  std::vector<std::string> result;
  for (const auto& p : expand_inputs(arguments)) result.push_back(p.filename().string());
  return result;
}

std::string expansion_error(const std::string& argument) {
  try {
    expand_inputs({argument});
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST_CASE("inputs: files, folders, globs and lists, without repeats", "[unit]") {
  const test::TempFolder folder;
  for (const char* f : {"b.las", "a.ply", "c.XYZ", "d.laz", "readme.txt", "k[1].ply"}) folder.write(f, "x");
  std::filesystem::create_directory(folder.path() / "sub");
  std::filesystem::create_directory(folder.path() / "empty");
  folder.write("sub/e.pts", "x");
  const std::string at = folder.path().string() + "/";
  using Names = std::vector<std::string>;
  CHECK(names({at}) == Names{"a.ply", "b.las", "c.XYZ", "d.laz", "k[1].ply"});
  CHECK(names({at + "b.las", at + "*.ply", at + "./b.las"}) == Names{"b.las", "a.ply", "k[1].ply"});
  CHECK(names({at + "k[1].ply"}) == Names{"k[1].ply"});
  CHECK(names({at + "su*"}) == Names{"e.pts"});
  CHECK(names({at + "readme.txt"}) == Names{"readme.txt"});
  folder.write("list", "# scans\r\n\r\nsub\r\n b.las \r\n*.ply\r\n" + at + "c.XYZ");
  CHECK(names({"@" + at + "list", at + "a.ply"}) == Names{"e.pts", "b.las", "a.ply", "k[1].ply", "c.XYZ"});
  std::filesystem::create_symlink(folder.path() / "b.las", folder.path() / "link.las");
  CHECK(names({at + "link.las", at + "b.las"}) == Names{"link.las"});
}

TEST_CASE("inputs: what matches nothing is named", "[fault]") {
  const test::TempFolder folder;
  std::filesystem::create_directory(folder.path() / "empty");
  const std::string at = folder.path().string() + "/";
  CHECK_THAT(expansion_error(at + "none.ply"), Catch::Contains("none.ply") && Catch::Contains("no such"));
  CHECK_THAT(expansion_error(at + "*.ply"), Catch::Contains("*.ply") && Catch::Contains("matches"));
  CHECK_THAT(expansion_error(at + "empty"), Catch::Contains("empty") && Catch::Contains("no file of points"));
  CHECK_THAT(expansion_error("@" + at + "none"), Catch::Contains("none"));
  folder.write("list", "# nothing\n");
  CHECK_THAT(expansion_error("@" + at + "list"), Catch::Contains("names no file"));
  folder.write("list", "\nnone.las\n");
  CHECK_THAT(expansion_error("@" + at + "list"), Catch::Contains("line 2") && Catch::Contains("none.las"));
}

TEST_CASE("inputs: more files are held than the system lets a process open", "[unit]") {
  const test::TempFolder folder;
  const auto path = folder.write("a.xyz", "1 2 3\n");
  rlimit limit{};
  REQUIRE(::getrlimit(RLIMIT_NOFILE, &limit) == 0);
  const rlimit low{std::min<rlim_t>(limit.rlim_cur, 64), limit.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_NOFILE, &low) == 0);
  std::vector<std::unique_ptr<PointFile>> files;
  for (int i = 0; i < 100; ++i) files.push_back(open_point_file(path, {}));
  CHECK(::setrlimit(RLIMIT_NOFILE, &limit) == 0);
  for (const auto& f : files) CHECK(f->read(f->slices(0, 100).front(), [](const PointChunk&) {}).points == 1);
}

TEST_CASE("inputs: a file that changes while it is read is refused", "[fault]") {
  const test::TempFolder folder;
  const auto path = folder.write("a.xyz", "1 2 3\n4 5 6\n");
  const auto file = open_point_file(path, {});
  const InputSlice slice = file->slices(0, 100).front();
  folder.write("a.xyz", "1 2 3\n");
  CHECK_THROWS_WITH(file->read(slice, [](const PointChunk&) {}), Catch::Contains("must not change"));
}

TEST_CASE("inputs: what is not a file of points is refused with a reason", "[fault]") {
  const test::TempFolder folder;
  const std::string at = folder.path().string() + "/";
  CHECK_THAT(test::reading_error(at), Catch::Contains("folder"));
  CHECK_THAT(test::reading_error(at + "none"), Catch::Contains("no such file"));
  CHECK_THAT(test::reading_error(folder.write("a.ply", "")), Catch::Contains("is empty"));
  CHECK_THAT(test::reading_error("/dev/null"), Catch::Contains("not a regular file"));
  CHECK_THAT(test::reading_error(folder.write("a.e57", "ASTM-E57xxxx")),
             Catch::Contains("E57 header") && Catch::Contains("truncated"));
  CHECK_THAT(test::reading_error(folder.write("a.gz", "\x1f\x8b\x08")),
             Catch::Contains("gzip") && Catch::Contains("truncated"));
  CHECK_THAT(test::reading_error(folder.write("a.ply.xz",
                                              "\xfd"
                                              "7zXZ")),
             Catch::Contains("xz"));
  CHECK_THAT(test::reading_error(folder.write("a.stl", "solid box")), Catch::Contains("mesh"));
  CHECK_THAT(test::reading_error(folder.write("a.obj", "v 0 0 0\nv 1 0 0\n")), Catch::Contains("convert"));
  CHECK_THAT(test::reading_error(folder.write("a.las", "LAS?")), Catch::Contains("damaged or misnamed"));
  CHECK_THAT(test::reading_error(folder.write("a.bin", std::string(100, '\0'))),
             Catch::Contains("no known format"));
  const auto secret = folder.write("secret.ply", "ply\n");
  std::filesystem::permissions(secret, std::filesystem::perms::none);
  if (::access(secret.c_str(), R_OK) != 0) {  // root reads everything
    CHECK_THAT(test::reading_error(secret), Catch::Contains("cannot be opened"));
  }
}

}  // namespace
}  // namespace tessera
