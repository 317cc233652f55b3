#include "stream/points/projected_inputs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "octree/error.h"
#include "stream/formats/points/projection.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
/// Sampled points of a file: of so many slices, so many points.
constexpr std::size_t kSampledSlices = 64;
constexpr std::size_t kSlicePoints = 256;
constexpr std::size_t kInspectedFiles = 16;
/// A zone is 6 degrees wide; beyond twice as much scales are off by more than half a percent.
constexpr double kWidest_deg = 12.0;

struct Box2 {
  Double3 min = {kUnbounded, kUnbounded, kUnbounded}, max = {-kUnbounded, -kUnbounded, -kUnbounded};
  void add(const Double3& p) {
    for (std::size_t a = 0; a < 3; ++a) min[a] = std::min(min[a], p[a]), max[a] = std::max(max[a], p[a]);
  }
  bool empty() const { return !(min[0] <= max[0]); }
};

bool within_degrees(const Box2& box) {
  return !box.empty() && box.min[0] >= -180.0 && box.max[0] <= 180.0 && box.min[1] >= -90.0 &&
         box.max[1] <= 90.0;
}

/// Points spread over a file, the first of some slices; those of the first slice alone where they cannot be degrees.
std::vector<Double3> sampled_points(const PointFile& file, const std::vector<std::string>& columns) {
  struct Enough {};
  std::vector<Double3> points;
  const std::uint64_t target = std::max<std::uint64_t>(file.info().planned_bytes() / kSampledSlices, 4096);
  const std::vector<InputSlice> slices = file.slices(0, target);
  const std::size_t n = std::min(kSampledSlices, slices.size());
  // Small chunks, so that a few points of a slice can be had; what must be read in order is not opened again.
  ReadOptions few;
  few.chunk_points = kSlicePoints;
  few.columns = columns;
  few.colours = false;
  const auto again = n > 1 ? open_point_file(file.info().path, few) : nullptr;
  const PointFile& source = again ? *again : file;
  const std::size_t maximum = n > 1 ? kSlicePoints : kSampledSlices * kSlicePoints;
  Box2 box;
  for (std::size_t s = 0; s < n; ++s) {
    std::size_t taken = 0;
    try {
      source.read(slices[s * slices.size() / n], [&](const PointChunk& c) {
        for (std::size_t i = 0; i < c.size() && taken < maximum; ++i) {
          if (!std::isfinite(c.x[i]) || !std::isfinite(c.y[i]) || !std::isfinite(c.z[i])) continue;
          points.push_back({c.x[i], c.y[i], c.z[i]});
          box.add(points.back());
          ++taken;
        }
        if (taken == maximum) throw Enough();
      });
    } catch (const Enough&) {
      taken = maximum;  // the rest of the slice is not needed
    }
    if (!within_degrees(box)) break;
  }
  return points;
}

Box2 box_of_file(const PointFile& file, const std::vector<std::string>& columns) {
  Box2 box;
  if (file.info().has_bounds) {
    box.min = file.info().declared_min;
    box.max = file.info().declared_max;
    return box;
  }
  for (const Double3& p : sampled_points(file, columns)) box.add(p);
  return box;
}

/// What cannot be degrees by its bounds is not looked at.
bool may_be_degrees(const PointFile& file) {
  if (!file.info().has_bounds) return true;
  Box2 box;
  box.min = file.info().declared_min;
  box.max = file.info().declared_max;
  return within_degrees(box);
}

/// A file whose points are handed on in another system, or that is said to be in another than it says.
class ProjectedFile final : public PointFile {
 public:
  /// \param to  nothing: points stay as they are
  ProjectedFile(std::unique_ptr<PointFile> file, const Crs& from, const std::optional<Crs>& to)
      : file_(std::move(file)), info_(file_->info()), from_(from), to_(to) {
    info_.crs = to_ ? *to_ : from_;
    if (!to_) return;
    info_.packed = true;  // projected once
    info_.grid = {};
    info_.has_bounds = false;
    const Projection projection(from_, *to_);
    for (Double3& s : info_.sensors) {
      std::vector<double> x = {s[0]}, y = {s[1]}, z = {s[2]};
      projection.apply(x, y, z);
      s = {x[0], y[0], z[0]};
    }
  }

