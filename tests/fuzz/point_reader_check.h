/// \file point_reader_check.h
/// What must hold for any bytes given to a reader of points, for the fuzz targets and the mutation test.
#pragma once
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include "octree/error.h"
#include "octree/points.h"
#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera::fuzz {

using OpenPoints = std::unique_ptr<PointFile> (*)(const ReadFile&, const ReadOptions&);

/// A file in memory, with a path to open it by.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view bytes) : fd_(::memfd_create("points", MFD_CLOEXEC)) {
    if (fd_ < 0 || ::write(fd_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
      throw std::runtime_error("cannot make a file in memory");
    }
  }
  ~MemoryFile() { ::close(fd_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  int fd_;
};

/// Fates of all points and a hash of what was handed on, in order.
struct Reading {
  bool failed = false;  ///< ended with an InputError
  ReadCounts counts;
  std::uint64_t hash = 0xcbf29ce484222325u;

  template <class T>
  void mix(const std::vector<T>& values, std::size_t i) {
    if (values.empty()) return;
    const auto* bytes = reinterpret_cast<const unsigned char*>(&values[i]);
    for (std::size_t b = 0; b < sizeof(T); ++b) hash = (hash ^ bytes[b]) * 0x100000001b3u;
  }
};

inline void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

inline Reading read_all(OpenPoints open, const std::filesystem::path& path, const ReadOptions& options,
                        std::uint64_t slice_bytes) {
  Reading r;
  try {
    const auto file = open(ReadFile(path), options);
    const PointAttributes& has = file->info().attributes;
    for (const InputSlice& slice : file->slices(0, slice_bytes)) {
      std::uint64_t handed = 0;
      const ReadCounts counts = file->read(slice, [&](const PointChunk& c) {
        require(c.size() > 0 && c.size() <= options.chunk_points, "chunk size");
        require(c.y.size() == c.size() && c.z.size() == c.size(), "positions");
        require(c.nx.size() == (has.normals ? c.size() : 0), "normals");
        require(c.ny.size() == c.nx.size() && c.nz.size() == c.nx.size(), "normals");
        require(c.rgba.size() == (has.colour ? c.size() : 0), "colours");
        require(c.echo.size() == (has.echo ? c.size() : 0), "echoes");
        require(c.intensity.size() == (has.intensity_16 ? c.size() : 0), "intensities");
        require(c.sensor.size() == (has.sensor ? c.size() : 0), "sensors");
        for (std::size_t i = 0; i < c.size(); ++i) {
          r.mix(c.x, i), r.mix(c.y, i), r.mix(c.z, i);
          r.mix(c.nx, i), r.mix(c.ny, i), r.mix(c.nz, i);
          r.mix(c.rgba, i), r.mix(c.sensor, i), r.mix(c.intensity, i);
          if (has.sensor && c.sensor[i] != kNoSensor)
            require(c.sensor[i] < file->info().sensors.size(), "sensor index");
        }
        handed += c.size();
      });
      require(counts.points == handed, "points counted");
      r.counts.points += counts.points;
      r.counts.withheld += counts.withheld;
      r.counts.empty += counts.empty;
      r.counts.missing += counts.missing;
    }
  } catch (const InputError& e) {
    require(std::string_view(e.what()).find(path.string()) == 0, "the message names the file first");
    r.failed = true;
  }
  return r;
}

/// Opening and reading give points or an InputError, nothing else; slices give what one read gives.
/// Returns true if it was points. \throws std::logic_error naming what does not hold
inline bool check_reader(OpenPoints open, std::string_view bytes) {
  const MemoryFile file(bytes);
  const ReadOptions options{.columns = {}, .chunk_points = 100, .intensities = true, .grid_normals = true};
  const Reading whole = read_all(open, file.path(), options, ~std::uint64_t{0});
  const Reading parts = read_all(open, file.path(), options, bytes.size() / 5 + 1);
  require(whole.failed == parts.failed, "slices fail as one read does");
  if (whole.failed) return false;
  require(whole.counts.points == parts.counts.points, "slices give as many points as one read");
  require(whole.hash == parts.hash, "slices give the points of one read");
  require(whole.counts.withheld == parts.counts.withheld, "withheld");
  require(whole.counts.empty == parts.counts.empty, "empty");
  require(whole.counts.missing == parts.counts.missing, "missing");
  return true;
}

}  // namespace tessera::fuzz
