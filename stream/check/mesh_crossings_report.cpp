/// What a search for crossings says, to people and to programs.
#include <charconv>
#include <string>

#include "kernels/picture/caption.h"
#include "stream/check/mesh_crossings.h"
#include "stream/files/json.h"

namespace tessera {
namespace {

constexpr std::size_t kShownCrossings = 8;

const char* contact_name(FaceContact contact) {
  return contact == FaceContact::kCross ? "cross" : contact == FaceContact::kOverlap ? "overlap" : "touch";
}

std::string place_text(const Double3& place) {
  std::string text;
  for (const double x : place) {
    char digits[32];
    if (!text.empty()) text += ' ';
    text.append(digits, std::to_chars(digits, digits + sizeof digits, x, std::chars_format::general, 9).ptr);
  }
  return text;
}

}  // namespace

std::vector<std::string> MeshCrossings::defects() const {
  std::vector<std::string> list;
  const auto say = [&](std::uint64_t n, const char* one, const char* many) {
    if (n > 0) list.push_back(with_commas(n) + (n == 1 ? one : many));
  };
  say(crossing, " pair of faces crosses", " pairs of faces cross");
  say(overlapping, " pair of faces overlaps", " pairs of faces overlap");
  say(touching, " pair of faces touches beyond what it shares",
      " pairs of faces touch beyond what they share");
  return list;
}

Json to_json(const MeshCrossings& crossings) {
  Json listed = Json::array();
  for (const FaceCrossing& pair : crossings.listed)
    listed.push_back({{"contact", contact_name(pair.contact)}, {"faces", pair.faces}, {"place", pair.place}});
  return {{"cross", crossings.crossing}, {"overlap", crossings.overlapping}, {"touch", crossings.touching},
          {"faces", crossings.faces},    {"left_out", crossings.left_out},   {"listed", listed}};
}

std::string describe(const MeshCrossings& crossings) {
  std::string text;
  if (crossings.pairs() == 0) {
    text = "crossings     none";
  } else {
    text = "crossings     pairs of faces: " + with_commas(crossings.crossing) + " cross, " +
           with_commas(crossings.overlapping) + " overlap, " + with_commas(crossings.touching) + " touch; " +
           with_commas(crossings.faces) + " faces";
  }
  if (crossings.left_out > 0)
    text += "; " + with_commas(crossings.left_out) + " faces without area took no part";
  text += "\n";
  for (std::size_t i = 0; i < crossings.listed.size() && i < kShownCrossings; ++i) {
    const FaceCrossing& pair = crossings.listed[i];
    text += "              faces " + std::to_string(pair.faces[0]) + " and " + std::to_string(pair.faces[1]) +
            " " + contact_name(pair.contact) + " at " + place_text(pair.place) + "\n";
  }
  return text;
}

}  // namespace tessera
