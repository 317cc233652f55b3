#include "stream/formats/meshes/mesh_precision.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "octree/error.h"
#include "octree/vector.h"
#include "stream/files/file_extension.h"
#include "stream/files/path_text.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

constexpr double kGain = 4.0;          ///< times as precise: worth an origin
constexpr double kFarExtents = 4.0;    ///< an axis that reaches so many extents from zero has an origin
constexpr double kLargestShare = 0.5;  ///< of a tolerance that rounding may take

/// Half the distance of two floats of this size.
double half_step(double size, int mantissa_bits, int min_exponent) {
  if (size == 0.0) return 0.0;
  int exponent = 0;
  std::frexp(size, &exponent);
  return std::ldexp(0.5, std::max(exponent - mantissa_bits, min_exponent));
}

/// Power of ten not above `value` > 0, as a whole number or one over it.
struct Decimal {
  double unit = 1.0;
  bool fraction = false;
};
Decimal decimal_below(double value) {
  Decimal d;
  if (value >= 1.0) {
    while (d.unit <= value / 10.0) d.unit *= 10.0;
  } else {
    d.fraction = true;
    while (1.0 / d.unit > value && d.unit < 1e300) d.unit *= 10.0;
  }
  return d;
}

Double3 local_origin(const Double3& low, const Double3& high) {
  double extent = 0.0, farthest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    extent = std::max(extent, high[k] - low[k]);
    farthest = std::max({farthest, std::fabs(low[k]), std::fabs(high[k])});
  }
  extent = std::max(extent, farthest * 1e-9);
  if (!(extent > 0.0) || !std::isfinite(extent)) return {0, 0, 0};
  const Decimal d = decimal_below(extent);
  Double3 origin = {0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    if (std::max(std::fabs(low[k]), std::fabs(high[k])) <= kFarExtents * extent) continue;
    const double middle = low[k] + 0.5 * (high[k] - low[k]);
    origin[k] = d.fraction ? std::round(middle * d.unit) / d.unit : std::round(middle / d.unit) * d.unit;
  }
  return origin;
}

std::string upper_extension(const std::filesystem::path& path) {
  std::string text = lower_extension(path).substr(1);
  for (char& c : text)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return text;
}

}  // namespace

bool holds_floats_only(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".stl" || extension == ".glb" || extension == ".3mf";
}

double float_rounding(const Double3& origin, const Double3& low, const Double3& high) {
  double squares = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double local = std::max(std::fabs(low[k] - origin[k]), std::fabs(high[k] - origin[k]));
    const double far = std::max(std::fabs(low[k]), std::fabs(high[k]));
    // Of the float; of the two sums in doubles that take the origin off and put it back.
    const double step = half_step(local, 24, -149) + 2.0 * half_step(far + std::fabs(origin[k]), 53, -1074);
    squares += step * step;
  }
  return std::sqrt(squares);
}

double fine_rounding(std::uint64_t faces, const Double3& low, const Double3& high, double tolerance) {
  const double edge = norm(high - low) / std::sqrt(static_cast<double>(faces) + 1.0);
  return tolerance > 0.0 ? std::min(1e-3 * edge, 1e-2 * tolerance) : 1e-3 * edge;
}

MeshPlacement place_mesh(const std::filesystem::path& path, bool double_positions, const Double3& low,
                         const Double3& high, double fine) {
  if (!double_positions || !holds_floats_only(path)) return {};
  MeshPlacement plain{{0, 0, 0}, float_rounding({0, 0, 0}, low, high)};
  if (lower_extension(path) != ".glb" && plain.rounding <= fine) return plain;
  MeshPlacement placed;
  placed.origin = local_origin(low, high);
  placed.rounding = float_rounding(placed.origin, low, high);
  return placed.rounding * kGain <= plain.rounding ? placed : plain;
}

double tolerance_before_rounding(const std::filesystem::path& output, double tolerance,
                                 const MeshPlacement& placement) {
  if (!(tolerance > 0.0) || placement.rounding == 0.0) return tolerance;
  // A little less, so that the sum of both is no more than the tolerance in doubles too.
  if (placement.rounding <= kLargestShare * tolerance)
    return (tolerance - placement.rounding) * (1.0 - 0x1p-50);
  throw ValidationError(output.string() + ": " + upper_extension(output) +
                        " holds floats of 32 bits, which move positions of a mesh of this size by up to " +
                        number_text(placement.rounding) +
                        " even from a local origin: too much for the tolerance of " + number_text(tolerance) +
                        "; write .ply or .obj, which hold doubles, or give a larger --tolerance");
}

std::vector<std::string> rounding_notices(const MeshRounding& rounding) {
  std::vector<std::string> notices;
  const std::string start =
      "floats of 32 bits move vertices by up to " + number_text(rounding.largest) + ": ";
  if (rounding.merged_vertices > 0)
    notices.push_back(start + std::to_string(rounding.merged_vertices) +
                      " came to lie on another one; .ply and .obj keep them apart");
  if (rounding.flattened_faces > 0)
    notices.push_back(start + std::to_string(rounding.flattened_faces) +
                      " faces have no area any more; .ply and .obj keep it");
  if (rounding.joined_vertices > 0)
    notices.push_back(std::to_string(rounding.joined_vertices) +
                      " vertices lie where another one does: readers of STL make one of them, which can "
                      "leave edges with more than two faces; .ply, .obj and .glb keep them apart");
  if (rounding.open)
    notices.push_back(
        "3MF is for solids, and this mesh is open: edges have no second face, or one that runs the same way; "
        "printers guess what is inside. tessera resurface closes it");
  return notices;
}

std::vector<std::string> threemf_notices(const std::filesystem::path& output, const Double3& origin,
                                         double unit) {
  std::vector<std::string> notices;
  if (lower_extension(output) != ".3mf") return notices;
  if (unit == 0.0)
    notices.push_back(
        "3MF names a unit and nothing tells that of the mesh: its coordinates count as "
        "millimetres; tessera convert --unit says otherwise");
  if (origin != Double3{0, 0, 0}) {
    std::string text = stl_shift_text(origin);
    text.pop_back();
    notices.push_back("3MF holds floats of 32 bits, too few for these coordinates: those in " +
                      json_text(output.filename()) + " count from " + text +
                      ", which its metadata tessera:origin tells");
  }
  return notices;
}

std::filesystem::path stl_shift_path(const std::filesystem::path& output) {
  if (lower_extension(output) != ".stl") return {};
  std::filesystem::path path = output;
  return path += ".shift";
}

std::string stl_shift_text(const Double3& origin) {
  std::string text;
  for (const double value : origin) {
    char digits[400];  // of the largest double, which other programs may not read with an exponent
    text.append(text.empty() ? "" : " ");
    text.append(digits, std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed).ptr);
  }
  return text + "\n";
}

std::string stl_shift_notice(const std::filesystem::path& output, const Double3& origin) {
  std::string text = stl_shift_text(origin);
  text.pop_back();
  return "STL holds floats of 32 bits, too few for these coordinates: those in " +
         json_text(output.filename()) + " count from " + text + ", which its header and " +
         json_text(stl_shift_path(output).filename()) +
         " tell; Tessera reads them back in place, other programs must add it";
}

}  // namespace tessera
