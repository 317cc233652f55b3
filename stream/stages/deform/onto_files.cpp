#include "stream/stages/deform/onto_files.h"

#include <array>

#include "stream/files/packed_file.h"

namespace tessera {
namespace {

constexpr PackedKind kCellsKind = {"TSSCELL1", "a file of a scan's planar cells"};
constexpr PackedKind kLatticeKind = {"TSDISPL1", "a file of a displacement"};

struct LatticeInfo {
  Double3 corner{};
  double spacing = 0.0;
  std::array<std::uint64_t, 3> nodes{};
};

template <class Record, class Info>
std::uint64_t save_records(const std::filesystem::path& path, const PackedKind& kind,
                           const std::vector<Record>& records, const Info& info) {
  PackedWriter file(path, kind);
  const std::vector<Section> sections = {file.append(bytes_of(records))};
  return file.finish(sections, std::as_bytes(std::span(&info, 1)));
}

template <class Record, class Info>
std::vector<Record> load_records(const std::filesystem::path& path, const PackedKind& kind, Info& info) {
  const PackedFile file(path, kind, sizeof(Section), sizeof(Info));
  std::copy(file.info().begin(), file.info().end(), std::as_writable_bytes(std::span(&info, 1)).begin());
  return file.load<Record>(file.table<Section>().at(0));
}

}  // namespace

std::uint64_t save_scan_cells(const std::filesystem::path& path, const ScanCells& cells) {
  return save_records(path, kCellsKind, cells.cells, cells.edge);
}

ScanCells load_scan_cells(const std::filesystem::path& path) {
  ScanCells out;
  out.cells = load_records<PlaneCell>(path, kCellsKind, out.edge);
  return out;
}

std::uint64_t save_lattice(const std::filesystem::path& path, const DisplacementLattice& lattice) {
  return save_records(
      path, kLatticeKind, lattice.coefficient,
      LatticeInfo{lattice.corner, lattice.spacing, {lattice.nodes[0], lattice.nodes[1], lattice.nodes[2]}});
}

DisplacementLattice load_lattice(const std::filesystem::path& path) {
  LatticeInfo info;
  DisplacementLattice out;
  out.coefficient = load_records<Double3>(path, kLatticeKind, info);
  out.corner = info.corner;
  out.spacing = info.spacing;
  for (std::size_t a = 0; a < 3; ++a) out.nodes[a] = static_cast<std::size_t>(info.nodes[a]);
  return out;
}

}  // namespace tessera
