#include "stream/formats/ply_header.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "tests/helpers/temp_folder.h"

namespace tessera {
namespace {

PlyHeader parse(const std::string& text) {
  const test::TempFolder folder;
  return read_ply_header(ReadFile(folder.write("a.ply", text)));
}

std::string error_of(const std::string& text) {
  try {
    parse(text);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

const std::string kHeader =
    "ply\nformat binary_little_endian 1.0\ncomment made by hand\nobj_info num_cols 3\n"
    "element vertex 3\nproperty float x\nproperty uchar red\nproperty double y\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

std::string with(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

TEST_CASE("ply header: elements, properties, offsets, comments", "[unit]") {
  const PlyHeader h = parse(kHeader + "data");
  CHECK(h.encoding == PlyEncoding::kLittleEndian);
  CHECK(h.data_begin == kHeader.size());
  CHECK(h.comments == std::vector<std::string>{"made by hand"});
  CHECK(h.obj_info == std::vector<std::string>{"num_cols 3"});
  REQUIRE(h.elements.size() == 2);
  REQUIRE(h.find("vertex") == 0);
  const PlyElement& vertex = h.elements[0];
  CHECK(vertex.count == 3);
  CHECK(vertex.stride() == 13);
  CHECK(vertex.offset(2) == 5);
  CHECK(vertex.find("y") == 2);
  CHECK(vertex.find("z") == -1);
  CHECK_FALSE(vertex.has_list());
  CHECK(h.elements[1].has_list());
  CHECK(h.elements[1].properties[0].count_type == ScalarType::kUint8);
  CHECK(h.elements[1].properties[0].type == ScalarType::kInt32);
}

TEST_CASE("ply header: lines end in LF, CRLF or CR", "[unit]") {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    const std::string text = with(kHeader, "\n", end);
    const PlyHeader h = parse(text + "data");
    CHECK(h.data_begin == text.size());
    CHECK(h.elements[1].properties[0].name == "vertex_indices");
    CHECK(h.line_end == end.back());
  }
  CHECK(parse("ply\nformat ascii 1.0\nend_header").elements.empty());  // no last line end
}

TEST_CASE("ply header: every cut of it is refused, naming the file", "[fault]") {
  for (std::size_t bytes = 0; bytes + 1 < kHeader.size(); ++bytes) {
    const std::string error = error_of(kHeader.substr(0, bytes));
    CAPTURE(bytes);
    REQUIRE(error.find("a.ply") != std::string::npos);
  }
}

TEST_CASE("ply header: what is wrong is named with its line", "[fault]") {
  const auto error = [](const char* from, const char* to) { return error_of(with(kHeader, from, to)); };
  CHECK_THAT(error("property float x", "property half x"),
             Catch::Contains("line 6") && Catch::Contains("'half'"));
  CHECK_THAT(error("element vertex 3", "element vertex -3"),
             Catch::Contains("line 5") && Catch::Contains("'-3'"));
  CHECK_THAT(error("element vertex 3", "element vertex 99999999999999999999"), Catch::Contains("2^64-1"));
  CHECK_THAT(error("list uchar int", "list float int"), Catch::Contains("float type"));
  CHECK_THAT(error("binary_little_endian", "binary"),
             Catch::Contains("line 2") && Catch::Contains("'binary'"));
  CHECK_THAT(error("double y", "double x"), Catch::Contains("'x'") && Catch::Contains("twice"));
  CHECK_THAT(error("element vertex 3\n", ""), Catch::Contains("before any element"));
  CHECK_THAT(error("format", "formed"), Catch::Contains("unknown keyword"));
  CHECK_THAT(error("ply\n", "plyx\n"), Catch::Contains("does not start"));
  CHECK_THAT(error("ply\n", "solid\n"), Catch::Contains("not a PLY"));
  CHECK_THAT(error_of("ply\ncomment " + std::string(5 << 20, 'c')), Catch::Contains("end_header"));
}

TEST_CASE("ply header: elements with lists are walked, absurd counts end at the end of the file", "[unit]") {
  const test::TempFolder folder;
  PlyElement element;
  element.properties = {{"n", ScalarType::kInt32, true, ScalarType::kUint8}, {"f", ScalarType::kFloat32}};
  const std::string one = std::string("\x02") + std::string(8 + 4, 'a');
  const ReadFile file(folder.write("a.bin", one + one + one.substr(0, 7)));
  ByteWindow window(file, 0, file.size());
  CHECK(skip_ply_elements(element, false, 2, window) == 2);
  CHECK(window.offset() == 2 * one.size());
  CHECK(skip_ply_elements(element, false, ~std::uint64_t{0}, window) == 0);

  const ReadFile negative(folder.write("b.bin", "\xff\xff\xff\xff\x01\x01\x01\x01"));
  element.properties = {{"n", ScalarType::kFloat64, true, ScalarType::kInt32}};
  ByteWindow start(negative, 0, negative.size());
  CHECK(skip_ply_elements(element, false, 1, start) == 0);
}

TEST_CASE("ply header: numbers of both endiannesses", "[unit]") {
  const char bytes[] = {'\x01', '\x02', '\x03', '\xff', '\0', '\0', '\0', '\0'};
  CHECK(load_double(ScalarType::kUint16, false, bytes) == 0x0201);
  CHECK(load_double(ScalarType::kUint16, true, bytes) == 0x0102);
  CHECK(load_double(ScalarType::kInt8, true, bytes + 3) == -1);
  CHECK(load_integer(ScalarType::kUint32, false, bytes) == 0xff030201u);
  CHECK(load_integer(ScalarType::kInt32, true, bytes) == 0x010203ffu);
}

TEST_CASE("numbers in text: signs, exponents, extremes and what is none", "[unit]") {
  const auto number = [](std::string_view text) {
    double value = -7;
    return take_number(text, value) ? value : -7;
  };
  CHECK(number("+1.5e3") == 1500);
  CHECK(number("-.5") == -0.5);
  CHECK(number("1e-999") == 0);
  CHECK(number("-1e999") == -std::numeric_limits<double>::infinity());
  CHECK(std::isnan(number("nan")));
  CHECK(number("inf") == std::numeric_limits<double>::infinity());
  CHECK(number("+-1") == -7);
  CHECK(number("") == -7);
  CHECK(number("x") == -7);
  std::string_view rest = "12,5";
  double value = 0;
  CHECK(take_number(rest, value));
  CHECK(rest == ",5");
  std::uint64_t count = 0;
  rest = "18446744073709551616";
  CHECK_FALSE(take_count(rest, count));
}

}  // namespace
}  // namespace tessera
