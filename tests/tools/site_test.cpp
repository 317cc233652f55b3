// reconstruct --tiles as a user runs it, and sites that are done: the bytes of `tessera tiles`, kills, refusals at once.
#include <catch2/catch.hpp>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/stages/reconstruct/site_after.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/tiles_site.h"

namespace site_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

/// A scan of about 160,000 faces, and places beside it.
class Workspace {
 public:
  Workspace() {
    const CommandResult r = tessera_command({"synth", "--scene", "terrain", "--points", "80k", "--normals",
                                             "--colour", "-o", at("scan.ply").string()});
    INFO(r.errors);
    REQUIRE(r.code == 0);
  }
  fs::path at(const std::string& name) const { return folder_.path() / name; }
  CommandResult reconstruct(const Words& more, const std::string& environment = {}) const {
    Words words = {
        "reconstruct", at("scan.ply").string(), "-o", at("mesh.ply").string(), "--progress", "none", "-q"};
    words.insert(words.end(), more.begin(), more.end());
    return tessera_command(words, 0, environment);
  }
  CommandResult tiles(const fs::path& site, const Words& more = {}) const {
    Words words = {"tiles", at("mesh.ply").string(), "-o", site.string(), "--progress", "none", "-q"};
    words.insert(words.end(), more.begin(), more.end());
    return tessera_command(words);
  }
  Json report(const std::string& name) const { return parse_json(file_bytes(at(name))); }

 private:
  TempFolder folder_;
};

void require_done(const CommandResult& r) {
  INFO(r.errors);
  REQUIRE(r.code == 0);
}

void check_refused(const CommandResult& r, int code, const std::string& word) {
  INFO(r.errors);
  CHECK(r.code == code);
  CHECK(r.errors.find(word) != std::string::npos);
  CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') == 1);
}

}  // namespace

TEST_CASE("site: reconstruct --tiles writes what tiles makes of its mesh, and the report says where",
          "[pipeline]") {
  const Workspace workspace;
  const std::string site = workspace.at("site").string();
  require_done(workspace.reconstruct({"--tiles", site, "-t", "2", "--memory", "512M"}));
  require_done(workspace.tiles(workspace.at("other"), {"-t", "1", "--memory", "1G"}));
  const auto bytes = site_bytes(site);
  CHECK(bytes.size() > 4);
  CHECK((site_bytes(workspace.at("other")) == bytes));
  CHECK_FALSE(fs::exists(workspace.at("mesh.ply.tessera")));
  CHECK_FALSE(fs::exists(workspace.at("site/tileset.json.tessera")));

  const Json tiles = workspace.report("mesh.ply.report.json").at("tiles");
  CHECK(tiles.at("path") == site + "/tileset.json");
  CHECK(tiles.at("report") == site + ".report.json");
  CHECK(tiles.at("tiles") == workspace.report("site.report.json").at("tiles").at("tiles"));
  CHECK(tiles.at("levels").size() > 1);

  {  // the same command again changes nothing
    const auto mesh = fs::last_write_time(workspace.at("mesh.ply"));
    const auto tileset = fs::last_write_time(site + "/tileset.json");
    const auto report = fs::last_write_time(workspace.at("mesh.ply.report.json"));
    require_done(workspace.reconstruct({"--tiles", site}));
    CHECK(fs::last_write_time(workspace.at("mesh.ply")) == mesh);
    CHECK(fs::last_write_time(site + "/tileset.json") == tileset);
    CHECK(fs::last_write_time(workspace.at("mesh.ply.report.json")) == report);
  }
  {  // a finished mesh gets a site by the same command with --tiles
    const auto mesh = fs::last_write_time(workspace.at("mesh.ply"));
    require_done(workspace.reconstruct({"--tiles", workspace.at("late").string()}));
    CHECK(fs::last_write_time(workspace.at("mesh.ply")) == mesh);
    CHECK((site_bytes(workspace.at("late")) == bytes));
    CHECK(workspace.report("mesh.ply.report.json").at("tiles").at("path") ==
          workspace.at("late/tileset.json").string());
  }
  {  // a site that is done is recognised, one that lacks a tile is not taken for it
    const Outcome again = shell(std::string(TESSERA_BINARY) + " tiles " + workspace.at("mesh.ply").string() +
                                " -o " + site + " --progress none");
    CHECK(again.code == 0);
    CHECK(again.said.find("done before") != std::string::npos);
    fs::remove(site + "/tiles/0/000001.glb");
    check_refused(workspace.tiles(site), 2, "--force");
    require_done(workspace.tiles(site, {"--force"}));
    CHECK((site_bytes(site) == bytes));
  }
}

