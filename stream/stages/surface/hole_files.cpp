#include "stream/stages/surface/hole_files.h"

#include "stream/files/packed_file.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr std::size_t kBuffer = std::size_t{1} << 20;
constexpr PackedKind kLoopsKind = {"TSLOOPS2", "a file of loops"};
constexpr PackedKind kFillingsKind = {"TSHOLES4", "a file of fillings"};

struct LoopEntry {
  Section section;
  std::uint64_t edges = 0, taken = 0, coloured = 0;
};

template <class T>
std::span<std::byte> buffer(std::vector<T>& values, std::uint64_t count) {
  values.resize(count);
  return buffer_of(values);
}

/// The sections of a fillings file.
struct FillingSections {
  Section position, rgba, faces, moved, spans, rim;
};

}  // namespace

void save_loops(const std::filesystem::path& path, const std::vector<NamedLoop>& loops) {
  PackedWriter file(path, kLoopsKind, kBuffer);
  std::vector<LoopEntry> table;
  for (const NamedLoop& l : loops)
    table.push_back({file.append({bytes_of(l.vertex), bytes_of(l.loop.position), bytes_of(l.loop.opposite),
                                  bytes_of(l.loop.taken), bytes_of(l.loop.rgba)}),
                     l.vertex.size(), l.loop.taken.size(), l.loop.rgba.size()});
  file.finish(table);
}

std::vector<NamedLoop> load_loops(const std::filesystem::path& path) {
  const PackedFile file(path, kLoopsKind, sizeof(LoopEntry));
  std::vector<NamedLoop> loops;
  for (const LoopEntry& e : file.table<LoopEntry>()) {
    auto& [loop, vertex] = loops.emplace_back();
    file.read(e.section,
              {buffer(vertex, e.edges), buffer(loop.position, e.edges), buffer(loop.opposite, e.edges),
               buffer(loop.taken, e.taken), buffer(loop.rgba, e.coloured)});
  }
  return loops;
}

void HoleFillings::save(const std::filesystem::path& path) const {
  PackedWriter file(path, kFillingsKind, kBuffer);
  const std::vector<FillingSections> table = {{file.append(bytes_of(position)), file.append(bytes_of(rgba)),
                                               file.append(bytes_of(faces)), file.append(bytes_of(moved)),
                                               file.append(bytes_of(spans)), file.append(bytes_of(rim))}};
  file.finish(table);
}

HoleFillings HoleFillings::load(const std::filesystem::path& path) {
  const PackedFile file(path, kFillingsKind, sizeof(FillingSections));
  const FillingSections s = file.table<FillingSections>().at(0);
  return {file.load<Double3>(s.position),
          file.load<std::uint32_t>(s.rgba),
          file.load<std::array<std::uint64_t, 3>>(s.faces),
          file.load<MovedRim>(s.moved),
          file.load<FillingSpan>(s.spans),
          file.load<RimVertex>(s.rim)};
}

HoleFillings without_fillings(const HoleFillings& all, std::span<const std::uint8_t> gone) {
  HoleFillings out;
  out.moved = all.moved;
  std::size_t v = 0, f = 0, r = 0;
  for (std::size_t i = 0; i < all.spans.size(); ++i) {
    const FillingSpan& span = all.spans[i];
    const std::size_t vertex = v, end_v = v + span.vertices, end_f = f + span.faces, end_r = r + span.rim;
    if (!gone[i]) {
      const std::uint64_t before = out.position.size();
      out.spans.push_back(span);
      for (; v < end_v; ++v) {
        out.position.push_back(all.position[v]);
        if (!all.rgba.empty()) out.rgba.push_back(all.rgba[v]);
      }
      for (; f < end_f; ++f) {
        out.faces.push_back(all.faces[f]);
        for (std::uint64_t& c : out.faces.back())
          if ((c & HoleFillings::kNew) != 0)
            c = HoleFillings::kNew | ((c & ~HoleFillings::kNew) - vertex + before);
      }
      for (; r < end_r; ++r) out.rim.push_back(all.rim[r]);
    }
    v = end_v, f = end_f, r = end_r;
  }
  return out;
}

std::vector<MovedRim> load_rim_moves(const std::filesystem::path& path) {
  const PackedFile file(path, kFillingsKind, sizeof(FillingSections));
  return file.load<MovedRim>(file.table<FillingSections>().at(0).moved);
}

std::vector<FillingSpan> load_filling_spans(const std::filesystem::path& path) {
  const PackedFile file(path, kFillingsKind, sizeof(FillingSections));
  return file.load<FillingSpan>(file.table<FillingSections>().at(0).spans);
}

HoleFillingsHead load_fillings_head(const std::filesystem::path& path) {
  const PackedFile file(path, kFillingsKind, sizeof(FillingSections));
  const FillingSections s = file.table<FillingSections>().at(0);
  return {s.position.bytes / sizeof(Double3), s.faces.bytes / (3 * sizeof(std::uint64_t))};
}

std::vector<std::filesystem::path> list_loop_files(const std::filesystem::path& work) {
  return list_task_files(work / "loops", ".tsl");
}
std::vector<std::filesystem::path> list_all_filling_files(const std::filesystem::path& work) {
  return list_task_files(work / "holes", ".tsh");
}
std::vector<std::filesystem::path> list_filling_files(const std::filesystem::path& work) {
  std::vector<std::filesystem::path> files = list_all_filling_files(work);
  for (std::filesystem::path& file : files) {
    const std::filesystem::path kept = work / kept_filling_file_name(file.filename().string());
    if (std::filesystem::exists(kept)) file = kept;
  }
  return files;
}
std::string loop_file_name(std::size_t task, std::size_t batch) {
  return "loops/" + task_file_stem(task) + "-" + task_file_stem(batch) + ".tsl";
}
std::string filling_file_name(std::size_t batch) {
  return "holes/" + task_file_stem(batch) + ".tsh";
}
std::string kept_filling_file_name(const std::string& name) {
  return "holes-kept/" + name;
}

}  // namespace tessera
