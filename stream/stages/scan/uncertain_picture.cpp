#include "stream/stages/scan/uncertain_picture.h"

#include <cmath>
#include <cstdint>

#include "stream/formats/points/point_writer.h"
#include "stream/render/doubt.h"
#include "stream/render/render.h"

namespace tessera {
namespace {

void write_surfels(const PointOverlay& overlay, const OverlayDecisions& decisions, const Lattice& lattice,
                   const std::filesystem::path& path, const TaskContext& context) {
  PointFileHeader header;
  header.attributes.normals = header.attributes.colour = true;
  header.double_positions = true;
  const auto encoder = make_point_encoder(path, header);
  const auto writer = create_point_file(path, header);
  PointChunk chunk;
  EncodedPoints encoded;
  for (std::size_t b = 0; b < overlay.bricks().size(); ++b) {
    context.check_stop();
    const Int3 brick = brick_of_key(overlay.bricks()[b].key);
    chunk.clear();
    for (const CoarseSurfel& c : overlay.load_coarse(b)) {
      const std::uint8_t decision = decisions.patch[overlay.first_patch()[b] + c.patch];
      const float area = std::sqrt(c.area[0] * c.area[0] + c.area[1] * c.area[1] + c.area[2] * c.area[2]);
      if (!(area > 0.0f)) continue;
      const float side = ((decision & kPatchFlip) != 0 ? -1.0f : 1.0f) / area;
      const auto at = [&](std::size_t a) {
        return lattice.world(static_cast<int>(a),
                             static_cast<double>(brick[a] * kBrickCells) + double{c.position[a]});
      };
      chunk.x.push_back(at(0)), chunk.y.push_back(at(1)), chunk.z.push_back(at(2));
      chunk.nx.push_back(side * c.area[0]), chunk.ny.push_back(side * c.area[1]),
          chunk.nz.push_back(side * c.area[2]);
      chunk.rgba.push_back((decision & kPatchUncertain) != 0 ? kDoubtfulPoint : kDecidedPoint);
    }
    encoder->encode(chunk, {}, encoded);
    writer->append(encoded);
  }
  writer->finish();
}

}  // namespace

std::filesystem::path uncertain_picture_path(const std::filesystem::path& output) {
  std::filesystem::path path = output;
  return path += ".uncertain.png";
}

std::filesystem::path uncertain_points_path(const std::filesystem::path& output) {
  std::filesystem::path path = output;
  return path += ".uncertain.ply";
}

void draw_uncertain(const PointOverlay& overlay, const OverlayDecisions& decisions, const Lattice& lattice,
                    const std::filesystem::path& output, std::uint64_t memory_bytes,
                    const TaskContext& context) {
  const std::filesystem::path points = uncertain_points_path(output);
  write_surfels(overlay, decisions, lattice, points, context);
  RenderOptions options;
  options.inputs = {points.string()};
  options.output = uncertain_picture_path(output);
  options.colour = "vertex";
  options.samples = 1;  // a hint, not a portrait: a quarter of the time and of the memory
  options.memory_bytes = memory_bytes;
  render(options);
}

}  // namespace tessera
