// `tools/panel` over a folder of made meshes, one of them broken on purpose, and with programs that only claim to be tessera.
#include <catch2/catch.hpp>

#include "stream/files/json.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

namespace panel_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

const std::string kPanel = std::string(TESSERA_SOURCE_DIR) + "/tools/panel ";

bool has_python() {
  if (shell("python3 -c 'import sys; sys.exit(sys.version_info < (3, 9))'").code == 0) return true;
  skip("needs python3");
  return false;
}

/// A body, a part with a hole, and a file whose faces name vertices that it does not have.
fs::path made_folder(const TempFolder& folder) {
  const fs::path meshes = folder / "meshes";
  fs::create_directories(meshes / "deep");
  write_whole(meshes / "body.ply", made_body(3));
  WholeMesh part = made_part({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}, 2);
  part.faces.pop_back();
  write_whole(meshes / "deep" / "part.obj", counted(part));
  folder.write("meshes/broken.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 7\n");
  folder.write("meshes/readme.txt", "no mesh");
  return meshes;
}

Outcome panel(const TempFolder& folder, const std::string& more,
              const std::string& tessera = TESSERA_BINARY) {
  return shell(kPanel + (folder / "meshes").string() + " --jobs 1 --dir " + (folder / "work").string() +
               " --tessera " + tessera + " " + more);
}

/// Outcome of a command on a file, as panel.json has it.
std::string outcome(const TempFolder& folder, const std::string& file, const std::string& command) {
  const Json summary = parse_json(file_bytes(folder / "work/panel.json"));
  for (const Json& r : summary.at("results"))
    if (r.at("file") == file && r.at("command") == command) return r.at("outcome").get<std::string>();
  return "none";
}

/// A program that is tessera but for one command, for which it does what `instead` says.
std::string impostor(const TempFolder& folder, const std::string& command, const std::string& instead) {
  const fs::path path = folder.write("impostor", "#!/bin/sh\nif [ \"$1\" = " + command + " ]; then " +
                                                     instead + "; fi\nexec " TESSERA_BINARY " \"$@\"\n");
  fs::permissions(path, fs::perms::owner_all);
  return path.string();
}

}  // namespace

TEST_CASE("panel: senseless lines end with 2", "[unit]") {
  if (!has_python()) return;
  const TempFolder folder;
  fs::create_directories(folder / "meshes");
  CHECK(panel(folder, "--only dance").code == 2);
  CHECK(panel(folder, "", (folder / "none").string()).code == 2);
  CHECK(shell(kPanel + (folder / "none").string()).code == 2);
}

TEST_CASE("panel: every command on three made meshes, and nothing twice", "[pipeline]") {
  if (!has_python()) return;
  const TempFolder folder;
  made_folder(folder);
  const Outcome first = panel(folder, "--only check,decimate,target,remesh,resurface,smooth,tiles");
  INFO(first.said);
  CHECK(first.code == 0);
  for (const char* command : {"check", "decimate", "target", "remesh", "resurface", "smooth", "tiles"}) {
    INFO(command);
    CHECK(outcome(folder, "body.ply", command) == "success");
    CHECK(outcome(folder, "deep/part.obj", command) == "success");
  }
  CHECK(outcome(folder, "body.ply", "csg") == "none");
  CHECK(outcome(folder, "readme.txt", "check") == "none");
  CHECK(outcome(folder, "broken.off", "resurface") == "no solid");
  CHECK(first.said.find("resurface") != std::string::npos);
  const std::string lines = file_bytes(folder / "work/results.jsonl");
  CHECK(std::count(lines.begin(), lines.end(), '\n') == 3 * 7);
  CHECK(panel(folder, "--only check,smooth").code == 0);
  CHECK(file_bytes(folder / "work/results.jsonl") == lines);
  // A line that a kill cut off is made again.
  folder.write("work/results.jsonl", std::string_view(lines).substr(0, lines.size() - 9));
  CHECK(panel(folder, "--only check,decimate,target,remesh,resurface,smooth,tiles").code == 0);
  CHECK(panel(folder, "--only check,smooth --again success").code == 0);
}

TEST_CASE("panel: crashes, wrong results, refusals without a reason and what takes too long are told apart",
          "[pipeline]") {
  if (!has_python()) return;
  const TempFolder folder;
  const fs::path meshes = made_folder(folder);
  const auto told = [&](const std::string& instead) {
    const Outcome run = panel(folder, "--only smooth --seconds 1 --again success,refused,timeout,crash,wrong",
                              impostor(folder, "smooth", instead));
    INFO(run.said);
    const std::string how = outcome(folder, "body.ply", "smooth");
    CHECK((run.code == 1) == (how != "refused"));
    return how;
  };
  CHECK(told("kill -SEGV $$") == "crash");
  CHECK(told("exit 70") == "crash");
  CHECK(told("echo 'tessera: error: this mesh is not to my liking, take another' >&2; exit 6") == "refused");
  CHECK(told("exit 3") == "wrong");
  CHECK(told("while :; do :; done") == "timeout");
  // An output that is open where the input was closed.
  const std::string part = (meshes / "deep/part.obj").string();
  CHECK(told("exec " TESSERA_BINARY " smooth " + part + " -o $4 --no-html --progress none -q --force") ==
        "wrong");
}

}  // namespace panel_test
