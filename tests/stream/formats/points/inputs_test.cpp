#include <sys/resource.h>
#include <unistd.h>

#include "tests/helpers/laz_file.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::inputs_test {
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
  CHECK(names({at}) == Names{"a.ply", "b.las", "c.XYZ", "d.laz", "k[1].ply", "e.pts"});
  CHECK(names({at + "b.las", at + "*.ply", at + "./b.las"}) == Names{"b.las", "a.ply", "k[1].ply"});
  CHECK(names({at + "k[1].ply"}) == Names{"k[1].ply"});
  CHECK(names({at + "su*"}) == Names{"e.pts"});
  CHECK(names({at + "readme.txt"}) == Names{"readme.txt"});
  folder.write("list", "# scans\r\n\r\nsub\r\n b.las \r\n*.ply\r\n" + at + "c.XYZ");
  CHECK(names({"@" + at + "list", at + "a.ply"}) == Names{"e.pts", "b.las", "a.ply", "k[1].ply", "c.XYZ"});
  std::filesystem::create_symlink(folder.path() / "b.las", folder.path() / "link.las");
  CHECK(names({at + "link.las", at + "b.las"}) == Names{"link.las"});
}

TEST_CASE("inputs: folders are searched at any depth, hidden files and work directories are not", "[unit]") {
  const test::TempFolder folder;
  using Names = std::vector<std::string>;
  const auto make = [&](const std::string& file) {
    std::filesystem::create_directories((folder / file).parent_path());
    folder.write(file, "x");
  };
  for (const char* f :
       {"site/strip2/b.laz", "site/strip1/a.laz", "site/strip1/deep/er/c.las", "site/readme.txt",
        "site/.hidden.las", "site/strip1/._a.laz", "site/.git/z.las", "site/out.ply.tessera/p.ply",
        "site/notes.pdf", "site/d.xyz.gz", "site/log.gz", "site/tape.zst", "site/Makefile"})
    make(f);
  const std::string at = folder.path().string() + "/";
  CHECK(names({at + "site"}) == Names{"d.xyz.gz", "a.laz", "c.las", "b.laz"});
  CHECK(names({at + "si*"}) == Names{"d.xyz.gz", "a.laz", "c.las", "b.laz"});
  CHECK(names({at + "**/*.laz"}) == Names{"a.laz", "b.laz"});
  CHECK(names({at + "site/**/c.las"}) == Names{"c.las"});
  CHECK(names({at + "site/**/er/*"}) == Names{"c.las"});
  CHECK(names({at + "site/**"}) == Names{"d.xyz.gz", "a.laz", "c.las", "b.laz"});
  CHECK(names({at + "site/strip?/*.laz"}) == Names{"a.laz", "b.laz"});
  CHECK(names({at + "site/.h*"}) == Names{".hidden.las"});  // asked for by name
  CHECK_THAT(expansion_error(at + "**/*.e57"), Catch::Contains("matches"));
  const InputList list = list_inputs({at + "site"});
  REQUIRE(list.notes.size() == 1);
  CHECK_THAT(list.notes[0], Catch::Contains("4 files of points (2 laz, 1 las, 1 xyz.gz) in 4 folders") &&
                                Catch::Contains("1 pdf") && Catch::Contains("1 txt") &&
                                Catch::Contains("1 gz") && Catch::Contains("1 zst") &&
                                Catch::Contains("1 without extension") && Catch::Contains("3 hidden"));
  std::filesystem::create_directory_symlink(folder / "site", folder / "site/strip1/round");
  CHECK(names({at + "site"}).size() == 4);
  CHECK(names({at + "**/*.laz"}).size() == 2);
  make("texts/a.txt");
  CHECK_THAT(expansion_error(at + "texts"), Catch::Contains("no file of points") && Catch::Contains("1 txt"));
}

/// A LAZ file of so many points.
std::string laz_of(std::size_t points, unsigned seed) {
  const test::LazSample s{.format = 3, .points = points, .seed = seed};
  return test::laz_file(s, test::las_records(s)).bytes;
}