  const PointFileInfo& info() const override { return info_; }
  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    return file_->slices(file, target_bytes);
  }
  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    if (!to_) return file_->read(slice, sink);
    const Projection projection(from_, *to_);  // one a thread
    PointChunk projected;
    return file_->read(slice, [&](const PointChunk& chunk) {
      projected = chunk;
      projection.apply(projected.x, projected.y, projected.z);
      sink(projected);
    });
  }

 private:
  std::unique_ptr<PointFile> file_;
  PointFileInfo info_;
  Crs from_;
  std::optional<Crs> to_;
};

std::string label(const Crs& crs) {
  const std::string code = "EPSG:" + std::to_string(crs.horizontal);
  return crs.horizontal == 0 || crs.name.find(code) != std::string::npos ? crs.name
                                                                         : crs.name + " (" + code + ")";
}

std::string advice(const Crs& geographic, const Box2& box) {
  std::string zone;
  try {
    if (!box.empty())
      zone = " (here " +
             label(utm_zone(geographic, (box.min[0] + box.max[0]) / 2, (box.min[1] + box.max[1]) / 2)) + ")";
  } catch (const std::runtime_error&) {
    zone = "";  // no PROJ, or no zone: the sentence stands without
  }
  return "a surface needs lengths: --project auto projects it to its UTM zone" + zone +
         ", --project EPSG:n to a system of your choice";
}

class Plane {
 public:
  Plane(std::vector<std::unique_ptr<PointFile>> files, const CrsOptions& options, bool inspect,
        std::vector<std::string>& notes)
      : files_(std::move(files)), options_(options), notes_(notes) {
    std::optional<Crs> given;
    if (!options.crs.empty()) given = user_crs(options.crs, "--crs");
    for (const auto& f : files_) from_.push_back(given ? *given : f->info().crs);
    if (given) tell_overruled(*given);
    if (options.project == "off") return;
    if (options.project.empty()) {
      refuse_declared();
      if (inspect) refuse_by_look();
      return;
    }
    choose();
  }

  std::vector<std::unique_ptr<PointFile>> take() {
    for (std::size_t i = 0; i < files_.size(); ++i) {
      const bool away = to_ && !is_same_crs(from_[i], *to_);
      if (away || !options_.crs.empty())
        files_[i] = std::make_unique<ProjectedFile>(std::move(files_[i]), from_[i],
                                                    away ? to_ : std::optional<Crs>());
    }
    return std::move(files_);
  }

 private:
  void tell_overruled(const Crs& given) {
    std::size_t others = 0;
    for (const auto& f : files_)
      others += f->info().crs.known() && !is_same_crs(f->info().crs, given) ? 1 : 0;
    if (others > 0)
      notes_.push_back(std::to_string(others) + (others == 1 ? " file names" : " files name") +
                       " another coordinate system than " + label(given) + ", which --crs overrules");
  }

  [[noreturn]] void refuse(std::size_t i, const std::string& what, const Crs& crs) const {
    throw InputError(files_[i]->info().path.string() + ": " + what + "; " +
                     advice(crs, box_of_file(*files_[i], options_.columns)) +
                     ", --project off takes coordinates as they are");
  }

  void refuse_declared() const {
    for (std::size_t i = 0; i < files_.size(); ++i)
      if (from_[i].geographic) refuse(i, "its coordinates are degrees, " + label(from_[i]), from_[i]);
  }

  /// Whether a file without a system is in degrees by its look.
  bool looks(std::size_t i) const {
    return !from_[i].known() && may_be_degrees(*files_[i]) &&
           look_like_degrees(sampled_points(*files_[i], options_.columns));
  }

  void refuse_by_look() const {
    const std::size_t step = std::max<std::size_t>(1, files_.size() / kInspectedFiles);
    for (std::size_t i = 0; i < files_.size(); i += step)
      if (looks(i))
        refuse(i,
               "it names no coordinate system, and its coordinates look like degrees of longitude and "
               "latitude with "
               "heights in metres",
               longitude_and_latitude());
  }

