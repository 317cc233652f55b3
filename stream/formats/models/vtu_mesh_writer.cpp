/// VTK's XML format for unstructured grids (VTK File Formats, kitware.com): one piece of triangles, its arrays raw behind the XML, with
/// sizes and indices of 64 bits. Colours are `rgba` of the points, faces that close holes `synthetic` of the cells. The shift and the
/// comments stand in comments of XML.
#include <algorithm>
#include <vector>

#include "stream/files/spill_file.h"
#include "stream/formats/meshes/mesh_writer_base.h"
#include "stream/formats/xml_text.h"

namespace tessera {
namespace {

constexpr std::uint8_t kTriangle = 5;  // of VTK's cell types
constexpr std::size_t kVtuBatch = 16384;

class VtuMeshWriter : public MeshWriterBase {
 public:
  VtuMeshWriter(const std::filesystem::path& path, const MeshHeader& header)
      : MeshWriterBase(path, header, !header.double_positions),
        position_bytes_(header.double_positions ? 8 : 4),
        colours_(path.has_parent_path() ? path.parent_path() : "."),
        synthetic_(path.has_parent_path() ? path.parent_path() : ".") {
    std::string text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n";
    for (const std::string& line : comment_lines(header)) text += "<!-- " + comment_text(line) + " -->\n";
    text += "<UnstructuredGrid>\n<Piece NumberOfPoints=\"" + std::to_string(header.vertices) +
            "\" NumberOfCells=\"" + std::to_string(header.faces) + "\">\n";
    // One statement for each: they count the bytes before them.
    const std::string real = header.double_positions ? "Float64" : "Float32";
    text += "<Points>\n" + array(real, "Points", 3, header.vertices * 3 * position_bytes_) + "</Points>\n";
    if (header.colour)
      text += "<PointData>\n" + array("UInt8", "rgba", 4, header.vertices * 4) + "</PointData>\n";
    text += "<Cells>\n";
    text += array("Int64", "connectivity", 1, header.faces * 24);
    text += array("Int64", "offsets", 1, header.faces * 8);
    text += array("UInt8", "types", 1, header.faces) + "</Cells>\n";
    if (header.synthetic)
      text += "<CellData>\n" + array("UInt8", "synthetic", 1, header.faces) + "</CellData>\n";
    text += "</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
    file_.append(text);
    put_size(header.vertices * 3 * position_bytes_);
  }

 private:
  /// Two hyphens would end a comment.
  static std::string comment_text(const std::string& line) {
    std::string text = xml_text(line);
    for (std::size_t at = text.find("--"); at != std::string::npos; at = text.find("--", at))
      text.replace(at, 2, "- -");
    return text;
  }

  /// An array of so many bytes behind those that were named before.
  std::string array(const std::string& type, const std::string& name, int components, std::uint64_t bytes) {
    std::string text = "<DataArray type=\"" + type + "\" Name=\"" + name + "\"";
    if (components > 1) text += " NumberOfComponents=\"" + std::to_string(components) + "\"";
    text += " format=\"appended\" offset=\"" + std::to_string(offset_) + "\"/>\n";
    offset_ += sizeof bytes + bytes;
    return text;
  }
  void put_size(std::uint64_t bytes) { file_.append(&bytes, sizeof bytes); }

  template <class Real>
  void put_positions(std::span<const Double3> positions) {
    std::vector<Real> numbers;
    for (const Double3& p : positions)
      for (const double value : p) numbers.push_back(static_cast<Real>(value));
    file_.append(numbers.data(), numbers.size() * sizeof(Real));
  }

  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) override {
    for (std::size_t first = 0; first < positions.size(); first += kVtuBatch) {
      const auto batch = positions.subspan(first, std::min(kVtuBatch, positions.size() - first));
      if (header_.double_positions)
        put_positions<double>(batch);
      else
        put_positions<float>(batch);
    }
    if (!rgba.empty()) colours_.append(rgba.data(), rgba.size_bytes());
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) override {
    open_faces();
    file_.append(faces.data(), faces.size_bytes());
    if (!synthetic.empty()) synthetic_.append(synthetic.data(), synthetic.size());
  }

  void write_end() override {
    open_faces();
    put_size(header_.faces * 8);
    std::vector<std::int64_t> ends;
    for (std::uint64_t f = 0; f < header_.faces;) {
      ends.clear();
      for (; f < header_.faces && ends.size() < kVtuBatch; ++f)
        ends.push_back(3 * static_cast<std::int64_t>(f) + 3);
      file_.append(ends.data(), ends.size() * sizeof ends[0]);
    }
    put_size(header_.faces);
    const std::vector<char> types(kVtuBatch, static_cast<char>(kTriangle));
    for (std::uint64_t f = 0; f < header_.faces; f += kVtuBatch)
      file_.append(types.data(),
                   static_cast<std::size_t>(std::min<std::uint64_t>(kVtuBatch, header_.faces - f)));
    if (header_.synthetic) put_spilled(synthetic_);
    file_.append("\n</AppendedData>\n</VTKFile>\n");
  }

  void open_faces() {
    if (faces_open_) return;
    faces_open_ = true;
    if (header_.colour) put_spilled(colours_);
    put_size(header_.faces * 24);
  }

  void put_spilled(const SpillFile& spilled) {
    put_size(spilled.size());
    std::vector<char> bytes(std::size_t{1} << 16);
    for (std::uint64_t at = 0; at < spilled.size(); at += bytes.size()) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), spilled.size() - at));
      spilled.read_at(at, bytes.data(), n);
      file_.append(bytes.data(), n);
    }
  }

  static_assert(sizeof(MeshFace) == 24, "faces are three indices of 64 bits, as they lie in the file");

  const std::uint64_t position_bytes_;
  SpillFile colours_, synthetic_;
  std::uint64_t offset_ = 0;
  bool faces_open_ = false;
};

}  // namespace

std::unique_ptr<MeshWriter> create_vtu_mesh(const std::filesystem::path& path, const MeshHeader& header) {
  return std::make_unique<VtuMeshWriter>(path, header);
}

}  // namespace tessera
