#include "stream/stages/remesh/remesh_verdict.h"

#include <cmath>
#include <string>

#include "octree/error.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

/// Percent of the faces: where more have an angle below 25 degrees the result is no better than what was given.
constexpr double kMostNarrow = 25.0, kWarnOffDegrees = 8.0;
/// Where edges could keep less near to the input.
constexpr double kMostNarrowNear = 0.25;

double off_degrees(const Json& round) {
  return round.at("quality").value("mean_angle_deviation_deg", 0.0);
}

double percent_narrow(const Json& round) {
  return 100.0 * round.at("quality").value("share_below_25_deg", 0.0);
}

}  // namespace

bool RemeshVerdict::are_far_more(std::uint64_t faces, double times) const {
  return options_.keeps_faces() && faces > options_.faces + kAlwaysMoreFaces &&
         static_cast<double>(faces) > times * static_cast<double>(options_.faces);
}

void RemeshVerdict::refuse_far_more(std::uint64_t faces) const {
  throw ValidationError("--faces " + std::to_string(options_.faces) +
                        " cannot be had: creases, borders and needles of this mesh keep " +
                        std::to_string(faces) + " faces even where edges are to be " + number_text(edge_) +
                        " long; ask for more, or give --edge " + number_text(edge_) +
                        ", which takes as many as there are");
}

bool RemeshVerdict::is_poor(const Json& round) {
  return percent_narrow(round) > kMostNarrowNear || off_degrees(round) > kWarnOffDegrees;
}

const Json& RemeshVerdict::judge_shape(Json& round) const {
  if (!options_.keeps_faces()) return round;
  const double off = off_degrees(round), narrow = percent_narrow(round);
  const std::string edge = number_text(edge_),
                    why =
                        "creases, borders, needles or walls of this mesh lie closer together than edges of " +
                        edge;
  if (narrow > kMostNarrow)
    throw ValidationError("--faces " + std::to_string(options_.faces) +
                          " cannot be had with sound shapes: " + number_text(std::round(narrow)) +
                          " % of the faces have an angle below 25 degrees; " + why +
                          "; ask for more faces, try --crossings repair, or give --edge " + edge +
                          ", which takes shapes as they come");
  if (off > kWarnOffDegrees)
    round["warnings"] = {"angles are " + number_text(std::round(10.0 * off) / 10.0) +
                         " degrees off 60 in the mean: " + why + "; more faces get better shapes"};
  return round;
}

}  // namespace tessera
