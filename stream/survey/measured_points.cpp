#include "stream/survey/measured_points.h"

#include <limits>

#include "octree/error.h"
#include "stream/points/file_notices.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/lowest_heights.h"

namespace tessera {
namespace {

constexpr std::uint64_t kSliceBytes = std::uint64_t{4} << 20;
constexpr std::size_t kChunkPoints = 16384;
constexpr std::uint64_t kTextPointBytes = 24;  ///< about; formats whose headers tell no number of points
constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

/// The system of scans so far, and that of one more. \throws InputError
void join_crs(const std::filesystem::path& file, const Crs& its, Crs& all) {
  if (its.geographic)
    throw InputError(file.string() + ": its coordinates are degrees, " + its.name +
                     "; lengths are measured: project the scan first, to its UTM zone for example");
  if (its.known() && all.known() && !may_be_same(its, all))
    throw InputError(file.string() + ": is in " + its.name + ", a scan before it in " + all.name +
                     "; scans are worked on together in one system");
  if (!all.known()) all = its;
}

class MeasuredScans : public MeasuredPoints {
 public:
  MeasuredScans(const std::vector<std::filesystem::path>& paths, const std::vector<std::string>& columns,
                std::size_t window)
      : window_(window) {
    ReadOptions options;
    options.columns = columns;
    options.chunk_points = kChunkPoints;
    options.intensities = true;
    for (const std::filesystem::path& path : paths) {
      files_.push_back(open_point_file(path, options));
      const PointFileInfo& info = files_.back()->info();
      join_crs(path, info.crs, crs);
      points_about +=
          info.declared_points > 0 ? info.declared_points : info.planned_bytes() / kTextPointBytes;
      attributes.normals = attributes.normals || info.attributes.normals;
      attributes.colour = attributes.colour || info.attributes.colour;
      attributes.intensity_16 = attributes.intensity_16 || info.attributes.intensity_16;
      attributes.echo = attributes.echo || info.attributes.echo;
    }
  }

  void read(const std::function<void(const PointChunk&)>& sink) override {
    FileNotices notices;
    left_out = 0;
    for (const std::unique_ptr<PointFile>& file : files_) {
      const ReadCounts total = read_file(*file, sink);
      notices.add(file->info());
      for (const std::string& w : total.warnings) notices.add(file->info().path, w);
      left_out += total.withheld + total.empty + missing_points(file->info(), total);
    }
    notices_ = notices.lines();
  }
  std::vector<std::string> notices() const override { return notices_; }

 private:
  /// Slices are read side by side and handed on in order.
  ReadCounts read_file(const PointFile& file, const std::function<void(const PointChunk&)>& sink) const {
    const std::vector<InputSlice> slices = file.slices(0, kSliceBytes);
    ReadCounts total;
    const auto add = [&](const ReadCounts& counts) {
      total.points += counts.points, total.withheld += counts.withheld, total.empty += counts.empty;
      total.missing += counts.missing;
      total.warnings.insert(total.warnings.end(), counts.warnings.begin(), counts.warnings.end());
    };
    if (slices.size() == 1) {  // may be of any size: nothing of it waits in memory
      add(file.read(slices.front(), [&](const PointChunk& chunk) {
        throw_if_stopped();
        sink(chunk);
      }));
      return total;
    }
    std::vector<std::vector<PointChunk>> ring(window_);
    std::vector<ReadCounts> counts(window_);
    parallel_in_order(
        slices.size(), window_,
        [&](std::size_t slice) {
          std::vector<PointChunk>& chunks = ring[slice % window_];
          chunks.clear();
          counts[slice % window_] = file.read(slices[slice], [&](const PointChunk& chunk) {
            throw_if_stopped();
            chunks.push_back(chunk);
          });
        },
        [&](std::size_t slice) {
          for (const PointChunk& chunk : ring[slice % window_]) sink(chunk);
          add(counts[slice % window_]);
        });
    return total;
  }

  std::vector<std::unique_ptr<PointFile>> files_;
  std::size_t window_;
  std::vector<std::string> notices_;
};

class MeasuredRecords : public MeasuredPoints {
 public:
  explicit MeasuredRecords(std::span<const LasRecords> scans) : scans_(scans) {
    for (const LasRecords& scan : scans) join_crs(scan.file().path(), scan.header().info.crs, crs);
  }
  void read(const std::function<void(const PointChunk&)>& sink) override {
    PointChunk chunk;
    for (const LasRecords& scan : scans_)
      scan.read(
          kSlots, [](LasBatch&) {},
          [&](LasBatch& batch) {
            throw_if_stopped();
            chunk.clear();
            for (std::size_t i = 0; i < batch.count; ++i) {
              const Double3 p = measured_position(scan, batch.records.data() + i * scan.record_bytes());
              chunk.x.push_back(p[0]), chunk.y.push_back(p[1]), chunk.z.push_back(p[2]);
            }
            sink(chunk);
          });
  }

 private:
  static constexpr std::size_t kSlots = 2;
  std::span<const LasRecords> scans_;
};

class MeasuredVertices : public MeasuredPoints {
 public:
  explicit MeasuredVertices(MeshReader& mesh) : mesh_(mesh) {
    shift = mesh.header().shift;
    attributes.colour = mesh.header().colour;
  }
  void read(const std::function<void(const PointChunk&)>& sink) override {
    PointChunk chunk;
    mesh_.read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
      throw_if_stopped();
      for (std::size_t begin = 0; begin < positions.size(); begin += kChunkPoints) {
        const std::size_t end = std::min(positions.size(), begin + kChunkPoints);
        chunk.clear();
        for (std::size_t i = begin; i < end; ++i) {
          const Double3& p = positions[i];
          chunk.x.push_back(p[0]), chunk.y.push_back(p[1]), chunk.z.push_back(p[2]);
          if (!rgba.empty()) chunk.rgba.push_back(rgba[i]);
        }
        sink(chunk);
      }
    });
  }
  std::vector<std::string> notices() const override { return mesh_.warnings(); }

 private:
  MeshReader& mesh_;
};

}  // namespace

Double3 measured_position(const LasRecords& scan, const char* record) {
  constexpr unsigned kWithheld = 0x80, kWideWithheld = 0x04;
  const unsigned flags = static_cast<std::uint8_t>(record[LasRecordField::kFlags]);
  if ((flags & (scan.wide() ? kWideWithheld : kWithheld)) != 0) return {kNoNumber, kNoNumber, kNoNumber};
  return record_position(scan, record);
}

std::unique_ptr<MeasuredPoints> open_measured_scans(const std::vector<std::filesystem::path>& files,
                                                    const std::vector<std::string>& columns,
                                                    std::size_t window) {
  return std::make_unique<MeasuredScans>(files, columns, window);
}

std::unique_ptr<MeasuredPoints> open_measured_records(std::span<const LasRecords> scans) {
  return std::make_unique<MeasuredRecords>(scans);
}

std::unique_ptr<MeasuredPoints> open_measured_vertices(MeshReader& mesh) {
  return std::make_unique<MeasuredVertices>(mesh);
}

}  // namespace tessera
