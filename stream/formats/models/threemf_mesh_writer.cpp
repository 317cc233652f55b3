/// 3MF (3MF Core Specification 1.3, 3mf.io): a ZIP archive with one model part of one object. Coordinates are floats in decimals
/// that read back to them as doubles too, from the header's origin, which a metadata of our own name tells.
#include <array>
#include <charconv>
#include <cmath>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_writer_base.h"
#include "stream/formats/models/edge_balance.h"
#include "stream/formats/models/zip_writer.h"
#include "stream/formats/xml_text.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxIndex = 0x7fffffffULL;  // the specification's largest number
constexpr std::size_t kModelTextBytes = std::size_t{1} << 18;

struct ModelUnit {
  const char* name;
  double metres;
};
constexpr std::array kModelUnits = {ModelUnit{"millimeter", 1e-3}, ModelUnit{"meter", 1.0},
                                    ModelUnit{"centimeter", 1e-2}, ModelUnit{"inch", 0.0254},
                                    ModelUnit{"foot", 0.3048},     ModelUnit{"micron", 1e-6}};

/// The specification's own default where none is known. A US survey foot is a foot to five digits.
const char* model_unit(double metres, const std::filesystem::path& path) {
  if (metres == 0.0) return kModelUnits[0].name;
  for (const ModelUnit& unit : kModelUnits)
    if (std::abs(metres - unit.metres) < 1e-5 * unit.metres) return unit.name;
  throw UsageError(path.string() + ": 3MF has no word for a unit of " + std::to_string(metres) +
                   " m; write .ply, which names none");
}

class ThreemfMeshWriter : public MeshWriterBase {
 public:
  ThreemfMeshWriter(const std::filesystem::path& path, const MeshHeader& header, const std::string& unit)
      : MeshWriterBase(path, header, true), zip_(file_) {
    const std::string xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
    zip_.entry("[Content_Types].xml",
               xml +
                   "<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">"
                   "<Default Extension=\"rels\" "
                   "ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>"
                   "<Default Extension=\"model\" "
                   "ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/></Types>\n");
    zip_.entry(
        "_rels/.rels",
        xml +
            "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
            "<Relationship Target=\"/3D/3dmodel.model\" Id=\"rel0\" "
            "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>\n");
    zip_.begin("3D/3dmodel.model");
    text_ = xml + "<model unit=\"" + unit +
            "\" xml:lang=\"en-US\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
            "xmlns:tessera=\"urn:tessera:3mf\">\n<metadata name=\"Application\">Tessera</metadata>\n";
    for (const std::string& line : header.comments)
      text_ += "<metadata name=\"tessera:comment\">" + xml_text(line) + "</metadata>\n";
    put_triple("tessera:origin", header.origin);
    put_triple("tessera:shift", header.shift);
    text_ += "<resources>\n<object id=\"1\" type=\"model\">\n<mesh>\n<vertices>\n";
  }

 private:
  void put_triple(const char* name, const Double3& values) {
    if (values == Double3{0, 0, 0}) return;
    const std::string line = triple_line("", values);
    text_ += std::string("<metadata name=\"") + name + "\">" + line.substr(1) + "</metadata>\n";
  }

  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t>) override {
    for (const Double3& position : positions) {
      const Float3 p = local(position);
      if (!(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])))
        throw InputError(
            file_.path().string() +
            ": 3MF holds finite positions only and the mesh has others; clean the mesh first, as "
            "tessera decimate does");
      constexpr const char* kNames[] = {"<vertex x=\"", "\" y=\"", "\" z=\""};
      for (std::size_t k = 0; k < 3; ++k) {
        text_ += kNames[k];
        put(p[k] == 0.0f ? 0.0 : static_cast<double>(p[k]));  // all digits, as decimal_value()
      }
      text_ += "\"/>\n";
      flush_if_long();
    }
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    open_faces();
    for (const MeshFace& face : faces) {
      if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0])
        throw InputError(file_.path().string() +
                         ": a face names a vertex twice, which 3MF does not allow; clean the mesh first, as "
                         "tessera decimate does");
      edges_.face(face);
      constexpr const char* kNames[] = {"<triangle v1=\"", "\" v2=\"", "\" v3=\""};
      for (std::size_t k = 0; k < 3; ++k) {
        text_ += kNames[k];
        put(face[k]);
      }
      text_ += "\"/>\n";
      flush_if_long();
    }
  }

  void write_end() override {
    open_faces();
    text_ +=
        "</triangles>\n</mesh>\n</object>\n</resources>\n<build>\n<item "
        "objectid=\"1\"/>\n</build>\n</model>\n";
    zip_.append(text_);
    zip_.end();
    zip_.finish();
    rounding_.open = !edges_.closed();
  }

  void open_faces() {
    if (faces_open_) return;
    faces_open_ = true;
    text_ += "</vertices>\n<triangles>\n";
  }

  template <class Number>
  void put(Number value) {
    char digits[64];
    text_.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  }

  void flush_if_long() {
    if (text_.size() < kModelTextBytes) return;
    zip_.append(text_);
    text_.clear();
  }

  ZipWriter zip_;
  EdgeBalance edges_;
  std::string text_;
  bool faces_open_ = false;
};

}  // namespace

std::unique_ptr<MeshWriter> create_threemf_mesh(const std::filesystem::path& path, const MeshHeader& header) {
  if (header.vertices == 0 || header.faces == 0)
    throw UsageError(path.string() + ": 3MF cannot hold a mesh without faces; write .ply instead");
  if (header.vertices > kMaxIndex || header.faces > kMaxIndex)
    throw UsageError(path.string() + ": 3MF ends at 2147483647 vertices and faces, and the mesh has " +
                     std::to_string(header.vertices) + " and " + std::to_string(header.faces) +
                     "; write .ply instead");
  return std::make_unique<ThreemfMeshWriter>(path, header, model_unit(header.unit, path));
}

}  // namespace tessera
