/// \file convert_mesh.h
/// A mesh from one format into another, streamed.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/tin_writer.h"

namespace tessera {

/// What concerns outputs for CAD programs alone (.xml, .dxf).
struct ConvertTinOptions {
  Crs crs;
  TinUnit unit = TinUnit::kMetre;
  TinOverhangs overhangs = TinOverhangs::kRefuse;
  double breaklines = 0.0;      ///< degrees (break_lines.h); 0 = none
  std::uint64_t max_faces = 0;  ///< a mesh with more is refused; 0 = any
};

struct ConvertMeshOptions {
  bool floats = false;  ///< positions as floats even where the source has doubles or text
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  ///< for merging the vertices of triangle soups
  std::filesystem::path temp;                           ///< empty = beside the output
  std::function<void()> check_stop;                     ///< may throw StoppedError; may be empty
  ConvertTinOptions tin;
  bool groups = false;  ///< OBJ: faces by component, each a group of its own (face_groups.h)
  double unit = 0.0;    ///< 3MF: of the positions, metres; 0 = that of the input, if it tells one
};

struct ConvertMeshReport {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
  std::uint64_t bytes = 0;     ///< of the output
  bool welded = false;         ///< vertices were merged by exact position
  Double3 origin = {0, 0, 0};  ///< of positions in formats of floats; told beside an STL (mesh_precision.h)
  MeshRounding rounding;       ///< what the format's floats did to the mesh
  TinCounts tin;               ///< of LandXML
  std::uint64_t breaklines = 0, break_edges = 0;  ///< lines, and edges of the mesh in them
  std::uint64_t groups = 0;                       ///< components, where they were asked for
  double unit = 0.0;                              ///< metres; 0 = not known
  std::vector<std::string> notes;                 ///< what the input gets wrong and was read past
};

/// True when converting `input` to `output` means its faces: an output that only meshes have (.obj, .stl,
/// .glb, .3mf, .vtu, .msh, .xml, .dxf), or .ply and an input with faces. Says nothing about whether the input can be read.
bool converts_as_mesh(const std::filesystem::path& input, const std::filesystem::path& output);

/// Polygons become triangles; colours, comments and the shift are kept where the output has a place for them.
/// Formats without shared vertices (STL) are merged by exact position, unless the output has none either.
/// \throws InputError for a damaged mesh, UsageError when the output format cannot hold it, ValidationError where its
/// floats cannot (MeshWriter::finish) or a TIN cannot (create_tin_file), EmptyError for a TIN without faces, ResourceError
ConvertMeshReport convert_mesh(const std::filesystem::path& input, const std::filesystem::path& output,
                               const ConvertMeshOptions& options);

}  // namespace tessera