  void choose() {
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (from_[i].known()) continue;
      if (!within_degrees(box_of_file(*files_[i], options_.columns)))
        throw InputError(
            files_[i]->info().path.string() +
            ": names no coordinate system, so it cannot be projected; name it with --crs EPSG:n");
      from_[i] = longitude_and_latitude();
      from_[i].name = "longitude and latitude (WGS 84, as nothing else is named)";
    }
    to_ = options_.project == "auto" ? automatic() : user_crs(options_.project, "--project");
    if (!to_) return;
    if (to_->geographic)
      throw UsageError("--project " + options_.project + ": has degrees too; name a projected system");
    std::map<std::string, std::size_t> sources;
    for (const Crs& s : from_)
      if (!is_same_crs(s, *to_)) ++sources[label(s)];
    for (const auto& [name, n] : sources)
      notes_.push_back(std::to_string(n) + (n == 1 ? " file" : " files") + " in " + name +
                       (n == 1 ? " is" : " are") + " projected to " + label(*to_) +
                       "; heights keep their datum");
  }

  /// Nothing where no file is in degrees.
  std::optional<Crs> automatic() const {
    Box2 all;
    const Crs* degrees = nullptr;
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (!from_[i].geographic) continue;
      // The least text, so that the order of the files does not matter.
      if (degrees == nullptr || from_[i].name < degrees->name) degrees = &from_[i];
      const Box2 box = box_of_file(*files_[i], options_.columns);
      if (box.empty()) continue;
      all.add(box.min);
      all.add(box.max);
    }
    if (degrees == nullptr) return std::nullopt;
    if (all.empty())
      throw InputError("--project auto: the scan in degrees has no point to tell its UTM zone by");
    if (all.max[0] - all.min[0] > kWidest_deg)
      throw InputError(
          "--project auto: the scan is " + number_text(all.max[0] - all.min[0]) +
          " degrees of longitude wide, too wide for one UTM zone; name a system with --project EPSG:n, or "
          "reconstruct in parts");
    return utm_zone(*degrees, (all.min[0] + all.max[0]) / 2, (all.min[1] + all.max[1]) / 2);
  }

  std::vector<std::unique_ptr<PointFile>> files_;
  CrsOptions options_;
  std::vector<std::string>& notes_;
  std::vector<Crs> from_;
  std::optional<Crs> to_;
};

}  // namespace

bool look_like_degrees(const std::vector<Double3>& p) {
  constexpr std::size_t kMin = 64;
  constexpr double kHigher = 50.0;
  constexpr int kCells = 16;
  Box2 box;
  for (const Double3& q : p) box.add(q);
  if (p.size() < kMin || !within_degrees(box)) return false;
  const double wide = std::max(box.max[0] - box.min[0], box.max[1] - box.min[1]);
  const double high = box.max[2] - box.min[2];
  if (!(wide > 0.0) || high < kHigher * wide) return false;
  // A pole or a wall seen end on is as high at every place; ground is not. Half of the points may be trees and walls.
  std::map<int, Box2> cells;
  for (const Double3& q : p) {
    const auto cell = [&](std::size_t a) {
      return std::min(kCells - 1, static_cast<int>((q[a] - box.min[a]) / wide * kCells));
    };
    cells[cell(0) * kCells + cell(1)].add(q);
  }
  std::vector<double> heights;
  for (const auto& [at, c] : cells) heights.push_back(c.max[2] - c.min[2]);
  std::nth_element(heights.begin(), heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2),
                   heights.end());
  return heights.size() >= kCells && heights[heights.size() / 2] < 0.7 * high;
}

std::vector<std::unique_ptr<PointFile>> in_one_plane(std::vector<std::unique_ptr<PointFile>> files,
                                                     const CrsOptions& options, bool inspect,
                                                     std::vector<std::string>& notes) {
  return Plane(std::move(files), options, inspect, notes).take();
}

}  // namespace tessera
