/// \file aerial_scene.h
/// A scan from above whose ground is known, and LAS files of it: terrain, houses, crowns with ground below them, points
/// far below and far above.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace tessera::test {

struct ScenePoint {
  double x = 0.0, y = 0.0, z = 0.0;
  std::uint8_t truth = 0;  ///< 2 ground, 5 crowns, 6 houses, 7 noise
  std::uint8_t given = 0;  ///< class in the file
  bool withheld = false, synthetic = false;
};

inline double scene_terrain(double x, double y) {
  return 20.0 + 0.05 * x + 2.0 * std::sin(x / 25.0) * std::cos(y / 20.0);
}

/// 120 x 100 m with two points to a metre, in no order.
inline std::vector<ScenePoint> aerial_scene(unsigned seed = 1) {
  std::mt19937 random(seed);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<ScenePoint> points;
  const auto in_house = [](double x, double y) {
    return (x > 20 && x < 34 && y > 20 && y < 40) || (x > 70 && x < 90 && y > 60 && y < 72);
  };
  for (int v = 0; v < 200; ++v)
    for (int u = 0; u < 240; ++u) {
      const double x = 0.5 * (u + 0.9 * uniform()), y = 0.5 * (v + 0.9 * uniform());
      ScenePoint p{x, y, scene_terrain(x, y) + 0.05 * (uniform() - 0.5), 2, 1};
      const double a = std::fmod(x, 24.0) - 12.0, b = std::fmod(y, 25.0) - 5.0;
      if (in_house(x, y))
        p.z = 32.0 + 0.2 * x, p.truth = 6;
      else if (a * a + b * b < 9.0 && uniform() < 0.7)
        p.z += 3.0 + 5.0 * uniform(), p.truth = 5;
      points.push_back(p);
    }
  for (int k = 0; k < 12; ++k) {
    const double x = 5.0 + 9.3 * k, y = 95.0 - 7.1 * k;
    if (in_house(x, y)) continue;
    points.push_back({x, y, scene_terrain(x, y) - 15.0, 7, 1});
    points.push_back({x, y + 2.0, scene_terrain(x, y) + 300.0, 7, 1});
  }
  for (std::size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[random() % i]);
  return points;
}

struct SceneFile {
  int format = 1;  ///< 1: LAS 1.2; 6: LAS 1.4 with an extended record
  double east = 5e5, north = 5.4e6;
  bool degrees = false;  ///< what its coordinate system says
};

/// Every field that a copy must keep has a value that nothing else has.
inline std::string las_of(const std::vector<ScenePoint>& points, const SceneFile& file) {
  const bool wide = file.format >= 6;
  const std::size_t head = wide ? 375 : 227, bytes = (wide ? 30 : 28) + 2;
  const auto put = [](std::string& to, std::size_t at, auto value) {
    std::memcpy(to.data() + at, &value, sizeof value);
  };
  std::string f(head, '\0');
  f.replace(0, 4, "LASF"), f.replace(26, 4, "made"), f.replace(58, 4, "test");
  f[24] = 1, f[25] = wide ? 4 : 2, f[104] = static_cast<char>(file.format);
  put(f, 94, static_cast<std::uint16_t>(head)), put(f, 105, static_cast<std::uint16_t>(bytes));
  std::array<double, 3> low = {1e9, 1e9, 1e9}, high = {-1e9, -1e9, -1e9},
                        offset = {file.east, file.north, 0.0};
  std::string records;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ScenePoint& p = points[i];
    std::string r(bytes, '\0');
    const std::array<double, 3> at = {p.x, p.y, p.z};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto steps = static_cast<std::int32_t>(std::lround(at[a] * 100.0));
      put(r, 4 * a, steps);
      low[a] = std::min(low[a], steps * 0.01 + offset[a]),
      high[a] = std::max(high[a], steps * 0.01 + offset[a]);
    }
    put(r, 12, static_cast<std::uint16_t>(i * 7));
    r[14] = static_cast<char>(wide ? 0x21 : 0x11);
    const unsigned key = i % 5 == 0 ? 2u : 0u;  // a key point
    const unsigned flags = key | (p.synthetic ? 1u : 0u) | (p.withheld ? 4u : 0u);
    if (wide) {
      r[15] = static_cast<char>(flags | 0x40u), r[16] = static_cast<char>(p.given);
      put(r, 22, 1e5 + 1e-3 * static_cast<double>(i));
    } else {
      r[15] = static_cast<char>(flags << 5 | p.given);
      put(r, 20, 1e5 + 1e-3 * static_cast<double>(i));
    }
    put(r, 18, static_cast<std::uint16_t>(i % 9));
    put(r, bytes - 2, static_cast<std::uint16_t>(i * 31));
    records += r;
  }
  std::string texts = std::string(54, '\0') + "kept as it is";
  texts.replace(2, 4, "test"), put(texts, 20, std::uint16_t{13});
  std::uint32_t count = 1;
  if (file.degrees) {
    const std::array<std::uint16_t, 12> keys = {1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326};
    std::string record(54, '\0');
    record.replace(2, 15, "LASF_Projection"), put(record, 18, std::uint16_t{34735});
    put(record, 20, static_cast<std::uint16_t>(sizeof keys));
    record.append(reinterpret_cast<const char*>(keys.data()), sizeof keys);
    texts += record, ++count;
  }
  put(f, 96, static_cast<std::uint32_t>(head + texts.size() + 3)), put(f, 100, count);
  put(f, 107, static_cast<std::uint32_t>(wide ? 0 : points.size()));
  for (std::size_t a = 0; a < 3; ++a) {
    put(f, 131 + 8 * a, 0.01), put(f, 155 + 8 * a, offset[a]);
    put(f, 179 + 16 * a, high[a]), put(f, 187 + 16 * a, low[a]);
  }
  std::string tail;
  if (wide) {
    put(f, 247, static_cast<std::uint64_t>(points.size()));
    put(f, 235, static_cast<std::uint64_t>(head + texts.size() + 3 + records.size())),
        put(f, 243, std::uint32_t{1});
    tail = std::string(60, '\0') + "what follows";
    tail.replace(2, 4, "test"), put(tail, 20, std::uint64_t{12});
  }
  return f + texts + "pad" + records + tail;
}

/// Class of every record of such a file.
inline std::vector<int> las_classes(const std::string& file) {
  std::uint32_t begin = 0;
  std::uint16_t bytes = 0;
  std::uint64_t count = 0;
  std::memcpy(&begin, file.data() + 96, 4), std::memcpy(&bytes, file.data() + 105, 2);
  const bool wide = file[104] >= 6;
  std::memcpy(&count, file.data() + (wide ? 247 : 107), wide ? 8 : 4);
  std::vector<int> classes;
  for (std::size_t i = 0; i < count; ++i) {
    const auto c = static_cast<unsigned char>(file[begin + i * bytes + (wide ? 16 : 15)]);
    classes.push_back(wide ? c : c & 31);
  }
  return classes;
}

/// The file with every class set to 0.
inline std::string without_classes(std::string file) {
  std::uint32_t begin = 0;
  std::uint16_t bytes = 0;
  std::memcpy(&begin, file.data() + 96, 4), std::memcpy(&bytes, file.data() + 105, 2);
  const bool wide = file[104] >= 6;
  const std::size_t count = las_classes(file).size();
  for (std::size_t i = 0; i < count; ++i) {
    char& c = file[begin + i * bytes + (wide ? 16 : 15)];
    c = static_cast<char>(wide ? 0 : static_cast<unsigned char>(c) & 0xe0u);
  }
  return file;
}

}  // namespace tessera::test
