/// \file mesh_writer_base.h
/// What every mesh writer checks before a format sees the data: order of calls, counts, indices; and what rounding to
/// floats does to it.
#pragma once
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "stream/files/output_file.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/rounding_check.h"

namespace tessera {

class MeshWriterBase : public MeshWriter {
 public:
  void vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) final;
  void faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) final;
  void finish() final;
  std::uint64_t bytes_written() const final { return file_.size(); }
  MeshRounding rounding() const final { return rounding_; }

 protected:
  /// \param floats  positions are stored as floats, by local()
  /// \param joins   the format has no vertices: those at one position are one when the file is read
  MeshWriterBase(const std::filesystem::path& path, const MeshHeader& header, bool floats,
                 bool joins = false);
  /// What the file holds of a position.
  Float3 local(const Double3& position) const {
    Float3 p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = static_cast<float>(position[k] - header_.origin[k]);
    return p;
  }
  /// How far along each axis what the file holds lies from the positions at most; NaN is passed over.
  Double3 moved_by_rounding(std::span<const Double3> positions) const;
  /// The first of the faces that names a vertex beyond those of the header, or their number.
  std::size_t find_beyond(std::span<const MeshFace> faces) const;
  // What vertices() and faces() do before they write. \param moved, beyond  as above
  void accept_vertices(std::span<const Double3> positions, std::size_t colours, const Double3& moved);
  void accept_faces(std::span<const MeshFace> faces, std::size_t flags, std::size_t beyond);

  virtual void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) = 0;
  virtual void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) = 0;
  virtual void write_end() {}  ///< all counts are right; the file is synced and renamed afterwards

  const MeshHeader header_;
  OutputFile file_;
  MeshRounding rounding_;

 private:
  /// Doubles become floats. Who announced floats, and is not to be checked, loses nothing.
  bool may_lose() const { return floats_ && (header_.double_positions || header_.check_rounding); }
  void finish_rounding();

  const bool floats_;
  const bool joins_;
  std::uint64_t vertices_ = 0;
  std::uint64_t faces_ = 0;
  Double3 moved_ = {0, 0, 0};  ///< farthest along each axis
  std::unique_ptr<RoundingCheck> check_;
};

/// What a text of decimals holds of a coordinate: of floats all digits of the float, not the fewest that tell it from other
/// floats, since readers take decimals as doubles and what was proven is proven of the floats.
inline double decimal_value(const MeshHeader& header, double value) {
  return header.double_positions ? value : static_cast<double>(static_cast<float>(value));
}

/// "NAME X Y Z", exact decimal doubles: how an origin and a shift stand in a file.
std::string triple_line(const char* name, const Double3& values);

/// Provenance lines of a header, one string each without line breaks; the shift, when not zero, comes last as
/// `tessera_shift X Y Z` (what was subtracted from the positions; exact decimal doubles).
std::vector<std::string> comment_lines(const MeshHeader& header);

// One factory per format; each throws UsageError, naming a format that can hold the mesh, before a file is
// made.
std::unique_ptr<MeshWriter> create_glb_mesh(const std::filesystem::path& path, const MeshHeader& header);
std::unique_ptr<MeshWriter> create_msh_mesh(const std::filesystem::path& path, const MeshHeader& header);
std::unique_ptr<MeshWriter> create_obj_mesh(const std::filesystem::path& path, const MeshHeader& header);
std::unique_ptr<MeshWriter> create_ply_mesh(const std::filesystem::path& path, const MeshHeader& header);
std::unique_ptr<MeshWriter> create_stl_mesh(const std::filesystem::path& path, const MeshHeader& header);
std::unique_ptr<MeshWriter> create_threemf_mesh(const std::filesystem::path& path, const MeshHeader& header);
std::unique_ptr<MeshWriter> create_vtu_mesh(const std::filesystem::path& path, const MeshHeader& header);

}  // namespace tessera
