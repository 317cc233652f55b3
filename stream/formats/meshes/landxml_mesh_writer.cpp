/// LandXML 1.2: one surface of points and faces. Points are northing, easting, elevation. The date, which the schema asks for, is
/// always the same, so that equal meshes have equal bytes.
#include <string>

#include <fmt/format.h>

#include "kernels/mesh/orientation_sign.h"
#include "octree/error.h"
#include "stream/formats/meshes/tin_writer.h"
#include "stream/formats/xml_text.h"

namespace tessera {
namespace {

const char* units_of(TinUnit unit) {
  switch (unit) {
    case TinUnit::kFoot:
      return "<Imperial areaUnit=\"squareFoot\" linearUnit=\"foot\" volumeUnit=\"cubicFeet\" "
             "temperatureUnit=\"fahrenheit\" pressureUnit=\"inchHG\"/>";
    case TinUnit::kSurveyFoot:
      return "<Imperial areaUnit=\"squareFoot\" linearUnit=\"USSurveyFoot\" volumeUnit=\"cubicFeet\" "
             "temperatureUnit=\"fahrenheit\" pressureUnit=\"inchHG\"/>";
    default:
      return "<Metric areaUnit=\"squareMeter\" linearUnit=\"meter\" volumeUnit=\"cubicMeter\" "
             "temperatureUnit=\"celsius\" pressureUnit=\"milliBars\"/>";
  }
}

class LandXmlWriter : public TinWriter {
 public:
  LandXmlWriter(const std::filesystem::path& path, const MeshHeader& header, const TinSettings& settings)
      : TinWriter(path, header), overhangs_(settings.overhangs) {
    put("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<LandXML xmlns=\"http://www.landxml.org/schema/LandXML-1.2\" "
        "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
        "xsi:schemaLocation=\"http://www.landxml.org/schema/LandXML-1.2 "
        "http://www.landxml.org/schema/LandXML-1.2/LandXML-1.2.xsd\" "
        "version=\"1.2\" date=\"2000-01-01\" time=\"00:00:00\" readOnly=\"false\" "
        "language=\"English\">\n<Units>");
    put(units_of(settings.unit));
    put("</Units>\n");
    put_crs(settings.crs);
    put("<Application name=\"Tessera\"/>\n<Surfaces>\n<Surface name=\"" + xml_text(path.stem().string()) +
        "\">\n");
    if (settings.breaklines) put_breaklines(settings);
    put("<Definition surfType=\"TIN\" elevMin=\"");
    put(settings.low[2] + header.shift[2]), put("\" elevMax=\""), put(settings.high[2] + header.shift[2]);
    put("\">\n<Pnts>\n");
  }

 private:
  void put_crs(const Crs& crs) {
    if (!crs.known()) return;
    put("<CoordinateSystem name=\"" + xml_text(crs.name) + "\"");
    if (crs.horizontal != 0) put(" epsgCode=\"" + std::to_string(crs.horizontal) + "\"");
    if (!crs.wkt.empty()) put(" ogcWktCode=\"" + xml_text(crs.wkt) + "\"");
    put("/>\n");
  }

  void put_point(const Double3& position) {
    const Double3 p = place(position);
    put(p[1]), put(" "), put(p[0]), put(" "), put(p[2]);
  }

  void put_breaklines(const TinSettings& settings) {
    put("<SourceData>\n<Breaklines>\n");
    settings.breaklines([&](std::span<const Double3> line) {
      put("<Breakline brkType=\"standard\"><PntList3D>");
      for (std::size_t k = 0; k < line.size(); ++k) {
        if (k > 0) put(" ");
        put_point(line[k]);
        flush_if_long();
      }
      put("</PntList3D></Breakline>\n");
    });
    put("</Breaklines>\n</SourceData>\n");
  }

  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t>) override {
    remember(positions);
    for (const Double3& p : positions) {
      put("<P id=\""), put(++points_), put("\">");
      put_point(p);
      put("</P>\n");
      flush_if_long();
    }
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    open_faces();
    for (const MeshFace& face : faces) {
      std::array<Double2, 3> plan;
      for (std::size_t k = 0; k < 3; ++k) {
        const Double3 p = store_.at(face[k]);
        plan[k] = {p[0], p[1]};
      }
      const int facing = orient2d_sign(plan[0], plan[1], plan[2]);
      counts_.downward += facing < 0 ? 1 : 0, counts_.upright += facing == 0 ? 1 : 0;
      if (facing <= 0 && overhangs_ != TinOverhangs::kKeep) continue;
      put("<F>"), put(face[0] + 1), put(" "), put(face[1] + 1), put(" "), put(face[2] + 1), put("</F>\n");
      flush_if_long();
    }
  }

  void write_end() override {
    open_faces();
    put("</Faces>\n</Definition>\n</Surface>\n</Surfaces>\n</LandXML>\n");
    flush();
    const std::uint64_t overhangs = counts_.downward + counts_.upright;
    if (overhangs == 0) return;
    if (overhangs_ == TinOverhangs::kRefuse)
      throw ValidationError(
          fmt::format("{}: {} of {} faces show down and {} stand upright, but a LandXML TIN has one height "
                      "everywhere: leave "
                      "them out with --overhangs drop, keep them with --overhangs keep for programs that "
                      "take them, write "
                      ".dxf, or make one skin with tessera reconstruct --surface top",
                      file_.path().string(), counts_.downward, header_.faces, counts_.upright));
    if (overhangs == header_.faces && overhangs_ == TinOverhangs::kDrop)
      throw ValidationError(file_.path().string() +
                            ": no face of the mesh shows upwards, so nothing is left of it");
  }

  void open_faces() {
    if (faces_open_) return;
    faces_open_ = true;
    put("</Pnts>\n<Faces>\n");
  }

  TinOverhangs overhangs_;
  std::uint64_t points_ = 0;
  bool faces_open_ = false;
};

}  // namespace

std::unique_ptr<TinWriter> create_landxml_tin(const std::filesystem::path& path, const MeshHeader& header,
                                              const TinSettings& settings) {
  return std::make_unique<LandXmlWriter>(path, header, settings);
}

}  // namespace tessera
