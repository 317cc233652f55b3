/// \file height_sheet.h
/// A square of ground as an OFF file, its heights a function of the place.
#pragma once
#include <cstdio>
#include <functional>
#include <string>

namespace tessera::test {

/// steps by steps squares of two faces over [0, size]^2, moved by (x0, y0). \param height  of the place before that
inline std::string height_sheet(int steps, double size, double x0, double y0,
                                const std::function<double(double, double)>& height) {
  std::string text =
      "OFF " + std::to_string((steps + 1) * (steps + 1)) + " " + std::to_string(2 * steps * steps) + " 0\n";
  char line[120];
  for (int y = 0; y <= steps; ++y)
    for (int x = 0; x <= steps; ++x) {
      const double u = size * x / steps, v = size * y / steps;
      std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", x0 + u, y0 + v, height(u, v));
      text += line;
    }
  for (int y = 0; y < steps; ++y)
    for (int x = 0; x < steps; ++x) {
      const int a = y * (steps + 1) + x, b = a + 1, c = a + steps + 1, d = c + 1;
      std::snprintf(line, sizeof line, "3 %d %d %d\n3 %d %d %d\n", a, b, d, a, d, c);
      text += line;
    }
  return text;
}

}  // namespace tessera::test
