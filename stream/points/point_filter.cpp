#include "stream/points/point_filter.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr std::size_t kLowNoise = 7;
constexpr std::size_t kHighNoise = 18;

template <class Number>
bool parse_number(const std::string& word, Number& value) {
  const char* end = word.data() + word.size();
  const auto read = std::from_chars(word.data(), end, value);
  return !word.empty() && read.ec == std::errc() && read.ptr == end;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ",") + word;
  return text;
}

PointBox box_of(const std::vector<std::string>& words) {
  PointBox box;
  bool good = words.size() == 6;
  for (std::size_t k = 0; k < 6 && good; ++k) {
    double& value = (k < 3 ? box.min : box.max)[k % 3];
    good = parse_number(words[k], value) && std::isfinite(value);
  }
  for (std::size_t a = 0; a < 3; ++a) good = good && box.min[a] <= box.max[a];
  if (!good)
    throw UsageError("--bounds " + joined(words) +
                     ": is no box; it is X0,Y0,Z0,X1,Y1,Z1, the least coordinates first");
  return box;
}

}  // namespace

PointFilter::PointFilter(const ReconstructOptions& options)
    : requested_classes_(joined(options.classes)),
      requested_bounds_(joined(options.bounds)),
      requested_clip_(options.clip),
      returns_(options.returns) {
  for (const std::string& word : options.classes) {
    std::uint8_t value = 0;
    if (!parse_number(word, value))
      throw UsageError("--classes " + word + ": is no class; they are numbers from 0 to 255");
    classes_.set(value);
  }
  if (options.classes.empty()) classes_.set().reset(kLowNoise).reset(kHighNoise);
  if (!options.bounds.empty()) box_ = box_of(options.bounds);
  if (!options.clip_rings.empty()) {
    clip_ = ClipPolygon::from_text(options.clip_rings);
    if (!box_) box_ = PointBox{};
    for (std::size_t a = 0; a < 2; ++a) {
      box_->min[a] = std::max(box_->min[a], clip_->min()[a]);
      box_->max[a] = std::min(box_->max[a], clip_->max()[a]);
    }
  }
}

bool PointFilter::inside(double x, double y, double z) const {
  const PointBox& b = *box_;
  return x >= b.min[0] && x <= b.max[0] && y >= b.min[1] && y <= b.max[1] && z >= b.min[2] && z <= b.max[2] &&
         (!clip_ || clip_->holds(x, y));
}

const PointChunk& PointFilter::apply(const PointChunk& chunk, PointChunk& scratch, ReadCounts& counts) const {
  const bool first = returns_ == "first";
  const bool last = returns_ == "last";
  const auto other_return = [&](const Echo& e) { return (first && !e.first()) || (last && !e.last()); };
  std::size_t kept = 0;  // of the points so far; they are copied once the first one is left out
  const auto keep = [&](std::size_t i) {
    if (kept++ < i) scratch.append(chunk, i);
  };
  const auto leave_out = [&](std::size_t i, std::uint64_t& count) {
    if (kept == i && scratch.size() == 0)
      for (std::size_t k = 0; k < i; ++k) scratch.append(chunk, k);
    ++count;
  };
  scratch.clear();
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    if (!chunk.echo.empty() && !classes_[chunk.echo[i].kind])
      leave_out(i, counts.other_class);
    else if (!chunk.echo.empty() && other_return(chunk.echo[i]))
      leave_out(i, counts.other_return);
    else if (box_ && !inside(chunk.x[i], chunk.y[i], chunk.z[i]))
      leave_out(i, counts.outside);
    else
      keep(i);
  }
  return kept == chunk.size() ? chunk : scratch;
}

void PointFilter::refuse() const {
  if (!requested_classes_.empty())
    throw UsageError("--classes " + requested_classes_ +
                     ": no input tells the classes of its points, LAS files do");
  if (returns_ != "all")
    throw UsageError("--returns " + returns_ +
                     ": no input tells the return of its pulse that a point is, LAS files do");
}

std::string PointFilter::requested_region() const {
  return (requested_bounds_.empty() ? "" : ", --bounds " + requested_bounds_) +
         (requested_clip_.empty() ? "" : ", --clip " + requested_clip_);
}

void PointFilter::require_wanted(std::uint64_t read, std::uint64_t left_out) const {
  if (read == 0 && box_) throw EmptyError("no point lies within" + requested_region().substr(1));
  if (read == 0 || left_out < read) return;
  throw EmptyError(
      "none of the " + std::to_string(read) + " points is wanted: " +
      (requested_classes_.empty() ? "all but noise (--classes)" : "--classes " + requested_classes_) +
      ", --returns " + returns_ + requested_region());
}

}  // namespace tessera
