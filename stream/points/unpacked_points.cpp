#include "stream/points/unpacked_points.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

namespace tessera {
namespace {

constexpr PackedKind kUnpackedKind = {"TSUNPCK1", "a file of unpacked points"};

enum Content : std::uint32_t {
  kSteps = 1,  ///< positions as whole numbers of the grid, else as doubles
  kNormals = 2,
  kSensors = 4,
  kEchoes = 8,
  kColours = 16,
  kIntensities = 32,
  kWarnings = 64,  ///< no points: sentences, a line each
};

/// The last record of a file.
struct Dispositions {
  std::uint64_t points, withheld, empty, missing, surplus, other_class, other_return, outside, thinned;
};

/// Whole numbers n with n * step + shift = x, bit for bit; false where there are none.
bool to_steps(const std::vector<double>& x, double step, double shift, std::vector<std::int32_t>& steps) {
  steps.resize(x.size());
  constexpr double kMax = std::numeric_limits<std::int32_t>::max();
  const double per_step = 1.0 / step;
  bool exact = true;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double near = (x[i] - shift) * per_step;
    const bool fits = near > -kMax && near < kMax;
    const auto n = static_cast<std::int32_t>(std::nearbyint(fits ? near : 0.0));
    steps[i] = n;
    exact = exact && fits && n * step + shift == x[i];
  }
  return exact;
}

void from_steps(const std::vector<std::int32_t>& steps, double step, double shift, std::vector<double>& x) {
  x.resize(steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) x[i] = steps[i] * step + shift;
}

std::string joined_lines(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + '\n';
  return text;
}

void split(const std::vector<char>& text, std::vector<std::string>& lines) {
  for (auto at = text.begin(); at != text.end();) {
    const auto end = std::find(at, text.end(), '\n');
    lines.emplace_back(at, end);
    at = end == text.end() ? end : end + 1;
  }
}

}  // namespace

UnpackedWriter::UnpackedWriter(const std::filesystem::path& path) : out_(path, kUnpackedKind) {}

void UnpackedWriter::add(std::uint32_t file, const PositionGrid& grid, const PointChunk& chunk,
                         std::uint32_t bucket) {
  UnpackedBlock block;
  block.file = file;
  block.bucket = bucket;
  block.points = static_cast<std::uint32_t>(chunk.size());
  const bool steps = grid.known() && to_steps(chunk.x, grid.step[0], grid.shift[0], steps_[0]) &&
                     to_steps(chunk.y, grid.step[1], grid.shift[1], steps_[1]) &&
                     to_steps(chunk.z, grid.step[2], grid.shift[2], steps_[2]);
  block.content = (steps ? kSteps : 0u) | (chunk.nx.empty() ? 0u : kNormals) |
                  (chunk.sensor.empty() ? 0u : kSensors) | (chunk.echo.empty() ? 0u : kEchoes) |
                  (chunk.rgba.empty() ? 0u : kColours) | (chunk.intensity.empty() ? 0u : kIntensities);
  if (steps)
    block.geometry =
        out_.append({bytes_of(steps_[0]), bytes_of(steps_[1]), bytes_of(steps_[2]), bytes_of(chunk.nx),
                     bytes_of(chunk.ny), bytes_of(chunk.nz), bytes_of(chunk.sensor), bytes_of(chunk.echo)});
  else
    block.geometry =
        out_.append({bytes_of(chunk.x), bytes_of(chunk.y), bytes_of(chunk.z), bytes_of(chunk.nx),
                     bytes_of(chunk.ny), bytes_of(chunk.nz), bytes_of(chunk.sensor), bytes_of(chunk.echo)});
  block.colours = out_.append({bytes_of(chunk.rgba), bytes_of(chunk.intensity)});
  blocks_.push_back(block);
}

