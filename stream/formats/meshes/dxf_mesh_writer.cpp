/// DXF R12 in text: every face a 3DFACE on the layer TIN with its corners in full, breaklines as 3D polylines on the layer
/// BREAKLINES. R12 is what every CAD program reads, and the last release whose entities need no handles.
#include <string>

#include "stream/formats/meshes/tin_writer.h"

namespace tessera {
namespace {

constexpr const char* kFaceLayer = "TIN";
constexpr const char* kLineLayer = "BREAKLINES";

class DxfWriter : public TinWriter {
 public:
  DxfWriter(const std::filesystem::path& path, const MeshHeader& header, const TinSettings& settings)
      : TinWriter(path, header) {
    put("  0\nSECTION\n  2\nHEADER\n  9\n$ACADVER\n  1\nAC1009\n  9\n$EXTMIN\n");
    put_point(10, settings.low);
    put("  9\n$EXTMAX\n");
    put_point(10, settings.high);
    put("  0\nENDSEC\n  0\nSECTION\n  2\nTABLES\n  0\nTABLE\n  2\nLTYPE\n 70\n1\n  0\nLTYPE\n  "
        "2\nCONTINUOUS\n 70\n0\n"
        "  3\nSolid line\n 72\n65\n 73\n0\n 40\n0.0\n  0\nENDTAB\n  0\nTABLE\n  2\nLAYER\n 70\n3\n");
    put_layer("0", 7), put_layer(kFaceLayer, 8), put_layer(kLineLayer, 1);
    put("  0\nENDTAB\n  0\nENDSEC\n  0\nSECTION\n  2\nENTITIES\n");
    if (settings.breaklines) settings.breaklines([&](std::span<const Double3> line) { put_line(line); });
  }

 private:
  void put_layer(const std::string& name, std::uint64_t colour) {
    put("  0\nLAYER\n  2\n" + name + "\n 70\n0\n 62\n");
    put(colour);
    put("\n  6\nCONTINUOUS\n");
  }

  /// Coordinates have the codes n, n + 10, n + 20.
  void put_point(std::uint64_t code, const Double3& position) {
    const Double3 p = place(position);
    for (std::size_t k = 0; k < 3; ++k) {
      put(" "), put(code + 10 * k), put("\n"), put(p[k]), put("\n");
    }
  }

  void put_line(std::span<const Double3> line) {
    const bool closed = line.size() > 3 && line.front() == line.back();
    put(std::string("  0\nPOLYLINE\n  8\n") + kLineLayer + "\n 66\n1\n 10\n0.0\n 20\n0.0\n 30\n0.0\n 70\n" +
        (closed ? "9\n" : "8\n"));
    for (const Double3& p : line.first(line.size() - (closed ? 1 : 0))) {
      put(std::string("  0\nVERTEX\n  8\n") + kLineLayer + "\n");
      put_point(10, p);
      put(" 70\n32\n");
      flush_if_long();
    }
    put(std::string("  0\nSEQEND\n  8\n") + kLineLayer + "\n");
  }

  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t>) override {
    remember(positions);
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    for (const MeshFace& face : faces) {
      put(std::string("  0\n3DFACE\n  8\n") + kFaceLayer + "\n");
      // A triangle has its third corner twice.
      for (std::uint64_t k = 0; k < 4; ++k) put_point(10 + k, store_.at(face[k < 3 ? k : 2]));
      flush_if_long();
    }
  }

  void write_end() override {
    put("  0\nENDSEC\n  0\nEOF\n");
    flush();
  }
};

}  // namespace

std::unique_ptr<TinWriter> create_dxf_tin(const std::filesystem::path& path, const MeshHeader& header,
                                          const TinSettings& settings) {
  return std::make_unique<DxfWriter>(path, header, settings);
}

}  // namespace tessera
