/// \file blend_file.h
/// What people write of blends, as JSON (README, "Blends").
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/blends/resample_blend.h"

namespace tessera {

/// A blend by hand: points that its spine passes, on the surface or near it.
struct NamedCurve {
  std::string name;
  std::vector<Double3> points;
  bool closed = false;
  double width = 0.0;  ///< of the band, from flank to flank
};

/// {"blends": [{"name": "rim", "points": [[x, y, z], ...], "width": 2.5, "closed": true}, ...]}
/// \param name  for messages
/// \throws InputError naming file and place: no JSON, unknown keys, numbers missing
std::vector<NamedCurve> parse_curves(const std::string& text, const std::string& name);

/// {"knots": [{"at": [u, v], "way": [u, v]}, ...]}: the first knot at (0, 0), the last at (1, 0).
/// \throws InputError as parse_curves()
std::vector<ProfileKnot> parse_profile(const std::string& text, const std::string& name);

/// A file that parse_curves() or parse_profile() accepts, as one line of JSON. \throws InputError
std::string read_curves_text(const std::filesystem::path& file);
std::string read_profile_text(const std::filesystem::path& file);

}  // namespace tessera
