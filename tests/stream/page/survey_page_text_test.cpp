// The builder of survey pages: whatever stands in a page, it is text.
#include <catch2/catch.hpp>

#include <cmath>
#include <regex>

#include "octree/error.h"
#include "stream/page/survey_page.h"
#include "tests/helpers/html_fault.h"

namespace survey_page_text_test {

using namespace tessera;
using namespace tessera::test;

namespace {

bool holds(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

std::size_t count_of(const std::string& text, const std::string& what) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

/// Coordinates in the `d` of its paths of a look.
std::size_t coordinates(const std::string& svg, const std::string& look) {
  std::size_t count = 0, at = 0;
  const std::string begin = "<path class=\"" + look + "\" d=\"";
  while ((at = svg.find(begin, at)) != std::string::npos) {
    const std::size_t end = svg.find('"', at + begin.size());
    count += static_cast<std::size_t>(std::count(svg.begin() + static_cast<std::ptrdiff_t>(at),
                                                 svg.begin() + static_cast<std::ptrdiff_t>(end), ','));
    at = end;
  }
  return count;
}

}  // namespace

TEST_CASE("survey page: all that is named in it is escaped, and what is empty is left out", "[unit]") {
  const std::string evil = "<script>alert(\"1\")</script>&'";
  SurveyPage page;
  page.title = evil, page.subject = evil, page.command = "change";
  page.verdict = PageVerdict{false, evil};
  page.headlines = {{evil, evil}}, page.notices = {evil};
  page.inputs = page.figures = {{evil, evil}};
  page.histogram = html::Histogram{evil, {1, 2}, {evil, evil, evil}, {{0.5, evil}}};
  page.scale = PageScale{-1, 1, evil, evil, {{"#123456", evil}}};
  page.pictures = {{"png", evil, evil}}, page.pictures_note = evil;
  page.place_columns = {evil}, page.places = {{{1, 2, 3}, {evil}}}, page.places_note = evil;
  page.tables_title = evil, page.tables = {{evil, {evil}, {{evil, evil}}, evil}};
  page.drawings_title = evil, page.drawings_note = evil;
  page.drawings.push_back({evil, {{evil, evil}}, PlanDrawing({0, 0}, {1, 1}, evil, evil)});
  page.drawings.back().drawing.label({0.5, 0.5}, evil);
  const std::string text = survey_page_text(page);
  CHECK(html_fault(text) == "");
  CHECK_FALSE(holds(text, "<script"));
  CHECK(count_of(text, "alert(") >= 30);
  CHECK(holds(text, "default-src 'none'"));
  CHECK(holds(text, "NOT PASSED"));

  SurveyPage little;
  little.title = "Sections", little.subject = "a", little.command = "section";
  const std::string empty = survey_page_text(little);
  CHECK(html_fault(empty) == "");
  CHECK_FALSE(holds(empty, "<section"));
  CHECK_FALSE(holds(empty, "<table"));
  CHECK_FALSE(holds(empty, "PASSED"));
}

TEST_CASE("survey page: names of pages end in .html or .htm", "[unit]") {
  CHECK_NOTHROW(require_page_name(""));
  CHECK_NOTHROW(require_page_name("a.HTML"));
  CHECK_NOTHROW(require_page_name("a.htm"));
  CHECK_THROWS_AS(require_page_name("a.json"), UsageError);
  CHECK_THROWS_AS(require_page_name("html"), UsageError);
}

TEST_CASE("plan drawing: a drawing has a round scale and as wide a field on paper as it says", "[unit]") {
  PlanDrawing drawing({0, 0}, {120, 30}, "offset", "height");
  CHECK(drawing.scale_text() == "1 : 1000 on paper where coordinates are metres");
  const std::vector<Double2> line = {{0, 0}, {120, 30}};
  drawing.add(line, false, DrawnLine::kOutline);
  // 120 m at 1 : 1000 are 120 mm, 2400 twentieths.
  CHECK(holds(drawing.svg(), "l2400,-600\""));
  CHECK(html_fault("<!DOCTYPE html>" + drawing.svg()) == "");
  CHECK(holds(drawing.svg(), ">100</text>"));
}

TEST_CASE("plan drawing: however many points lines have, it holds a bounded number of them", "[unit]") {
  PlanDrawing drawing({0, 0}, {100, 100}, "x", "y", 5000);
  for (int line = 0; line < 20; ++line) {
    std::vector<Double2> points;
    for (int i = 0; i < 20000; ++i)
      points.push_back({50.0 + 40.0 * std::sin(0.01 * i + line), 50.0 + 40.0 * std::cos(0.013 * i)});
    drawing.add(points, false, DrawnLine::kOutline);
  }
  const std::string svg = drawing.svg();
  CHECK(coordinates(svg, "outline") <= 5000);
  CHECK(coordinates(svg, "outline") > 1000);
}

}  // namespace survey_page_text_test
