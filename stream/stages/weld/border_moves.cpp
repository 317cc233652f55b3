#include "stream/stages/weld/border_moves.h"

#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kKind = {"TSBORDR1", "a file of border moves"};

}  // namespace

BorderMovesWriter::BorderMovesWriter(const std::filesystem::path& path)
    : file_(path, kKind, std::size_t{1} << 18) {}

void BorderMovesWriter::add(std::uint64_t brick, const std::vector<MovedVertex>& moves) {
  if (!moves.empty()) table_.push_back({brick, file_.append(bytes_of(moves))});
}

std::uint64_t BorderMovesWriter::finish() {
  return file_.finish(table_);
}

BorderMoves::BorderMoves(const std::filesystem::path& work, const char* folder)
    : tables_(list_task_files(work / folder, ".tsb"), kKind) {}

void BorderMoves::apply(std::uint64_t brick, std::vector<Float3>& position) const {
  const auto* entry = tables_.find(brick);
  if (!entry) return;
  for (const MovedVertex& m : tables_.file_of(*entry).load<MovedVertex>(entry->moves))
    position.at(m.vertex) = m.to;
}

std::string border_moves_file_name(std::size_t task, const char* folder) {
  return std::string(folder) + "/" + task_file_stem(task) + ".tsb";
}

}  // namespace tessera
