/// \file memory_points.h
/// A scan in memory, for tests of the passes over points: any slicing, any order.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"
#include "stream/points/point_inputs.h"

namespace tessera::test {

struct TestPoint {
  Double3 p{};
  Float3 n{0, 0, 0};
  std::uint32_t rgba = 0;
  Echo echo = {};
};

/// Serves points [begin, end) of a shared list, `slice_points` per slice, `chunk_points` per chunk.
class MemoryPoints : public PointFile {
 public:
  MemoryPoints(std::vector<TestPoint> points, std::size_t slice_points, std::size_t chunk_points = 1000)
      : points_(std::move(points)), slice_points_(slice_points), chunk_points_(chunk_points) {
    info_.path = "memory";
    info_.format = "memory";
    info_.bytes = points_.size() * 24;
    info_.declared_points = points_.size();
    info_.attributes.normals = info_.attributes.colour = true;
    for (const TestPoint& t : points_) info_.attributes.echo |= t.echo != Echo{};
  }
  PointFileInfo& edit() { return info_; }
  const PointFileInfo& info() const override { return info_; }
  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t) const override {
    std::vector<InputSlice> out;
    for (std::size_t at = 0; at < points_.size(); at += slice_points_) {
      const std::size_t end = std::min(points_.size(), at + slice_points_);
      out.push_back({file, at, end, (end - at) * 24});
    }
    return out;
  }
  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    ReadCounts counts;
    PointChunk chunk;
    for (std::uint64_t i = slice.begin; i < slice.end; ++i) {
      const TestPoint& t = points_[i];
      chunk.x.push_back(t.p[0]), chunk.y.push_back(t.p[1]), chunk.z.push_back(t.p[2]);
      chunk.nx.push_back(t.n[0]), chunk.ny.push_back(t.n[1]), chunk.nz.push_back(t.n[2]);
      chunk.rgba.push_back(t.rgba);
      if (info_.attributes.echo) chunk.echo.push_back(t.echo);
      ++counts.points;
      if (chunk.size() == chunk_points_ || i + 1 == slice.end) {
        sink(chunk);
        chunk.clear();
      }
    }
    return counts;
  }

 private:
  std::vector<TestPoint> points_;
  std::size_t slice_points_, chunk_points_;
  PointFileInfo info_;
};

}  // namespace tessera::test
