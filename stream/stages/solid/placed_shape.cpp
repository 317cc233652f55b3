/// Shapes of a model, with what their files say.
#include <cmath>

#include "kernels/solid/blended_shape.h"
#include "kernels/solid/swept_tool.h"
#include "octree/error.h"
#include "stream/formats/line_reader.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMinLine = 6;  ///< bytes of a line with three numbers

/// Lines of three numbers; empty ones and comments (#) are passed over.
std::vector<Double3> read_tool_path(const std::filesystem::path& path) {
  const ReadFile file(path);
  LineLayout layout;
  layout.line_end = detect_line_end(file);
  LineReader lines(file, layout, 0, file.size(), false);
  std::vector<Double3> points;
  std::string_view line;
  while (lines.next(line)) {
    if (line.find_first_not_of(" \t\r") == std::string_view::npos ||
        line[line.find_first_not_of(" \t")] == '#')
      continue;
    Double3 p;
    for (double& number : p)
      if (!next_number(line, number) || !std::isfinite(number))
        throw InputError(lines.where() +
                         ": a tool path has three numbers a line, where the tip of the tool is");
    points.push_back(p);
  }
  if (points.empty()) throw InputError(path.string() + ": the tool path has no point");
  return points;
}

std::unique_ptr<SolidShape> make(const PlainShape& s) {
  return make_shape(s.kind, s.numbers, s.placement);
}

}  // namespace

std::unique_ptr<SolidShape> make_placed_shape(const JobState& state, const PlacedShape& shape) {
  if (const auto* blend = std::get_if<BlendShape>(&shape))
    return blend_shapes(make(blend->first), make(blend->second), blend->join, blend->radius);
  if (const auto* mill = std::get_if<MillShape>(&shape)) {
    const MillingTool tool = {mill->tool.at(0), mill->tool.at(1), mill->tool.at(2)};
    return std::make_unique<SweptTool>(tool, read_tool_path(state.inputs.at(mill->path)), mill->placement);
  }
  return make(std::get<PlainShape>(shape));
}

std::uint64_t placed_shape_bytes(const JobState& state, const PlacedShape& shape) {
  const auto* mill = std::get_if<MillShape>(&shape);
  if (!mill) return 0;
  const std::uint64_t points = std::filesystem::file_size(state.inputs.at(mill->path)) / kMinLine + 1;
  return SweptTool::bytes(points) + 24 * points + 2 * LineReader::kLongestLine;
}

}  // namespace tessera