TEST_CASE(
    "site: killed anywhere, reconstruct --tiles goes on, and the bytes are those of a run without stops",
    "[fault]") {
  const Workspace workspace;
  const std::string site = workspace.at("site").string();
  require_done(workspace.reconstruct({"--tiles", site}));
  const auto bytes = site_bytes(site);
  const std::string mesh = file_bytes(workspace.at("mesh.ply"));
  fs::remove_all(site);
  for (const char* name : {"mesh.ply", "mesh.ply.report.json", "site.report.json"})
    fs::remove(workspace.at(name));
  int kills_of_tiles = 0;
  const auto again = [&](const std::string& fault) {
    return workspace.reconstruct({"--tiles", site}, fault);
  };
  const int kills = killed_at_commits(23, 4, again, [&] {
    kills_of_tiles += fs::exists(site + "/tileset.json.tessera");
    CHECK((fs::exists(workspace.at("mesh.ply")) || !fs::exists(site)));
    // What makes a site of the folder comes last: once it is there nothing else is missing, though the work may still lie around.
    if (fs::exists(site + "/tileset.json.tessera") && fs::exists(site + "/tileset.json")) {
      auto now = site_bytes(site);
      std::erase_if(now, [](const auto& file) { return file.first.find(".tessera") != std::string::npos; });
      CHECK((now == bytes));
    }
  });
  CHECK(kills > kills_of_tiles);
  CHECK(kills_of_tiles > 0);
  CHECK((site_bytes(site) == bytes));
  CHECK(file_bytes(workspace.at("mesh.ply")) == mesh);
}

TEST_CASE("site: what --tiles cannot do is refused before the scan is read", "[pipeline]") {
  const Workspace workspace;
  const auto refused = [&](const fs::path& site, const std::string& word, const Words& more = {}) {
    Words words = {"--tiles", site.string()};
    words.insert(words.end(), more.begin(), more.end());
    check_refused(workspace.reconstruct(words), 2, word);
    CHECK_FALSE(fs::exists(workspace.at("mesh.ply")));
    CHECK_FALSE(fs::exists(workspace.at("mesh.ply.tessera")));
  };
  refused(workspace.at("scan.ply"), "a file");
  refused(workspace.at("no/such"), "cannot be made");
  refused(workspace.at(""), "not empty");
  refused(workspace.at(""), "lies in it", {"--force"});
  refused(workspace.at("mesh.ply.tessera/site"), "cannot be made");
  spill(workspace.at("old/tileset.json"), "{}");
  refused(workspace.at("old"), "another mesh");
  spill(workspace.at("site.report.json"), "mine");
  refused(workspace.at("site"), "site.report.json");
  CHECK(file_bytes(workspace.at("site.report.json")) == "mine");
}

TEST_CASE("site: tiles that will not fit a disk or a cap are told before they are begun", "[fault]") {
  const Workspace workspace;
  require_done(workspace.reconstruct({}));
  const Outcome cap = shell(std::string(TESSERA_BINARY) + " tiles " + workspace.at("mesh.ply").string() +
                            " -o " + workspace.at("capped").string() + " --memory 8M");
  CHECK(cap.code == 4);
  CHECK(cap.said.find("would do is --memory") != std::string::npos);
  CHECK_FALSE(fs::exists(workspace.at("capped")));
  if (::geteuid() != 0) {
    skip("mounting a small tmpfs needs root");
    return;
  }
  const std::string disk = workspace.at("disk").string();
  fs::create_directories(disk);
  if (shell("mount -t tmpfs -o size=3m tessera-test " + disk).code != 0) {
    skip("this machine does not let root mount a tmpfs");
    return;
  }
  check_refused(workspace.tiles(disk + "/site"), 4, "are free");
  CHECK_FALSE(fs::exists(disk + "/site"));
  fs::remove(workspace.at("mesh.ply"));
  fs::remove(workspace.at("mesh.ply.report.json"));
  const CommandResult r = workspace.reconstruct({"--tiles", disk + "/site"});
  check_refused(r, 4, "the site");
  const Json stages = workspace.report("mesh.ply.report.json").at("stages");
  CHECK(stages.back().at("name") == "forecast");  // no point was dealt out
  // Work elsewhere, it fits, and the command goes on.
  require_done(workspace.reconstruct({"--tiles", disk + "/site", "--temp", workspace.at("").string()}));
  CHECK(shell("umount " + disk).code == 0);
}

TEST_CASE("site: what is told of its disk holds for a mesh of a scan", "[property]") {
  const Workspace workspace;
  require_done(workspace.reconstruct({}));
  const fs::path site = workspace.at("site"), work = site / "tileset.json.tessera";
  std::uint64_t maximum = 0;
  for (int commits = 1; !fs::exists(work / "level-1");
       ++commits) {  // what lies there when the process dies at one
    fs::remove_all(site);
    Words words = {"tiles", workspace.at("mesh.ply").string(), "-o", site.string(), "-q", "--progress",
                   "none"};
    const CommandResult r = tessera_command(words, 0, "TESSERA_FAULT=commit:" + std::to_string(commits));
    REQUIRE(r.code == 128 + SIGKILL);
    maximum = std::max(maximum, bytes_below(work));
  }
  require_done(workspace.tiles(site, {"--force"}));
  const MeshSize mesh = claimed_mesh_size(workspace.at("mesh.ply"));
  const TilesDisk tiles = tiles_disk({}, mesh);
  INFO("bytes a face in the work directory: "
       << static_cast<double>(maximum) / static_cast<double>(mesh.faces)
       << ", in the site: " << static_cast<double>(bytes_below(site)) / static_cast<double>(mesh.faces));
  CHECK(maximum <= tiles.work);
  CHECK(static_cast<double>(maximum) > 0.5 * static_cast<double>(tiles.work));
  CHECK(bytes_below(site) <= tiles.site);
  CHECK(static_cast<double>(bytes_below(site)) > 0.4 * static_cast<double>(tiles.site));
}

}  // namespace site_test
