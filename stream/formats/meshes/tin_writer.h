/// \file tin_writer.h
/// Triangulated surfaces for CAD programs that read no mesh formats: LandXML 1.2 (.xml) and DXF R12 (.dxf), streamed, all
/// coordinates doubles in the scan's own frame. Source: LandXML-1.2 schema, landxml.org, 2008; Autodesk, "DXF Reference", release 12.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "stream/formats/meshes/mesh_writer_base.h"
#include "stream/formats/points/crs.h"
#include "stream/formats/vertex_store.h"

namespace tessera {

enum class TinUnit { kMetre, kFoot, kSurveyFoot };
/// What becomes of faces that a surface of one height everywhere cannot have (LandXML).
enum class TinOverhangs { kRefuse, kDrop, kKeep };

struct TinSettings {
  Crs crs;  ///< told to the reader where it is known
  TinUnit unit = TinUnit::kMetre;
  TinOverhangs overhangs = TinOverhangs::kRefuse;
  Double3 low{}, high{};  ///< box of all positions
  /// Hands out lines that the surface breaks along, any number of points each; may be empty.
  std::function<void(const std::function<void(std::span<const Double3>)>&)> breaklines;
};

/// Of LandXML.
struct TinCounts {
  std::uint64_t downward = 0;  ///< faces that show down
  std::uint64_t upright = 0;   ///< faces without a shadow
};

class TinWriter : public MeshWriterBase {
 public:
  const TinCounts& counts() const { return counts_; }

 protected:
  TinWriter(const std::filesystem::path& path, const MeshHeader& header);
  Double3 place(const Double3& position) const { return position + header_.shift; }  ///< in the scan's frame
  void put(std::string_view text) { text_ += text; }
  /// The shortest decimals that read back to the same double.
  void put(double value);
  void put(std::uint64_t value);
  void flush_if_long();
  void flush();
  void remember(std::span<const Double3> positions);  ///< \throws InputError for one that is not finite

  VertexStore store_;  ///< positions as they came
  TinCounts counts_;

 private:
  std::uint64_t remembered_ = 0;
  std::string text_;
};

/// Whether an extension is one of theirs: .xml, .dxf.
bool is_tin_file(const std::filesystem::path& path);

/// By extension. finish() throws ValidationError where faces overhang and TinOverhangs::kRefuse says so: no file gets the name.
/// \pre is_tin_file(path)  \throws UsageError, ResourceError as create_mesh_file()
std::unique_ptr<TinWriter> create_tin_file(const std::filesystem::path& path, const MeshHeader& header,
                                           const TinSettings& settings);

std::unique_ptr<TinWriter> create_landxml_tin(const std::filesystem::path& path, const MeshHeader& header,
                                              const TinSettings& settings);
std::unique_ptr<TinWriter> create_dxf_tin(const std::filesystem::path& path, const MeshHeader& header,
                                          const TinSettings& settings);

}  // namespace tessera
