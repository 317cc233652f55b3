#include "stream/points/echo_filter.h"

#include <charconv>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr std::size_t kLowNoise = 7;
constexpr std::size_t kHighNoise = 18;

std::uint8_t class_of(const std::string& word) {
  std::uint8_t value = 0;
  const char* end = word.data() + word.size();
  const auto read = std::from_chars(word.data(), end, value);
  if (word.empty() || read.ec != std::errc() || read.ptr != end)
    throw UsageError("--classes " + word + ": is no class; they are numbers from 0 to 255");
  return value;
}

/// Appends element i of every array that is there.
void append_point(const PointChunk& from, std::size_t i, PointChunk& to) {
  const auto add = [i](const auto& a, auto& b) {
    if (!a.empty()) b.push_back(a[i]);
  };
  add(from.x, to.x), add(from.y, to.y), add(from.z, to.z);
  add(from.nx, to.nx), add(from.ny, to.ny), add(from.nz, to.nz);
  add(from.rgba, to.rgba), add(from.sensor, to.sensor), add(from.echo, to.echo);
}

}  // namespace

EchoFilter::EchoFilter(const std::vector<std::string>& classes, const std::string& returns)
    : returns_(returns) {
  for (const std::string& word : classes) {
    classes_.set(class_of(word));
    asked_classes_ += (asked_classes_.empty() ? "" : ",") + word;
  }
  if (classes.empty()) classes_.set().reset(kLowNoise).reset(kHighNoise);
}

const PointChunk& EchoFilter::apply(const PointChunk& chunk, PointChunk& scratch, ReadCounts& counts) const {
  const bool first = returns_ == "first";
  const bool last = returns_ == "last";
  const auto other_return = [&](const Echo& e) { return (first && !e.first()) || (last && !e.last()); };
  std::size_t wanted = 0;
  for (const Echo& e : chunk.echo) wanted += classes_[e.kind] && !other_return(e) ? 1 : 0;
  if (wanted == chunk.echo.size()) return chunk;
  scratch.clear();
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    const Echo& e = chunk.echo[i];
    if (!classes_[e.kind])
      ++counts.other_class;
    else if (other_return(e))
      ++counts.other_return;
    else
      append_point(chunk, i, scratch);
  }
  return scratch;
}

void EchoFilter::refuse() const {
  if (!asked_classes_.empty())
    throw UsageError("--classes " + asked_classes_ +
                     ": no input tells the classes of its points, LAS files do");
  if (returns_ != "all")
    throw UsageError("--returns " + returns_ +
                     ": no input tells the return of its pulse that a point is, LAS files do");
}

void EchoFilter::require_wanted(std::uint64_t read, std::uint64_t left_out) const {
  if (read == 0 || left_out < read) return;
  throw EmptyError("none of the " + std::to_string(read) + " points is wanted: " +
                   (asked_classes_.empty() ? "all but noise (--classes)" : "--classes " + asked_classes_) +
                   ", --returns " + returns_);
}

}  // namespace tessera
