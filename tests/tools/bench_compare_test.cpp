// `tools/bench compare` with programs that only claim to be tessera: lines, table, bytes; no figure is looked at.
#include <catch2/catch.hpp>

#include <sstream>

#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

namespace bench_compare_test {

namespace {

using namespace tessera;

const std::string kBench = std::string(TESSERA_SOURCE_DIR) + "/tools/bench compare ";

bool has_time() {
  if (std::filesystem::exists("/usr/bin/time") && test::shell("command -v jq").code == 0) return true;
  test::skip("needs GNU time and jq");
  return false;
}

/// Writes `text` and its command where it is told to, and ends with 3 at `fails`.
std::string program(const test::TempFolder& folder, const std::string& name, const std::string& text,
                    const std::string& fails = "nothing") {
  const std::filesystem::path path = folder / name;
  test::spill(path,
              "#!/bin/sh\ncommand=$1\nshift\n[ $command != " + fails + " ] || { echo 'no idea'; exit 3; }\n" +
                  "while [ $# -gt 0 ]; do\n  case $1 in -o) out=$2; shift 2 ;; *) shift ;; esac\ndone\n" +
                  "[ $command != synth ] || echo '{\"spacing\": 0.1}' > \"$out.truth.json\"\n" + "echo \"" +
                  text + " $command\" > \"$out\"\n");
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path.string();
}

/// The words of the table's row of a job; none where it has no row.
std::vector<std::string> row(const std::string& said, const std::string& job) {
  std::istringstream lines(said);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::vector<std::string> all;
    for (std::string word; words >> word;) all.push_back(word);
    if (!all.empty() && all[0] == job) return all;
  }
  return {};
}

}  // namespace

TEST_CASE("bench compare: senseless lines end with 2 and say how", "[unit]") {
  if (!has_time()) return;
  const test::TempFolder folder;
  const std::string a = program(folder, "a", "x");
  for (const std::string& line :
       {a, a + " " + a + " " + a, a + " --runs", a + " " + a + " --runs 0", a + " " + a + " --limit much",
        a + " " + a + " --jobs raw,dance", a + " " + a + " --dance", a + " " + (folder / "none").string()}) {
    INFO(line);
    const test::Outcome outcome = test::shell(kBench + line + " --dir " + (folder / "work").string());
    CHECK(outcome.code == 2);
    CHECK(!outcome.said.empty());
  }
}

TEST_CASE("bench compare: one row a job with medians, ratios and whether bytes agree", "[pipeline]") {
  if (!has_time()) return;
  const test::TempFolder folder;
  const std::string old = program(folder, "old", "x"), same = program(folder, "same", "x"),
                    other = program(folder, "other", "y");
  const std::string more = " --quick --runs 2 --jobs raw,tolerance,decimate,smooth,denoise,estimate --dir " +
                           (folder / "work").string() + " ";
  const test::Outcome agree = test::shell(kBench + old + " " + same + more + "--limit 1000");
  CHECK(agree.code == 0);
  CHECK(agree.said.find("300k points, cap 1G, medians of 2") != std::string::npos);
  for (const char* job : {"raw", "tolerance", "decimate", "smooth", "denoise", "estimate"}) {
    const std::vector<std::string> words = row(agree.said, job);
    INFO(job << ":\n" << agree.said);
    REQUIRE(words.size() == 11);
    CHECK(words.back() == "same");
    CHECK(std::stod(words[words.size() - 4]) > 0.0);  // peak of OLD: a shell has some memory
  }
  CHECK(row(agree.said, "happy").empty());
  const test::Outcome differ = test::shell(kBench + old + " " + other + more + "--limit 1000");
  CHECK(differ.code == 0);
  CHECK(row(differ.said, "raw").back() == "differ");
  // No shell takes a hundredth of the memory of the same shell.
  const test::Outcome worse = test::shell(kBench + old + " " + same + more + "--limit 0.01");
  CHECK(worse.code == 1);
  CHECK(worse.said.find("NEW is worse: ") != std::string::npos);
}

TEST_CASE("bench compare: a job that one side cannot do is said to be so", "[pipeline]") {
  if (!has_time()) return;
  const test::TempFolder folder;
  const std::string good = program(folder, "good", "x"), bad = program(folder, "bad", "x", "smooth");
  const std::string more = " --quick --jobs raw,smooth --dir " + (folder / "work").string();
  const test::Outcome broken = test::shell(kBench + good + " " + bad + more);
  CHECK(broken.code == 1);
  CHECK(row(broken.said, "raw").back() == "same");
  CHECK(broken.said.find("smooth     NEW cannot do it") != std::string::npos);
  CHECK(broken.said.find("exit code 3: no idea") != std::string::npos);
  const test::Outcome able = test::shell(kBench + bad + " " + good + more);
  CHECK(able.code == 0);
  CHECK(able.said.find("smooth     OLD cannot do it") != std::string::npos);
}

}  // namespace bench_compare_test