std::uint64_t UnpackedWriter::finish(const ReadCounts& counts) {
  UnpackedBlock warnings;
  warnings.content = kWarnings;
  warnings.geometry = out_.append(bytes_of(joined_lines(counts.warnings)));
  blocks_.push_back(warnings);
  const Dispositions dispositions = {counts.points,       counts.withheld, counts.empty,
                                     counts.missing,      counts.surplus,  counts.other_class,
                                     counts.other_return, counts.outside,  counts.thinned};
  return out_.finish(blocks_, std::as_bytes(std::span(&dispositions, 1)));
}

UnpackedFile::UnpackedFile(const std::filesystem::path& path)
    : file_(path, kUnpackedKind, sizeof(UnpackedBlock), sizeof(Dispositions)),
      blocks_(file_.table<UnpackedBlock>()) {
  Dispositions dispositions;
  std::memcpy(&dispositions, file_.info().data(), sizeof dispositions);
  counts_.points = dispositions.points;
  counts_.withheld = dispositions.withheld;
  counts_.empty = dispositions.empty;
  counts_.missing = dispositions.missing;
  counts_.surplus = dispositions.surplus;
  counts_.other_class = dispositions.other_class;
  counts_.other_return = dispositions.other_return;
  counts_.outside = dispositions.outside;
  counts_.thinned = dispositions.thinned;
  if (blocks_.empty() || blocks_.back().content != kWarnings) file_.damaged(0, "it ends before its warnings");
  split(file_.load<char>(blocks_.back().geometry), counts_.warnings);
  blocks_.pop_back();
}

void UnpackedFile::read(const UnpackedBlock& block, bool colours, const PositionGrid& grid,
                        PointChunk& chunk) const {
  const auto sized = [&](std::uint32_t what) {
    return (block.content & what) != 0 ? std::size_t{block.points} : 0;
  };
  chunk.nx.resize(sized(kNormals)), chunk.ny.resize(sized(kNormals)), chunk.nz.resize(sized(kNormals));
  chunk.sensor.resize(sized(kSensors));
  chunk.echo.resize(sized(kEchoes));
  chunk.rgba.resize(colours ? sized(kColours) : 0);
  chunk.intensity.resize(colours ? sized(kIntensities) : 0);
  if ((block.content & kSteps) != 0) {
    std::array<std::vector<std::int32_t>, 3> steps;
    for (auto& s : steps) s.resize(block.points);
    file_.read(block.geometry,
               {buffer_of(steps[0]), buffer_of(steps[1]), buffer_of(steps[2]), buffer_of(chunk.nx),
                buffer_of(chunk.ny), buffer_of(chunk.nz), buffer_of(chunk.sensor), buffer_of(chunk.echo)});
    from_steps(steps[0], grid.step[0], grid.shift[0], chunk.x);
    from_steps(steps[1], grid.step[1], grid.shift[1], chunk.y);
    from_steps(steps[2], grid.step[2], grid.shift[2], chunk.z);
  } else {
    chunk.x.resize(block.points), chunk.y.resize(block.points), chunk.z.resize(block.points);
    file_.read(block.geometry,
               {buffer_of(chunk.x), buffer_of(chunk.y), buffer_of(chunk.z), buffer_of(chunk.nx),
                buffer_of(chunk.ny), buffer_of(chunk.nz), buffer_of(chunk.sensor), buffer_of(chunk.echo)});
  }
  if (colours) file_.read(block.colours, {buffer_of(chunk.rgba), buffer_of(chunk.intensity)});
  file_.release(block.geometry);
}

ReadCounts read_unpacked(const std::filesystem::path& path, bool colours,
                         const std::function<PositionGrid(std::uint32_t file)>& grid_of,
                         const std::function<void(std::uint32_t file, const PointChunk&)>& sink) {
  const UnpackedFile file(path);
  PointChunk chunk;
  for (const UnpackedBlock& block : file.blocks()) {
    file.read(block, colours, grid_of(block.file), chunk);
    sink(block.file, chunk);
  }
  return file.counts();
}

}  // namespace tessera
