// STL as programs write it: counts that are claims, text with any white space.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cctype>
#include <optional>

#include "octree/error.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::stl_mesh_reader_test {
namespace {

using Catch::Contains;
using test::read_whole;
using test::TempFolder;

constexpr std::size_t kFacets = 12;

/// Corner k of facet f.
std::array<float, 3> corner(std::size_t f, std::size_t k) {
  return {static_cast<float>(f), static_cast<float>(k == 1), static_cast<float>(k == 2) + 0.5f};
}

/// \param count  of the header; none: the header lacks it
std::string binary(std::optional<std::uint32_t> count, std::string title = "cases") {
  title.resize(80, ' ');
  if (count) title.append(reinterpret_cast<const char*>(&*count), 4);
  for (std::size_t f = 0; f < kFacets; ++f) {
    const std::array<float, 3> normal = {0, 0, f % 2 == 0 ? 1.f : -1.f};
    title.append(reinterpret_cast<const char*>(&normal), 12);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto p = corner(f, k);
      title.append(reinterpret_cast<const char*>(&p), 12);
    }
    title.append(2, '\0');
  }
  return title;
}

std::string text(const std::string& name, std::size_t facets = kFacets) {
  std::string s = "solid " + name + "\n";
  for (std::size_t f = 0; f < facets; ++f) {
    s += " facet normal 0 0 1\n  outer loop\n";
    for (std::size_t k = 0; k < 3; ++k) {
      const auto p = corner(f, k);
      s += "   vertex " + std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) +
           "\n";
    }
    s += "  endloop\n endfacet\n";
  }
  return s + "endsolid " + name + "\n";
}

std::string replaced(std::string s, const std::string& from, const std::string& to) {
  for (std::size_t at = s.find(from); at != std::string::npos; at = s.find(from, at + to.size()))
    s.replace(at, from.size(), to);
  return s;
}

struct Reading {
  std::string format;
  std::size_t facets = 0;
  bool right = true;  ///< the corners are those of facets 0, 1, ...
  std::vector<std::string> warnings;
};

Reading read(const std::filesystem::path& path) {
  Reading r;
  const auto mesh = read_whole(path);
  r.format = mesh.format;
  r.facets = mesh.faces.size();
  for (std::size_t v = 0; v < mesh.points.size(); ++v) {
    const auto c = corner(v / 3 % kFacets, v % 3);
    r.right = r.right && mesh.points[v] == Double3{c[0], c[1], c[2]};
  }
  r.warnings = open_mesh_file(path)->warnings();
  return r;
}

TEST_CASE("STL reader: the size of a binary file decides, its count is a claim", "[unit]") {
  const TempFolder folder;
  for (const std::string title : {"cases", "solid part", "solid part\n facet normal", "solid"})
    for (const std::optional<std::uint32_t> count :
         {std::optional<std::uint32_t>(kFacets), std::optional<std::uint32_t>(0),
          std::optional<std::uint32_t>(5), std::optional<std::uint32_t>(100),
          std::optional<std::uint32_t>(0xffffffffu), std::optional<std::uint32_t>()}) {
      CAPTURE(title, count.value_or(7777));
      const Reading r = read(folder.write("a.stl", binary(count, title)));
      CHECK(r.format == "STL binary");
      CHECK(r.facets == kFacets);
      CHECK(r.right);
      CHECK(r.warnings.size() == (count == kFacets ? 0 : 1));
    }
  CHECK_THAT(read(folder.write("a.stl", binary(5))).warnings.at(0),
             Contains("counts 5") && Contains("holds 12"));
  CHECK_THAT(read(folder.write("a.stl", binary(std::nullopt))).warnings.at(0), Contains("lacks its count"));
}

