#include "stream/stages/resample/resample_files.h"

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/packed_file.h"
#include "stream/files/path_text.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kBandKind = {"TSEBAND1", "a part of the bands of a mesh"};
constexpr PackedKind kBlendKind = {"TSEBLND1", "a resampled blend"};

struct Link {
  std::uint64_t a, b;
};

}  // namespace

void MeshScale::save(const std::filesystem::path& path) const {
  write_text(path, dump_json(Json{{"edge", edge}, {"tolerance", tolerance}}));
}
MeshScale MeshScale::of_work(const std::filesystem::path& work) {
  const Json j = parse_json(read_text(work / kFile));
  return {j.at("edge").get<double>(), j.at("tolerance").get<double>()};
}

std::uint64_t BandPart::save(const std::filesystem::path& path) const {
  PackedWriter file(path, kBandKind, std::size_t{1} << 16);
  std::vector<Link> pairs;
  pairs.reserve(links.size());
  for (const auto& [a, b] : links) pairs.push_back({a, b});
  const std::vector<Section> sections = {file.append(bytes_of(vertices)), file.append(bytes_of(pairs))};
  return file.finish(sections);
}
BandPart BandPart::load(const std::filesystem::path& path) {
  const PackedFile file(path, kBandKind, sizeof(Section));
  const auto sections = file.table<Section>();
  BandPart out;
  out.vertices = file.load<BandVertex>(sections.at(0));
  for (const Link& l : file.load<Link>(sections.at(1))) out.links.emplace_back(l.a, l.b);
  return out;
}
std::pair<std::uint64_t, std::uint64_t> BandPart::count(const std::filesystem::path& path) {
  const auto sections = PackedFile(path, kBandKind, sizeof(Section)).table<Section>();
  return {sections.at(0).bytes / sizeof(BandVertex), sections.at(1).bytes / sizeof(Link)};
}

void save_blend_curves(const std::filesystem::path& path, const std::vector<FoundCurve>& curves) {
  Json out = Json::array();
  for (const FoundCurve& t : curves)
    out.push_back({{"name", json_text(t.name)},
                   {"by_hand", t.by_hand},
                   {"centre", t.curve.centre},
                   {"normal", t.curve.normal},
                   {"closed", t.curve.closed},
                   {"convex", t.curve.convex},
                   {"half_width", t.curve.half_width},
                   {"key", t.curve.key}});
  write_text(path, dump_json(out));
}
std::vector<FoundCurve> load_blend_curves(const std::filesystem::path& work) {
  std::vector<FoundCurve> out;
  for (const Json& j : parse_json(read_text(work / kCurvesFile))) {
    FoundCurve t;
    t.name = j.at("name").get<std::string>();
    j.at("by_hand").get_to(t.by_hand);
    j.at("centre").get_to(t.curve.centre);
    j.at("normal").get_to(t.curve.normal);
    j.at("closed").get_to(t.curve.closed);
    j.at("convex").get_to(t.curve.convex);
    j.at("half_width").get_to(t.curve.half_width);
    j.at("key").get_to(t.curve.key);
    out.push_back(std::move(t));
  }
  return out;
}

std::uint64_t save_blend(const std::filesystem::path& path, const ResampledBlend& blend) {
  PackedWriter file(path, kBlendKind, std::size_t{1} << 16);
  const MeshBlock& b = blend.added;
  const std::vector<Section> sections = {
      file.append(bytes_of(blend.removed)),  file.append(bytes_of(b.key)),  file.append(bytes_of(b.position)),
      file.append(bytes_of(b.vertex_class)), file.append(bytes_of(b.rgba)), file.append(bytes_of(b.faces)),
      file.append(bytes_of(b.face_flags))};
  return file.finish(sections);
}
ResampledBlend load_blend(const std::filesystem::path& path) {
  const PackedFile file(path, kBlendKind, sizeof(Section));
  const auto s = file.table<Section>();
  ResampledBlend out;
  out.removed = file.load<std::array<std::uint64_t, 3>>(s.at(0));
  out.added.key = file.load<std::uint64_t>(s.at(1));
  out.added.position = file.load<Double3>(s.at(2));
  out.added.vertex_class = file.load<VertexClass>(s.at(3));
  out.added.rgba = file.load<std::uint32_t>(s.at(4));
  out.added.faces = file.load<std::array<std::uint32_t, 3>>(s.at(5));
  out.added.face_flags = file.load<std::uint8_t>(s.at(6));
  return out;
}
std::string blend_file(std::size_t blend) {
  return "blends/" + task_file_stem(blend) + ".tsb";
}

}  // namespace tessera
