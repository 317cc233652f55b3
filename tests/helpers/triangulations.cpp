#include "tests/helpers/triangulations.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"
#include "tests/helpers/made_meshes.h"

namespace tessera::test {
namespace {

constexpr double kHigh = 0.8660254037844386;  ///< of an equilateral triangle of side 1

/// The profile of a capsule of radius 1 whose middle is so long, by arc length from one pole.
struct Profile {
  double x = 0.0, radius = 0.0;
};
Profile capsule(double at, double middle) {
  const double quarter = 0.5 * kPi;
  if (at < quarter) return {1.0 - sin_cos(at).cos, sin_cos(at).sin};
  if (at < quarter + middle) return {1.0 + at - quarter, 1.0};
  const SinCos end = sin_cos(at - quarter - middle);
  return {1.0 + middle + end.sin, end.cos};
}

SmoothSurface capsule_surface(const std::string& name, double middle, bool square) {
  SmoothSurface out;
  out.name = name;
  out.round = true;
  out.length = middle + kPi;
  out.widest = 2.0 * kPi * (square ? 1.1 : 1.0);
  out.point = [=](double s, double t) {
    const Profile p = capsule(s * (middle + kPi), middle);
    const SinCos a = sin_cos(2.0 * kPi * t);
    // |y|^4 + |z|^4 = 1.
    const double c2 = a.cos * a.cos, s2 = a.sin * a.sin;
    const double by = square ? 1.0 / std::sqrt(std::sqrt(c2 * c2 + s2 * s2)) : 1.0;
    return Double3{p.x, p.radius * by * a.cos, p.radius * by * a.sin};
  };
  out.width = [=, widest = out.widest](double s) {
    return widest * capsule(s * (middle + kPi), middle).radius;
  };
  return out;
}

struct Row {
  double s = 0.0;
  std::vector<double> t;  ///< ascending; of a sheet from 0 to 1
};

/// By how much rows and the vertices of a row lie apart, for a place.
struct Spacing {
  double along = 1.0, across = 1.0;
};

Spacing spacing(Triangulation kind, double edge, double s, std::size_t row) {
  if (kind == Triangulation::kFine) return {kHigh * edge, edge};
  if (kind == Triangulation::kCoarse) return {kHigh * 12.0 * edge, 12.0 * edge};
  if (kind == Triangulation::kSlivers) return {(row % 2 == 0 ? 21.0 : 1.2) * edge, 3.0 * edge};
  if (kind == Triangulation::kIrregular) return {kHigh * 6.0 * edge, 6.0 * edge};
  const double off = std::max(0.0, std::fabs(s - 0.55) - 0.1);
  const double length = std::min(12.0, 3.0 + 90.0 * off) * edge;
  return {kHigh * length, length};
}

/// Random and the same everywhere, -1 to 1.
double chance(std::uint64_t stream, std::size_t row, std::size_t k) {
  return 2.0 * to_unit(random_bits(stream, row, k)) - 1.0;
}

Row made_row(const SmoothSurface& surface, Triangulation kind, double s, double across, std::size_t number) {
  Row row{s, {}};
  const bool strewn = kind == Triangulation::kIrregular;
  double wanted = surface.width(s) / across;
  if (strewn) wanted *= 1.0 + 0.3 * chance(1, number, 0);
  const auto count = std::max<std::size_t>(surface.round ? 5 : 2, static_cast<std::size_t>(wanted + 0.5));
  const auto n = static_cast<double>(count);
  // Rows of equal counts stand in the gaps of each other, but for slivers.
  const double shift = kind == Triangulation::kSlivers ? 0.0 : 0.5 * static_cast<double>(number % 2);
  for (std::size_t k = 0; k < count; ++k) {
    double t = static_cast<double>(k) + shift;
    if (strewn) t += 0.35 * chance(2, number, k);
    row.t.push_back(t / n);
  }
  if (!surface.round) {
    // From border to border.
    row.t.front() = 0.0;
    row.t.push_back(1.0);
  }
  return row;
}

/// Where rows lie, the ends included.
std::vector<Row> made_rows(const SmoothSurface& surface, Triangulation kind, double edge) {
  std::vector<double> at = {0.0};
  std::vector<double> across;
  while (at.back() < 1.0) {
    const Spacing by = spacing(kind, edge, at.back(), at.size());
    across.push_back(by.across);
    at.push_back(at.back() + by.along / surface.length);
  }
  for (double& s : at) s /= at.back();
  across.push_back(across.back());
  std::vector<Row> rows;
  for (std::size_t k = 0; k < at.size(); ++k) {
    double s = at[k];
    if (const bool end = k == 0 || k + 1 == at.size(); end && surface.round) {
      rows.push_back({s, {0.0}});
      continue;
    } else if (!end && kind == Triangulation::kIrregular) {
      s += 0.3 * chance(3, k, 0) * std::min(at[k] - at[k - 1], at[k + 1] - at[k]);
    }
    rows.push_back(made_row(surface, kind, s, across[k], k));
  }
  return rows;
}

}  // namespace

SmoothSurface smooth_tube() {
  return capsule_surface("tube", 10.0, false);
}
SmoothSurface smooth_bar() {
  return capsule_surface("bar", 10.0, true);
}
SmoothSurface smooth_ball() {
  return capsule_surface("ball", 0.0, false);
}

SmoothSurface smooth_sheet() {
  SmoothSurface out;
  out.name = "sheet";
  out.length = out.widest = 10.0;
  out.point = [](double s, double t) {
    return Double3{10.0 * t, 10.0 * s, 0.15 * sin_cos(12.0 * s).sin * sin_cos(9.0 * t + 1.0).sin};
  };
  out.width = [](double) { return 10.0; };
  return out;
}

std::string name_of(Triangulation kind) {
  static const char* const kNames[] = {"fine", "coarse", "slivers", "irregular", "refined"};
  return kNames[static_cast<std::size_t>(kind)];
}

WholeMesh triangulated(const SmoothSurface& surface, Triangulation kind, double edge) {
  WholeMesh mesh;
  std::vector<std::uint64_t> first;
  const std::vector<Row> rows = made_rows(surface, kind, edge);
  std::size_t number = 0;
  for (const Row& row : rows) {
    first.push_back(mesh.points.size());
    const bool strewn = kind == Triangulation::kIrregular && number > 0 && number + 1 < rows.size();
    for (std::size_t k = 0; k < row.t.size(); ++k) {
      // Strewn along, too, by less than half of the way to the next row.
      const double s = row.s + (strewn ? 0.15 * chance(4, number, k) * 6.0 * edge / surface.length : 0.0);
      mesh.points.push_back(surface.point(s, row.t[k]));
    }
    ++number;
  }
  // Between two rows: whichever comes next around gets the next face.
  for (std::size_t r = 0; r + 1 < rows.size(); ++r) {
    const Row &low = rows[r], &high = rows[r + 1];
    const std::size_t n = low.t.size(), m = high.t.size();
    const std::size_t low_steps = surface.round ? (n > 1 ? n : 0) : n - 1,
                      high_steps = surface.round ? (m > 1 ? m : 0) : m - 1;
    const auto at = [&](const Row& row, std::size_t k) {
      return row.t[k % row.t.size()] + static_cast<double>(k / row.t.size());
    };
    std::size_t i = 0, j = 0;
    while (i < low_steps || j < high_steps) {
      const std::uint64_t a = first[r] + i % n, b = first[r + 1] + j % m;
      const bool lower = j == high_steps || (i < low_steps && at(low, i + 1) <= at(high, j + 1));
      if (lower)
        mesh.faces.push_back({a, first[r] + (i + 1) % n, b});
      else
        mesh.faces.push_back({a, first[r + 1] + (j + 1) % m, b});
      ++(lower ? i : j);
    }
  }
  return counted(mesh);
}

}  // namespace tessera::test
