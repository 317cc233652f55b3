/// \file point_samples.h
/// Small files of points in all their ways, for damage to begin from: the mutation tests and the fuzz targets.
#pragma once
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "tests/helpers/e57_writer.h"
#include "tests/helpers/lzf_block.h"

namespace tessera::fuzz {

inline std::string ply_file(const std::string& format, const std::string& data) {
  return "ply\nformat " + format +
         " 1.0\ncomment c\nelement before 1\nproperty list uchar uchar q\nelement vertex 5\n"
         "property float x\nproperty float y\nproperty ushort red\nproperty ushort green\nproperty ushort "
         "blue\n"
         "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
         data;
}

inline std::vector<std::string> ply_files() {
  std::string binary = "\x02xy";
  for (char i = 0; i < 5; ++i)
    binary += std::string(4, i) + "\x40\x40\x40\x40" + "rrggbb" + std::string(8, '\x3f');
  binary += "\x03" + std::string(12, '\0');
  std::string cloud =
      "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty double x\r\nproperty list uchar int l\r\n"
      "property double y\r\nproperty float z\r\nproperty float nx\r\nproperty float ny\r\n"
      "property float nz\r\nend_header\r\n";
  for (int i = 0; i < 4; ++i) cloud += "1e3 2 7 8 -.5 nan 0 0 1\r\n";
  return {ply_file("binary_little_endian", binary), ply_file("binary_big_endian", binary),
          ply_file("ascii",
                   "2 1 1\n1 2 3 4 5 6\n1 2 3 4 5 6\n\n1 2 3 4 5 6\n-1 2 3 4 5 6\n1 2 3 4 5 6\n3 0 1 2\n"),
          cloud};
}

inline std::vector<std::string> las_files() {
  std::vector<std::string> files;
  for (const auto& [minor, format, record] :
       {std::array{2, 3, 34}, std::array{4, 7, 40}, std::array{3, 0, 20}}) {
    const std::size_t head = minor == 4 ? 375 : minor == 3 ? 235 : 227;
    std::string f(head, '\0');
    const auto set = [&f](std::size_t at, auto value) { std::memcpy(f.data() + at, &value, sizeof value); };
    f.replace(0, 4, "LASF");
    f[24] = 1, f[25] = static_cast<char>(minor), f[104] = static_cast<char>(format);
    set(96, static_cast<std::uint32_t>(head)), set(105, static_cast<std::uint16_t>(record));
    set(107, std::uint32_t{6});
    for (std::size_t a = 0; a < 3; ++a) set(131 + 8 * a, 0.01), set(179 + 16 * a, 1e6);
    if (minor == 4) set(247, std::uint64_t{6});
    for (char i = 0; i < 6; ++i)
      f += std::string(static_cast<std::size_t>(record), static_cast<char>(i * 51));
    files.push_back(f);
  }
  return files;
}

inline std::vector<std::string> text_files() {
  return {"# c\n1 2 3 10 20 30\n4 5 6 7 8 9\n\n-1e5 .5 nan 1 2 3",
          "Name,\"X\",y (m),Z,r,g,b\n\"a, b\",1,2,3,4,5,6\nc,1,,3,4,5,6\n",
          "2\n1 2 3 -100 10 20 30\n4 5 6 200 10 20 30\n1\n7 8 9 0 1 2 3\n", "1;2;3\r4;5;6\r7;8;9\r"};
}

inline std::vector<std::string> ptx_files() {
  const std::string header = "2\n2\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n";
  return {header + "1 2 3 .5\n0 0 0 .5\n4 5 6 .5 1 2 3\n7 8 9 1\n" + header + "1 2 3 4 5 6 7\n0 0 0 0\n",
          header};
}

inline std::vector<std::string> pcd_files() {
  const std::string header =
      "# .PCD v0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nPOINTS 8\nVIEWPOINT 1 2 3 1 0 0 0\nDATA ";
  const std::string data(128, '\x3f');
  const std::string packed = test::lzf_block(data);
  std::string lines;
  for (int i = 0; i < 8; ++i) lines += "1 -2.5 nan 4286578943\n";
  return {header + "binary\n" + data,
          header + "binary_compressed\n" + static_cast<char>(packed.size()) +
              std::string("\0\0\0\x80\0\0\0", 7) + packed,
          header + "ascii\n" + lines};
}

inline std::vector<std::string> e57_files() {
  const std::string pose = test::e57_pose("0.6", "0", "0.8", "0", "1", "2", "3");
  std::vector<test::E57TestScan> scans(2);
  scans[0].fields =
      test::e57_doubles(test::kE57Cartesian, std::vector<std::vector<double>>(3, {1, 2, 3, 4, 5, 6, 7}));
  scans[0].xml = pose;
  scans[0].packets = 3;
  scans[1].fields =
      test::e57_doubles(test::kE57Spherical, std::vector<std::vector<double>>(3, {.1, .2, .3, .4}), "single");
  scans[1].fields.push_back({"sphericalInvalidState", "Integer", {}, {0, 1, 2, 0}, 0, 2, 1.0, 0.0, {}});
  scans[1].fields.push_back({"colorRed", "Integer", {}, {0, 10, 200, 255}, 0, 255, 1.0, 0.0, {}});
  scans[1].fields.push_back({"colorGreen", "Integer", {}, {0, 10, 200, 255}, -7, 500, 1.0, 0.0, {}});
  scans[1].fields.push_back({"colorBlue", "ScaledInteger", {}, {0, 10, 200, 255}, 0, 255, 0.5, 1.0, {}});
  return {test::e57_file(scans), test::e57_file({scans[1]}), test::e57_file({scans[0]})};
}

}  // namespace tessera::fuzz
