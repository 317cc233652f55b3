#include "kernels/merge/merge_sheet.h"

#include <algorithm>

namespace tessera {
namespace {

/// Between normals of two surfaces that can be the same one: noise turns them, the other side of a wall turns them back.
constexpr double kSameSide = 0.25;
/// Of MergeRange::beyond: a border that reaches less far beyond another is not passed.
constexpr double kPassed = 0.25;

double lateral_distance(const Double3& p, const SignedDistance::Foot& foot, const Double3& side) {
  const Double3 away = p - foot.at;
  return norm(away - side * dot(away, side));
}

}  // namespace

MergeSheet::Sample MergeSheet::at(const Double3& p, double maximum, double beyond,
                                  const Double3* normal) const {
  Sample sample;
  sample.foot = surface_.closest(p, maximum * maximum);
  if (sample.foot.face == SignedDistance::kNone) return sample;
  const Double3 side = unit_or_zero(sample.foot.side);
  if (normal && dot(side, *normal) < kSameSide) return sample;
  if (sample.foot.border) {
    sample.lateral = lateral_distance(p, sample.foot, side);
    if (sample.lateral > beyond) return sample;
  }
  sample.cover = own_cover(sample.foot.at);
  return sample;
}

double MergeSheet::own_cover(const Double3& p) const {
  if (joints_.empty()) return 1.0;
  const ClosestFaces::Hit hit = joints_.closest(p, fade_ * fade_, ClosestFaces::kNone);
  return hit.slot == ClosestFaces::kNone ? 1.0 : std::min(1.0, std::sqrt(hit.square) / fade_);
}

bool MergeSheet::passes(const Double3& p, const MergeRange& range, const Double3& normal) const {
  const SignedDistance::Foot foot = surface_.closest(p, range.apart * range.apart);
  if (foot.face == SignedDistance::kNone) return false;
  const Double3 side = unit_or_zero(foot.side);
  return dot(side, normal) >= kSameSide &&
         (!foot.border || lateral_distance(p, foot, side) <= kPassed * range.beyond);
}

MergeBlend::Value MergeBlend::at(const Double3& p, double more) const {
  Value value;
  double left = 1.0;
  bool any = false;
  for (const MergeSheet* sheet : sheets_) {
    if (!sheet || !(left > 0.0)) continue;
    const MergeSheet::Sample sample = sheet->at(p, range_.apart + more, range_.beyond);
    const double share = left * sample.cover;
    left -= share;
    if (!(share > 0.0)) continue;
    const Double3 side = unit_or_zero(sample.foot.side);
    // Beyond a border the mesh goes on as it ends.
    const double distance =
        sample.foot.border ? dot(p - sample.foot.at, side) : SignedDistance::signed_distance(p, sample.foot);
    value.share += share;
    value.distance += share * distance;
    value.normal = value.normal + side * share;
    value.lateral = any ? std::min(value.lateral, sample.lateral) : sample.lateral;
    any = true;
  }
  if (value.share > 0.0) value.distance /= value.share;
  value.normal = unit_or_zero(value.normal);
  return value;
}

std::pair<std::size_t, std::uint32_t> MergeBlend::main_vertex(const Double3& p, double more) const {
  std::pair<std::size_t, std::uint32_t> best = {0, SignedDistance::kNone};
  double left = 1.0, maximum = 0.0;
  for (std::size_t s = 0; s < sheets_.size(); ++s) {
    if (!sheets_[s] || !(left > 0.0)) continue;
    const MergeSheet::Sample sample = sheets_[s]->at(p, range_.apart + more, range_.beyond);
    const double share = left * sample.cover;
    left -= share;
    if (!(share > maximum)) continue;
    maximum = share;
    best = {s, sheets_[s]->surface().nearest_corner(sample.foot)};
  }
  return best;
}

int MergeBlend::owner(const Double3& p, int own, const Double3& normal) const {
  double left = 1.0;
  int owner = own, owners = 0;
  for (std::size_t s = 0; s < sheets_.size(); ++s) {
    if (!sheets_[s] || !(left > 0.0)) continue;
    const double cover = static_cast<int>(s) == own
                             ? sheets_[s]->own_cover(p)
                             : sheets_[s]->at(p, range_.apart, range_.beyond, &normal).cover;
    const double share = left * cover;
    left -= share;
    if (!(share > 0.0)) continue;
    owner = static_cast<int>(s);
    ++owners;
  }
  return owners > 1 ? kMixed : owner;
}

}  // namespace tessera
