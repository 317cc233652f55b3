// The page of a job for people: what it says, that it is whole, that it costs and breaks nothing.
#include <catch2/catch.hpp>

#include <vector>

#include "kernels/picture/caption.h"
#include "stream/files/json.h"
#include "stream/page/html.h"
#include "stream/page/page_text.h"
#include "stream/page/report_page.h"
#include "tests/helpers/command.h"
#include "tests/helpers/html_fault.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace report_test {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

CommandResult with_page(const std::vector<std::string>& words) {
  return tessera_command(words, 0, {}, true);
}

fs::path scan(const TempFolder& folder, const std::string& name = "scan.ply") {
  const fs::path path = folder / name;
  REQUIRE(tessera_command({"synth", "--scene", "csg", "--points", "40000", "--normals", "-o", path.string()})
              .code == 0);
  return path;
}

Json report_of(const fs::path& mesh) {
  return parse_json(file_bytes(mesh.string() + ".report.json"));
}

bool holds(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

}  // namespace

TEST_CASE("report: the page is well formed, holds the figures, and loads nothing", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder / "mesh.ply";
  const CommandResult r = with_page(
      {"reconstruct", scan(folder).string(), "-o", mesh.string(), "--tolerance", "0.01", "--memory", "1G"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const std::string page = file_bytes(mesh.string() + ".report.html");
  CHECK(html_fault(page) == "");
  const Json report = report_of(mesh);
  const auto count = [&](const char* part, const char* key) {
    return with_commas(report.at(part).at(key).get<std::uint64_t>());
  };
  CHECK(holds(page, "<td class=\"n\">40,000</td>"));
  CHECK(holds(page, "<td>" + count("mesh", "faces") + "</td>"));
  CHECK(holds(page, "<td>" + count("mesh", "vertices") + "</td>"));
  CHECK(holds(page, "proven: at most"));
  CHECK(holds(page, "<tr><th scope=\"row\">surface</th>"));
  CHECK(holds(page, "src=\"data:image/png;base64,"));
  CHECK(holds(page, "id=\"view-faces\""));
  CHECK(holds(page, "Faces by their smallest angle"));
  CHECK(holds(page, "<section id=\"completeness\""));
  CHECK(holds(page, " of what was seen is in the mesh"));
  CHECK(holds(page, count("coverage", "points_missing") + " of " + count("coverage", "points")));
  CHECK(report.at("coverage").at("confirmed") > 0.9);
  CHECK_FALSE(holds(page, "http:"));
  CHECK_FALSE(holds(page, "https:"));
  CHECK_FALSE(holds(page, "<link"));
  CHECK_FALSE(holds(page, " left out: "));
  CHECK(report.at("page").at("seconds") > 0.0);
  CHECK(r.peak_bytes < std::uint64_t{1} << 30);

  // The same page again, from the report alone; and another name, moved with its report.
  const fs::path again = folder / "again.html";
  REQUIRE(tessera_command({"report", mesh.string() + ".report.json", "-o", again.string()}).code == 0);
  CHECK(file_bytes(again) == page);
  CHECK(tessera_command({"report", mesh.string() + ".report.json", "-o", mesh.string()}).code == 2);
  CHECK(tessera_command({"report", mesh.string() + ".report.json"}).code ==
        0);  // its own page it may replace
}

TEST_CASE("report: same page whatever threads, tiles and cap, but for what the run itself took",
          "[property]") {
  const TempFolder folder;
  const fs::path in = scan(folder), mesh = folder / "mesh.ply";
  std::string first;
  for (const std::vector<std::string>& run : {std::vector<std::string>{"-t", "1", "--memory", "2G"},
                                              {"-t", "2", "--tile-size", "64", "--memory", "600M"}}) {
    std::vector<std::string> words = {"reconstruct", in.string(), "-o", mesh.string(), "--force"};
    words.insert(words.end(), run.begin(), run.end());
    REQUIRE(with_page(words).code == 0);
    std::string page = file_bytes(mesh.string() + ".report.html");
    page.erase(page.find("<header>"), page.find("</header>") - page.find("<header>"));
    page.erase(page.find("<div class=\"tiles\">"),
               page.find("<section") - page.find("<div class=\"tiles\">"));
    page.erase(page.find("<section id=\"run\""),
               page.find("<section id=\"options\"") - page.find("<section id=\"run\""));
    if (first.empty()) first = page;
    CHECK(page == first);
  }
}

TEST_CASE("report: the smallest cap of a job holds its pictures, and where one does not the page says so",
          "[memory]") {
  const TempFolder folder;
  const fs::path mesh = folder / "mesh.ply";
  const CommandResult r =
      with_page({"reconstruct", scan(folder).string(), "-o", mesh.string(), "--memory", "96M"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes < std::uint64_t{96} << 20);
  const fs::path page = mesh.string() + ".report.html";
  CHECK(html_fault(file_bytes(page)) == "");
  CHECK(holds(file_bytes(page), "data:image/png;base64,"));
  CHECK_FALSE(holds(file_bytes(page), "left out"));
  // The drawing library, which would take half of the cap, is not in the process.
  CHECK(report_of(mesh).at("peak_bytes").get<std::uint64_t>() < std::uint64_t{80} << 20);

  const CommandResult again =
      tessera_command({"report", mesh.string() + ".report.json", "--force", "--memory", "48M"});
  INFO(again.errors);
  REQUIRE(again.code == 0);
  CHECK(html_fault(file_bytes(page)) == "");
  CHECK(holds(file_bytes(page), "Pictures left out: "));
  CHECK(holds(file_bytes(page), "--memory"));
}

TEST_CASE("report: a map of distances that would take longer than the job is left out and says so",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder / "mesh.ply", less = folder / "less.ply";
  REQUIRE(tessera_command({"reconstruct", scan(folder).string(), "-o", mesh.string()}).code == 0);
  REQUIRE(tessera_command({"decimate", mesh.string(), "-o", less.string(), "--tolerance", "0.01"}).code == 0);
  const auto report = parse_json(file_bytes(less.string() + ".report.json"));
  PageRequest request{less, folder.path(), std::uint64_t{4} << 30, 3600.0};
  const PageParts whole = make_page_parts(report, request);
  CAPTURE(whole.deviation_note);
  CHECK(!whole.deviation.empty());
  request.map_seconds = 0.0;
  const PageParts parts = make_page_parts(report, request);
  CHECK(parts.deviation.empty());
  CHECK(parts.deviation_note.find("longer than the job") != std::string::npos);
  CHECK(parts.deviation_note.find("tessera render") != std::string::npos);
  CHECK(!parts.pictures.empty());
}

TEST_CASE("report: refused jobs have a page with the refusal, and their report makes it again",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = scan(folder), mesh = folder / "mesh.ply";
  const std::vector<std::string> words = {"reconstruct", in.string(), "-o",          mesh.string(),
                                          "--tolerance", "0.000001",  "--reference", "points"};
  const CommandResult r = with_page(words);
  REQUIRE(r.code == 6);
  CHECK_FALSE(fs::exists(mesh));
  const Json report = report_of(mesh);
  CHECK(report.at("refused").at("code") == 6);
  const std::string page = file_bytes(mesh.string() + ".report.html");
  CHECK(html_fault(page) == "");
  CHECK(holds(page, html::escape(report.at("refused").at("message").get<std::string>())));
  CHECK(holds(page, "Exit code 6"));
  CHECK(holds(page, "<td class=\"n\">40,000</td>"));
  REQUIRE(tessera_command({"report", mesh.string() + ".report.json"}).code == 0);
  CHECK(file_bytes(mesh.string() + ".report.html") == page);
  // What the refusal left is in nobody's way.
  CHECK(with_page({"reconstruct", in.string(), "-o", mesh.string(), "--force"}).code == 0);
  CHECK_FALSE(report_of(mesh).contains("refused"));
}

TEST_CASE("report: --no-html leaves the page out, and a file of the user's in its place is never lost",
          "[fault]") {
  const TempFolder folder;
  const fs::path in = scan(folder), mesh = folder / "mesh.ply";
  const fs::path page = mesh.string() + ".report.html";
  spill(page, "mine");
  CHECK(with_page({"reconstruct", in.string(), "-o", mesh.string()}).code == 2);
  CHECK(file_bytes(page) == "mine");
  CHECK_FALSE(fs::exists(mesh));
  CHECK(with_page({"reconstruct", in.string(), "-o", mesh.string(), "--no-html"}).code == 0);
  CHECK(file_bytes(page) == "mine");
  CHECK(tessera_command({"report", mesh.string() + ".report.json"}).code == 2);
  CHECK(tessera_command({"report", mesh.string() + ".report.json", "--force"}).code == 0);
  CHECK(is_page(page));
  for (const char* text :
       {"", "{", "[]", "{\"tool\":\"tessera\"}", "{\"tool\":\"tessera\",\"stages\":[],\"schema\":99}"}) {
    spill(folder / "bad.json", text);
    CHECK(tessera_command({"report", (folder / "bad.json").string()}).code == 3);
  }
}

TEST_CASE("report: names of files are text and nothing else", "[unit]") {
  CHECK(html::escape("<script>\"'&\n\x01") == "&lt;script&gt;&quot;&#39;&amp;\n\xef\xbf\xbd");
  CHECK(html::escape("a\xe2\x80\xae"
                     "b\xe2\x81\xa7") ==
        "a\xef\xbf\xbd"
        "b\xef\xbf\xbd");
  CHECK(html::base64("") == "");
  CHECK(html::base64("f") == "Zg==");
  CHECK(html::base64("fo") == "Zm8=");
  CHECK(html::base64("foobar") == "Zm9vYmFy");
  // Every text of a report, whatever its place, and values of the wrong kind.
  const std::string evil = "\"><script>alert(1)</script><img src=x onerror=y>";
  const Json stage = {{"name", evil}, {"tasks", 1}, {"units", evil}, {"result", {{"scene", evil}}}};
  Json report = {{"tool", "tessera"},
                 {"command", evil},
                 {"version", evil},
                 {"finished", evil},
                 {"warnings", {evil, 7}},
                 {"stages", {stage, 3, nullptr}},
                 {"machine", {{"host", evil}, {"cores", evil}}},
                 {"inputs", {{{"path", evil}, {"bytes", -5}}}},
                 {"options", {{evil, evil}, {"x", {evil}}}},
                 {"output", {{"path", evil}}},
                 {"mesh", {{"faces", evil}, {"vertices", -1e300}}},
                 {"input", {{"format", evil}, {"repair", {{evil, 5}}}}},
                 {"resolution", {{"h", 1.0}, {"reason", evil}}},
                 {"certificate", {{"certified_max", 1e-3}, {"tolerance", evil}}},
                 {"run", {{"memory_cap", evil}}},
                 {"refused", {{"message", evil}, {"code", evil}, {"meaning", evil}}}};
  PageParts parts;
  parts.pictures_note = parts.deviation_note = parts.preview_note = parts.check_note = evil;
  const std::string page = page_text(report, parts);
  CHECK(html_fault(page) == "");
  CHECK_FALSE(holds(page, "<script>alert"));
  CHECK_FALSE(holds(page, "<img src=x"));
  CHECK(holds(page, "&lt;script&gt;alert(1)"));
  CHECK(html_fault(page_text(Json::object(), {})) == "");
  CHECK(html_fault(page_text(Json(), {})) == "");
  CHECK(html_fault("<!DOCTYPE html>\n<p><b></p></b>") != "");  // the measure itself
}

TEST_CASE("report: a closed mesh that is inside out is told", "[pipeline]") {
  const TempFolder folder;
  const std::string corners = "OFF 4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  const std::string outwards = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n",
                    inwards = "3 0 1 2\n3 0 3 1\n3 1 3 2\n3 0 2 3\n";
  for (const bool right : {true, false}) {
    const fs::path in = folder / "in.off", mesh = folder / "mesh.ply";
    spill(in, corners + (right ? outwards : inwards));
    REQUIRE(with_page({"smooth", in.string(), "-o", mesh.string(), "--steps", "1", "--tolerance", "0.001",
                       "--force"})
                .code == 0);
    CHECK(holds(file_bytes(mesh.string() + ".report.html"), "inside out") != right);
  }
}

}  // namespace report_test
