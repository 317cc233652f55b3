#include "stream/survey/measured_inputs.h"

#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/commands/convert_mesh.h"
#include "stream/files/file_extension.h"
#include "stream/formats/points/las_copy.h"
#include "stream/import/crs_sidecar.h"
#include "stream/render/render_scene.h"
#include "stream/render/value_picture.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::uint64_t kWeldShare = 4;  ///< welding gets a part in so many of the memory

bool is_las_name(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".las" || extension == ".laz";
}

bool is_finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Leaves out what is not kept. \pre one flag for each point
void keep_points(PointChunk& chunk, const std::vector<char>& kept) {
  const auto keep = [&](auto& values) {
    if (values.empty()) return;
    std::size_t left = 0;
    for (std::size_t i = 0; i < kept.size(); ++i)
      if (kept[i] != 0) values[left++] = values[i];
    values.resize(left);
  };
  keep(chunk.x), keep(chunk.y), keep(chunk.z), keep(chunk.nx), keep(chunk.ny), keep(chunk.nz);
  keep(chunk.rgba), keep(chunk.intensity), keep(chunk.echo), keep(chunk.sensor);
}

}  // namespace

MeasuredInputs::MeasuredInputs(std::vector<std::filesystem::path> inputs,
                               std::vector<std::filesystem::path> outputs, MeasuredInputOptions options)
    : inputs_(std::move(inputs)), outputs_(std::move(outputs)), options_(std::move(options)) {
  if (measures_vertices(inputs_.front())) {
    if (inputs_.size() > 1)
      throw UsageError(inputs_.front().string() + " is a mesh: meshes are measured one at a time");
    mesh_ = open_mesh_file(inputs_.front(), {.temp = options_.scratch});
    if (!mesh_->shared_vertices())
      welded_ = std::make_unique<WeldedMesh>(
          *mesh_, WeldOptions{options_.memory_bytes / kWeldShare, options_.scratch, throw_if_stopped});
    points_ = open_measured_vertices(welded_ ? *welded_ : *mesh_);
    points_->crs = crs_of_wkt(crs_of_mesh(inputs_.front()));
  } else if (copies_records()) {
    records_.reserve(inputs_.size());
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      records_.emplace_back(inputs_[i]);
      const LasCopy probe(records_.back(), outputs_[i], 1, options_.scalars);
    }
    points_ = open_measured_records(records_);
  } else {
    points_ = open_measured_scans(inputs_, options_.columns, slice_window());
  }
}

bool MeasuredInputs::copies_records() const {
  return outputs_.size() == inputs_.size() && !options_.anew &&
         std::all_of(inputs_.begin(), inputs_.end(), is_las_name) &&
         std::all_of(outputs_.begin(), outputs_.end(), is_las_name);
}

/// Slices are read while what measures holds little, beside points on their way, a file and what sorts.
std::size_t MeasuredInputs::slice_window() const {
  const std::uint64_t free = MemoryBudget(options_.memory_bytes, resident_bytes()).capacity() / 2;
  return std::clamp<std::size_t>(static_cast<std::size_t>(free / kSliceMemory), 1,
                                 static_cast<std::size_t>(options_.threads) + 1);
}

void MeasuredInputs::read(const std::function<void(const Double3&)>& sink) {
  points_->read([&](const PointChunk& chunk) {
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
      sink(p);
      ++all_;
      if (!is_finite(p)) continue;
      for (std::size_t a = 0; a < 3; ++a) {
        min_[a] = finite_ == 0 ? p[a] : std::min(min_[a], p[a]);
        max_[a] = finite_ == 0 ? p[a] : std::max(max_[a], p[a]);
        exact_in_float_ = exact_in_float_ && static_cast<double>(static_cast<float>(p[a])) == p[a];
      }
      ++finite_;
    }
  });
  // Records that are marked withheld come without a position.
  left_out_ = points_->left_out + all_ - finite_;
  if (finite_ == 0)
    throw EmptyError(inputs_.front().string() + (inputs_.size() > 1 ? " and the others" : "") +
                     ": there is no point to measure");
}

void MeasuredInputs::count_given() {
  if (given_ == all_) throw InputError("an input changed while it was read; run the command again");
  ++given_;
}

