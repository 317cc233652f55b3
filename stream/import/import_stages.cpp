#include "stream/import/import_stages.h"

#include <algorithm>
#include <cstring>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/packed_file.h"
#include "stream/files/task_files.h"
#include "stream/runtime/report.h"

namespace tessera {
namespace {

constexpr PackedKind kKind = {"TSVERTX2", "a file of vertices"};

struct VertexSections {
  Section brick, first, position, rgba;
};

std::uint64_t position_bytes(const MeshStoreInfo& info) {
  return info.double_positions ? 24 : 12;
}

void pack(const std::vector<Double3>& positions, bool doubles, char* to) {
  for (const Double3& p : positions) {
    if (doubles) {
      std::memcpy(to, &p, sizeof p);
      to += sizeof p;
    } else {
      const Float3 f = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
      std::memcpy(to, &f, sizeof f);
      to += sizeof f;
    }
  }
}
Double3 unpack(const char* from, bool doubles) {
  if (doubles) {
    Double3 p;
    std::memcpy(&p, from, sizeof p);
    return p;
  }
  Float3 f;
  std::memcpy(&f, from, sizeof f);
  return {f[0], f[1], f[2]};
}

}  // namespace

std::string ImportNames::vertices(std::size_t bucket) const {
  return root + "vertices/" + task_file_stem(bucket) + ".tsv";
}
std::string ImportNames::numbers(std::size_t bucket) const {
  return root + "vertices/" + task_file_stem(bucket) + ".tsn";
}
std::string ImportNames::tiles(std::size_t bucket) const {
  return root + "tiles/" + task_file_stem(bucket) + ".tmm";
}
std::string ImportNames::fixes(std::size_t bucket) const {
  return root + "tiles/" + task_file_stem(bucket) + ".fix";
}
std::string ImportNames::repaired(std::size_t bucket) const {
  return root + "repaired/" + task_file_stem(bucket) + ".tmm";
}

std::uint64_t BucketVertices::save(const std::filesystem::path& path, const MeshStoreInfo& info) const {
  std::vector<char> packed(position.size() * position_bytes(info));
  pack(position, info.double_positions, packed.data());
  PackedWriter file(path, kKind);
  const std::vector<VertexSections> table = {{file.append(bytes_of(brick)), file.append(bytes_of(first)),
                                              file.append(bytes_of(packed)), file.append(bytes_of(rgba))}};
  return file.finish(table);
}

BucketVertices BucketVertices::load(const std::filesystem::path& path, const MeshStoreInfo& info) {
  const PackedFile file(path, kKind, sizeof(VertexSections));
  const VertexSections s = file.table<VertexSections>().at(0);
  BucketVertices out;
  out.brick = file.load<std::uint64_t>(s.brick);
  out.first = file.load<std::uint32_t>(s.first);
  out.rgba = file.load<std::uint32_t>(s.rgba);
  const std::vector<char> packed = file.load<char>(s.position);
  out.position.resize(packed.size() / position_bytes(info));
  const char* at = packed.data();
  for (Double3& p : out.position) {
    p = unpack(at, info.double_positions);
    at += position_bytes(info);
  }
  return out;
}

ImportedVertices::ImportedVertices(const std::filesystem::path& work, const std::string& folder)
    : work_(work), names_(folder) {
  plan_ = fields_from_json<ImportPlan>(parse_json(read_text(work / names_.plan())));
  first_ = parse_json(read_text(work / names_.numbering())).at("first").get<std::vector<std::uint32_t>>();
}

std::size_t ImportedVertices::bucket_of(std::uint32_t number) const {
  return static_cast<std::size_t>(std::upper_bound(first_.begin(), first_.end(), number) - first_.begin()) -
         1;
}

BucketVertices ImportedVertices::load(std::size_t bucket) const {
  return BucketVertices::load(work_ / names_.vertices(bucket), plan_.info);
}

void ImportedVertices::fetch(std::span<const std::uint32_t> numbers, std::vector<Double3>& position,
                             std::vector<std::uint32_t>& rgba) const {
  constexpr std::uint64_t kPage = 4096;  // vertices read at once
  const std::uint64_t width = position_bytes(plan_.info);
  std::vector<char> page;
  std::vector<std::uint32_t> colours;
  for (std::size_t i = 0; i < numbers.size();) {
    const std::size_t bucket = bucket_of(numbers[i]);
    const PackedFile file(work_ / names_.vertices(bucket), kKind, sizeof(VertexSections));
    const VertexSections s = file.table<VertexSections>().at(0);
    while (i < numbers.size() && numbers[i] < first_[bucket + 1]) {
      const std::uint64_t begin = numbers[i] - first_[bucket];
      const std::uint64_t count = std::min(kPage, s.position.bytes / width - begin);
      page.resize(count * width);
      file.read_part(s.position, begin * width, page.data(), page.size());
      if (plan_.info.colour) {
        colours.resize(count);
        file.read_part(s.rgba, 4 * begin, colours.data(), 4 * count);
      }
      for (; i < numbers.size() && numbers[i] - first_[bucket] < begin + count; ++i) {
        const std::uint64_t at = numbers[i] - first_[bucket] - begin;
        position.push_back(unpack(page.data() + at * width, plan_.info.double_positions));
        if (plan_.info.colour) rgba.push_back(colours[at]);
      }
    }
  }
}

std::vector<StageEntry> import_stages(const ImportSource& source) {
  const auto entry = [&](const char* name, auto make) {
    return StageEntry{source.folder + "-" + name,
                      [make, source](const JobState& state) { return make(state, source); }};
  };
  return {entry("read", make_import_read_stage), entry("vertices", make_import_vertices_stage),
          entry("corners", make_import_corners_stage), entry("tiles", make_import_tiles_stage),
          entry("repair", make_import_repair_stage)};
}

MeshStore open_imported_mesh(const std::filesystem::path& work, const std::string& folder) {
  return MeshStore(list_task_files(work / folder / "tiles", ".tmm"),
                   list_task_files(work / folder / "repaired", ".tmm"));
}

Json import_report(const Json& report, const std::string& folder) {
  const auto result = [&](const std::string& stage) {
    Json found = result_of(report, folder + stage);
    return found.is_object() ? found : Json::object();
  };
  const Json read = result("-read"), corners = result("-corners");
  Json repair = result("-tiles");
  repair["nonfinite_vertices"] = read.value("nonfinite_vertices", 0);
  repair["welded_vertices"] = result("-vertices").value("welded", 0);
  repair["bad_faces"] = corners.value("bad_faces", 0);
  repair["degenerate_faces"] = corners.value("degenerate_faces", 0);
  repair.erase("fixes");
  return {{"format", read.value("format", "")},
          {"vertices", read.value("vertices", 0)},
          {"faces", corners.value("faces", 0)},
          {"repair", repair}};
}

}  // namespace tessera
