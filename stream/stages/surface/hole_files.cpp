#include "stream/stages/surface/hole_files.h"

#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr std::size_t kBuffer = std::size_t{1} << 20;

/// Vectors one after the other; their sizes are known from what was read before.
class Cursor {
 public:
  explicit Cursor(const std::filesystem::path& path) : file_(path) {}
  template <class T>
  void take(std::vector<T>& values, std::uint64_t count) {
    values.resize(count);
    take(values.data(), count * sizeof(T));
  }
  void take(void* to, std::uint64_t bytes) {
    if (bytes != 0) file_.read_at(at_, to, bytes);
    at_ += bytes;
  }

 private:
  ReadFile file_;
  std::uint64_t at_ = 0;
};

template <class T>
void put(DirectFile& file, const std::vector<T>& values) {
  if (!values.empty()) file.write(values.data(), values.size() * sizeof(T));
}

struct LoopHead {
  std::uint32_t edges = 0;
  std::uint32_t taken = 0;
  std::uint32_t coloured = 0;
  std::uint32_t unused = 0;
};

}  // namespace

void save_loops(const std::filesystem::path& path, const std::vector<NamedLoop>& loops) {
  DirectFile file(path, kBuffer);
  const std::uint64_t count = loops.size();
  file.write(&count, sizeof count);
  for (const NamedLoop& l : loops) {
    const LoopHead head = {static_cast<std::uint32_t>(l.vertex.size()),
                           static_cast<std::uint32_t>(l.loop.taken.size()),
                           static_cast<std::uint32_t>(l.loop.rgba.size()), 0};
    file.write(&head, sizeof head);
    put(file, l.vertex);
    put(file, l.loop.position);
    put(file, l.loop.opposite);
    put(file, l.loop.taken);
    put(file, l.loop.rgba);
  }
  file.finish();
}

std::vector<NamedLoop> load_loops(const std::filesystem::path& path) {
  Cursor in(path);
  std::uint64_t count = 0;
  in.take(&count, sizeof count);
  std::vector<NamedLoop> loops(count);
  for (NamedLoop& l : loops) {
    LoopHead head;
    in.take(&head, sizeof head);
    in.take(l.vertex, head.edges);
    in.take(l.loop.position, head.edges);
    in.take(l.loop.opposite, head.edges);
    in.take(l.loop.taken, head.taken);
    in.take(l.loop.rgba, head.coloured);
  }
  return loops;
}

void HoleFillings::save(const std::filesystem::path& path) const {
  DirectFile file(path, kBuffer);
  const HoleFillingsHead head = {position.size(), rgba.size(), faces.size()};
  file.write(&head, sizeof head);
  put(file, position);
  put(file, rgba);
  put(file, faces);
  file.finish();
}

HoleFillings HoleFillings::load(const std::filesystem::path& path) {
  Cursor in(path);
  HoleFillingsHead head;
  in.take(&head, sizeof head);
  HoleFillings out;
  in.take(out.position, head.vertices);
  in.take(out.rgba, head.coloured);
  in.take(out.faces, head.faces);
  return out;
}

HoleFillingsHead load_fillings_head(const std::filesystem::path& path) {
  HoleFillingsHead head;
  ReadFile(path).read_at(0, &head, sizeof head);
  return head;
}

std::vector<std::filesystem::path> list_loop_files(const std::filesystem::path& work) {
  return list_task_files(work / "loops", ".tsl");
}
std::vector<std::filesystem::path> list_filling_files(const std::filesystem::path& work) {
  return list_task_files(work / "holes", ".tsh");
}
std::string loop_file_name(std::size_t batch) {
  return "loops/" + task_file_stem(batch) + ".tsl";
}
std::string filling_file_name(std::size_t batch) {
  return "holes/" + task_file_stem(batch) + ".tsh";
}

}  // namespace tessera