TEST_CASE("STL reader: an appendix is no facet, a file cut off is refused", "[unit]") {
  const TempFolder folder;
  for (const std::string& tail : {std::string(37, '\0'), std::string(50, '\0'), std::string(500, '\0'),
                                  std::string(100, ' '), std::string(7, 'x')}) {
    CAPTURE(tail.size());
    const Reading r = read(folder.write("a.stl", binary(kFacets) + tail));
    CHECK(r.facets == kFacets);
    CHECK(r.right);
    REQUIRE(r.warnings.size() == 1);
    CHECK_THAT(r.warnings[0], Contains(std::to_string(tail.size()) + " bytes") && Contains("left out"));
  }
  for (const std::size_t less : {1, 4, 20, 49}) {
    const std::string whole = binary(kFacets);
    const auto path = folder.write("a.stl", whole.substr(0, whole.size() - less));
    CHECK_THROWS_WITH(read_whole(path), Contains("truncated") && Contains("12 facets"));
  }
  // Colours in the attribute bytes are not taken over.
  CHECK_THAT(read(folder.write("a.stl", binary(kFacets, "COLOR=\xff\x01\x01\xff"))).warnings.at(0),
             Contains("colours"));
}

TEST_CASE("STL reader: text with any white space between its words", "[unit]") {
  const TempFolder folder;
  const std::string plain = text("a");
  const auto upper = [](std::string s) {
    std::transform(s.begin(), s.end(), s.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return s;
  };
  const std::vector<std::string> all = {
      plain,
      replaced(plain, "\n", " "),  // one line
      replaced(plain, "\n", "\r\n"),
      replaced(plain, "\n", "\r"),
      replaced(plain, " ", "\n"),  // a word a line
      replaced(plain, " ", "\t\t"),
      upper(plain),
      upper(replaced(plain, "\n", " ")),
      " \n\t " + plain,
      " " + plain,
      "\xef\xbb\xbf" + plain,
      replaced(plain, "solid a", "solid"),
      replaced(replaced(plain, "solid a", "solid"), "\n", " "),
      replaced(plain, "endsolid a\n", ""),  // no end
      text("facet normal solid endsolid"),
      text("Caf\xe9 1 2 3 vertex 4"),
      text(std::string(600, 'x') + "/" + std::string(2000, 'y')),
      replaced(plain, "\n  outer", " outer"),
      replaced(plain, "loop\n   vertex", "loop vertex"),
      replaced(plain, "\n   vertex", " vertex"),
      replaced(plain, "vertex ", "vertex\n "),
      replaced(plain, "endloop", "end loop"),
      replaced(replaced(plain, "endloop", "end loop"), "endfacet", "end facet"),
      text("one", 7) + "\n\n" + text("two"),
  };
  for (std::size_t i = 0; i + 1 < all.size(); ++i) {
    CAPTURE(i, all[i].substr(0, 200));
    const Reading r = read(folder.write("a.stl", all[i]));
    CHECK(r.format == "STL text");
    CHECK(r.facets == kFacets);
    CHECK(r.right);
    CHECK(r.warnings.empty());
  }
  CHECK(read(folder.write("a.stl", all.back())).facets == 7 + kFacets);
  CHECK(read(folder.write("a.stl", replaced(text("one", 7) + text("two", 7), "\n", " "))).facets == 14);
  // Without the extension too.
  CHECK(read(folder.write("a.txt", " " + upper(plain))).facets == kFacets);
  CHECK(read(folder.write("b.stl", "solid nothing\nendsolid nothing\n")).facets == 0);
  CHECK_THROWS_WITH(read_whole(folder.write("c.stl", "this is a letter\n")), Contains("no STL"));
  CHECK_THROWS_WITH(read_whole(folder.write("c.stl", plain.substr(0, plain.size() - 60))),
                    Contains("the file ends"));
}

TEST_CASE("STL reader: text in UTF-16", "[unit]") {
  const TempFolder folder;
  for (const bool big : {false, true}) {
    std::string wide = big ? "\xfe\xff" : "\xff\xfe";
    for (const char c : text("a")) wide += big ? std::string{'\0', c} : std::string{c, '\0'};
    const Reading r = read(folder.write("a.stl", wide));
    CHECK(r.format == "STL text");
    CHECK(r.facets == kFacets);
  }
}

}  // namespace
}  // namespace tessera::stl_mesh_reader_test
