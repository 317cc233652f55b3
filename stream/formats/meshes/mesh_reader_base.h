/// \file mesh_reader_base.h
/// What the mesh readers share: batches for the sinks, the check of indices, polygons into triangles.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/files/read_file.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/polygon_faces.h"

namespace tessera {

using VertexSink = std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>;
using FaceSink = std::function<void(std::span<const MeshFace>)>;

/// Hands vertices on in batches. Call flush() at the end.
class VertexBatch {
 public:
  VertexBatch(const VertexSink& sink, bool colour) : sink_(sink), colour_(colour) {}
  /// `rgba` is dropped when the mesh has no colour.
  void add(const Double3& position, std::uint32_t rgba = 0) {
    positions_.push_back(position);
    if (colour_) rgba_.push_back(rgba);
    if (positions_.size() == kSize) flush();
  }
  void flush() {
    if (positions_.empty()) return;
    sink_(positions_, rgba_);
    positions_.clear();
    rgba_.clear();
  }

 private:
  static constexpr std::size_t kSize = 16384;
  const VertexSink& sink_;
  const bool colour_;
  std::vector<Double3> positions_;
  std::vector<std::uint32_t> rgba_;
};

/// Where an element lies in its file, for messages; made only when one is needed.
using Location = std::function<std::string()>;

/// Hands triangles on in batches; polygons are cut into triangles. Call flush() at the end.
class FaceBatch {
 public:
  /// \param vertices  indices are below it, else InputError (or the face is kept, if options say so)
  /// \param location     where the polygon at hand is, "file: line 12" or "file: byte 3456"
  /// \param polygons  of the reader; none in formats of triangles alone
  FaceBatch(const FaceSink& sink, const MeshReadOptions& options, std::uint64_t vertices, Location location,
            PolygonFaces* polygons = nullptr)
      : sink_(sink),
        keep_bad_(options.keep_bad_faces),
        vertices_(vertices),
        location_(std::move(location)),
        polygons_(polygons) {
    if (polygons_ != nullptr) polygons_->begin();
  }

  void triangle(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
    if (a >= vertices_ || b >= vertices_ || c >= vertices_) check(a, b, c);
    faces_.push_back({a, b, c});
    if (faces_.size() == kSize) flush();
  }
  /// A polygon, corner by corner. \pre there is a PolygonFaces
  void begin_polygon() { corners_.clear(); }
  /// \throws InputError for more than kMaxPolygonCorners
  void corner(std::uint64_t index) {
    if (corners_.size() == kLongest) too_long();
    corners_.push_back(index);
  }
  /// \throws InputError for fewer than three corners; if bad faces are kept, they become degenerate triangles
  void end_polygon() {
    if (corners_.size() == 3) {
      triangle(corners_[0], corners_[1], corners_[2]);
    } else {
      end_other();
    }
  }
  void flush() {
    if (faces_.empty()) return;
    sink_(faces_);
    faces_.clear();
  }

 private:
  static constexpr std::size_t kSize = 16384;
  static constexpr std::size_t kLongest = std::size_t{1} << 17;  ///< kMaxPolygonCorners
  void check(std::uint64_t a, std::uint64_t b, std::uint64_t c) const;
  [[noreturn]] void too_long() const;
  void end_other();
  void fan();

  const FaceSink& sink_;
  const bool keep_bad_;
  const std::uint64_t vertices_;
  const Location location_;
  PolygonFaces* polygons_;
  std::vector<MeshFace> faces_;
  std::vector<std::uint64_t> corners_;   ///< of the polygon at hand
  std::vector<std::uint64_t> distinct_;  ///< those that do not repeat the one before
  std::vector<MeshFace> triangles_;      ///< of the polygon at hand
};

/// 0..1 to 0..255; not a number is 0.
std::uint32_t colour_byte(double unit);
/// r | g<<8 | b<<16 | a<<24, each 0..255
constexpr std::uint32_t pack_rgba(std::uint32_t r, std::uint32_t g, std::uint32_t b, std::uint32_t a = 255) {
  return r | g << 8 | b << 16 | a << 24;
}
/// Takes X Y Z out of "NAME X Y Z" and whatever follows; false, and nothing taken, for any other line.
bool parse_triple(std::string_view line, std::string_view name, Double3& values);
/// Takes `tessera_shift X Y Z` out of a comment; false for any other comment.
bool parse_shift(std::string_view comment, Double3& shift);

// One factory per format. The file is known to be of that format.
std::unique_ptr<MeshReader> open_glb_mesh(ReadFile file, const MeshReadOptions& options);
std::unique_ptr<MeshReader> open_msh_mesh(ReadFile file, const MeshReadOptions& options);
std::unique_ptr<MeshReader> open_obj_mesh(ReadFile file, const MeshReadOptions& options);
std::unique_ptr<MeshReader> open_off_mesh(ReadFile file, const MeshReadOptions& options);
std::unique_ptr<MeshReader> open_ply_mesh(ReadFile file, const MeshReadOptions& options);
std::unique_ptr<MeshReader> open_stl_mesh(ReadFile file, const MeshReadOptions& options);
std::unique_ptr<MeshReader> open_threemf_mesh(ReadFile file, const MeshReadOptions& options);
std::unique_ptr<MeshReader> open_vtu_mesh(ReadFile file, const MeshReadOptions& options);

}  // namespace tessera