TEST_CASE("inputs: an EPT folder is the scan of all nodes that its hierarchy lists", "[unit]") {
  const test::TempFolder folder;
  for (const char* f : {"site/ept/ept-data", "site/ept/ept-hierarchy", "site/ept/ept-sources"})
    std::filesystem::create_directories(folder / f);
  folder.write("site/ept/ept.json", R"({"dataType":"laszip","points":60,"schema":[]})");
  folder.write("site/ept/ept-hierarchy/0-0-0-0.json", R"({"0-0-0-0":10,"1-0-0-0":-1,"1-1-0-0":20})");
  folder.write("site/ept/ept-hierarchy/1-0-0-0.json", R"({"1-0-0-0":30,"2-1-0-0":0})");
  folder.write("site/ept/ept-sources/list.json", "[]");
  folder.write("site/ept/ept-data/0-0-0-0.laz", laz_of(10, 1));
  folder.write("site/ept/ept-data/1-0-0-0.laz", laz_of(30, 2));
  folder.write("site/ept/ept-data/1-1-0-0.laz", laz_of(20, 3));
  const std::string at = folder.path().string() + "/";
  for (const char* spelling : {"site", "site/ept", "site/ept/ept.json", "si*", "site/**"}) {
    CAPTURE(spelling);
    std::uint64_t points = 0;
    const auto paths = expand_inputs({at + spelling});
    REQUIRE(paths.size() == 3);
    for (const auto& path : paths) {
      const auto r = test::read_points(path);
      points += r.counts.points + r.counts.withheld;
    }
    CHECK(points == 60);
  }
  CHECK_THAT(list_inputs({at + "site"}).notes[0], Catch::Contains("3 nodes of an EPT octree"));
  // Files that no hierarchy lists, a node without its file, the scan beside its octree.
  folder.write("site/ept/ept-data/1-1-1-1.laz", laz_of(5, 4));
  folder.write("site/ept/whole.las", "x");
  std::filesystem::remove(folder / "site/ept/ept-data/1-1-0-0.laz");
  const InputList list = list_inputs({at + "site"});
  CHECK(list.files.size() == 2);
  std::string notes;
  for (const std::string& line : list.notes) notes += line + "\n";
  CHECK_THAT(notes, Catch::Contains("20 points are missing") &&
                        Catch::Contains("1 files in ept-data are no nodes") &&
                        Catch::Contains("1 las beside it"));
  folder.write("site/ept/ept.json", R"({"dataType":"zstandard"})");
  CHECK_THAT(expansion_error(at + "site"), Catch::Contains("zstandard") && Catch::Contains("laszip"));
  for (const char* damage : {"", "[", "[]", "{\"dataType\":1}"}) {
    folder.write("site/ept/ept.json", damage);
    CHECK_THAT(expansion_error(at + "site"), Catch::Contains("ept.json"));
  }
}

TEST_CASE("inputs: a Potree octree of LAZ files is the scan of all its nodes", "[unit]") {
  const test::TempFolder folder;
  const auto make = [&](const std::string& file, const std::string& bytes) {
    std::filesystem::create_directories((folder / file).parent_path());
    folder.write(file, bytes);
  };
  for (const std::string root : {"p1/data/", "p2/"}) {
    make(root + "r/r.laz", laz_of(10, 1));
    make(root + "r/r0.laz", laz_of(20, 2));
    make(root + "r/00001/r00001.laz", laz_of(30, 3));
    make(root + "r/r.hrc", "x");
  }
  folder.write("p1/cloud.js",
               R"({"version":"1.7","octreeDir":"data","pointAttributes":"LAZ","scale":0.001})");
  folder.write("p2/cloud.js",
               R"({"version":"1.7","octreeDir":"data","pointAttributes":"LAZ","scale":0.001})");
  folder.write("p1/sources.laz", "x");
  const std::string at = folder.path().string() + "/";
  using Names = std::vector<std::string>;
  CHECK(names({at + "p1"}) == Names{"r00001.laz", "r.laz", "r0.laz"});
  CHECK(names({at + "p1/cloud.js"}) == Names{"r00001.laz", "r.laz", "r0.laz"});
  CHECK(names({at + "p2"}) == Names{"r00001.laz", "r.laz", "r0.laz"});
  CHECK_THAT(list_inputs({at + "p1"}).notes[0], Catch::Contains("3 nodes of a Potree octree"));
  folder.write("p1/cloud.js",
               R"({"octreeDir":"data","pointAttributes":["POSITION_CARTESIAN","COLOR_PACKED"]})");
  CHECK_THAT(expansion_error(at + "p1"), Catch::Contains("binary"));
  folder.write("p1/cloud.js", R"({"octreeDir":"../p2","pointAttributes":"LAZ"})");
  CHECK_THAT(expansion_error(at + "p1"), Catch::Contains("outside"));
  make("p3/metadata.json", "{}");
  make("p3/octree.bin", "x");
  CHECK_THAT(expansion_error(at + "p3"), Catch::Contains("Potree 2"));
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
}  // namespace tessera::inputs_test