void MeasuredInputs::write(const std::function<bool(const Double3&, Found&)>& measured) {
  if (!records_.empty()) {
    for (std::size_t i = 0; i < records_.size(); ++i) write_records(i, measured);
  } else {
    if (!outputs_.empty()) file_ = create_file(outputs_.front());
    const std::size_t count = options_.scalars.size();
    std::vector<double> values, one(count);
    std::vector<char> kept;
    PointChunk changed;
    points_->read([&](const PointChunk& chunk) {
      values.clear(), kept.clear();
      if (options_.anew) changed = chunk;
      if (options_.recoloured) changed.rgba.resize(chunk.size());
      for (std::size_t i = 0; i < chunk.size(); ++i) {
        count_given();
        Found found = {one, 0};
        kept.push_back(measured({chunk.x[i], chunk.y[i], chunk.z[i]}, found) ? 1 : 0);
        if (kept.back() != 0) values.insert(values.end(), one.begin(), one.end());
        if (options_.recoloured) changed.rgba[i] = found.rgba;
      }
      if (!file_) return;
      if (options_.anew) keep_points(changed, kept);
      file_->add(options_.anew ? changed : chunk, values);
    });
  }
  if (given_ != all_) throw InputError("an input changed while it was read; run the command again");
}

void MeasuredInputs::write_records(std::size_t file,
                                   const std::function<bool(const Double3&, Found&)>& measured) {
  const LasRecords& scan = records_[file];
  LasCopy copy(scan, outputs_[file], std::min(options_.threads, 2), options_.scalars);
  const std::size_t old_bytes = scan.record_bytes(), new_bytes = copy.record_bytes();
  std::vector<double> values(options_.scalars.size());
  std::vector<char> longer;
  constexpr std::size_t kSlots = 2;
  scan.read(
      kSlots, [](LasBatch&) {},
      [&](LasBatch& batch) {
        longer.resize(batch.count * new_bytes);
        for (std::size_t i = 0; i < batch.count; ++i) {
          const char* record = batch.records.data() + i * old_bytes;
          count_given();
          Found found = {values, 0};
          measured(measured_position(scan, record), found);
          char* to = longer.data() + i * new_bytes;
          std::copy_n(record, old_bytes, to);
          std::copy_n(reinterpret_cast<const char*>(values.data()), new_bytes - old_bytes, to + old_bytes);
        }
        copy.append(longer.data(), batch.count);
      });
  bytes_ += copy.finish();
}

std::uint64_t MeasuredInputs::finish() {
  if (file_) bytes_ += file_->finish();
  return bytes_;
}

std::unique_ptr<ScalarFile> MeasuredInputs::create_file(const std::filesystem::path& output) {
  const std::string extension = lower_extension(output);
  if (extension == ".csv") return create_scalar_csv(output, options_.scalars);
  const bool colour = points_->attributes.colour || options_.recoloured;
  MeshReader* const mesh = welded_ ? welded_.get() : mesh_.get();
  if (mesh != nullptr && extension == ".ply")
    return create_scalar_mesh(output, *mesh, colour, options_.scalars);
  PointFileHeader header;
  header.attributes = points_->attributes;
  header.attributes.colour = colour;
  header.double_positions = !exact_in_float_;
  header.scalars = options_.scalars;
  if (is_las_name(output)) {
    header.attributes.normals = false;
    header.las_scale = fitting_las_scale(min_, max_);
    for (std::size_t a = 0; a < 3; ++a) header.las_offset[a] = std::floor(min_[a]);
  }
  return create_scalar_points(output, header);
}

void MeasuredInputs::require_output(const std::filesystem::path& output, const std::string& what) {
  const std::string extension = lower_extension(output);
  if (extension != ".las" && extension != ".laz" && extension != ".ply" && extension != ".csv")
    throw UsageError(output.string() + ": unknown extension '" + extension + "' for " + what +
                     "; use .las, .laz, .ply or .csv");
}

std::uint32_t measured_colour(double distance, double scale) {
  return std::isnan(distance) ? kNoValueColour : deviation_colour(distance, scale, true);
}

bool measures_vertices(const std::filesystem::path& input) {
  return converts_as_mesh(input, "mesh.ply");
}

}  // namespace tessera
