#include "stream/stages/deform/deform_files.h"

namespace tessera {
namespace {

constexpr PackedKind kBaseKind = {"TSEBASE1", "a base surface"};
constexpr PackedKind kBasisKind = {"TSEBASI1", "a basis of an edit"};

enum Key : std::uint64_t {
  kPositions,
  kFaces,
  kRoles,
  kActive,
  kCentres,
  kReaches,
  kColumns,
  kTargets,
  kAbout,
  kBatches = 1000  ///< two of each batch
};

}  // namespace

void save_base(const std::filesystem::path& path, const BaseSurface& base) {
  PackedWriter file(path, kBaseKind);
  const std::vector<Section> sections = {file.append(bytes_of(base.position)),
                                         file.append(bytes_of(base.faces))};
  file.finish(sections);
}

BaseSurface load_base(const std::filesystem::path& path) {
  const PackedFile file(path, kBaseKind, sizeof(Section));
  const auto sections = file.table<Section>();
  return {file.load<Double3>(sections.at(0)), file.load<std::array<std::uint32_t, 3>>(sections.at(1))};
}

BasisWriter::BasisWriter(const std::filesystem::path& path, const DeformBasis& basis)
    : file_(path, kBasisKind) {
  put(kPositions, bytes_of(basis.base.position));
  put(kFaces, bytes_of(basis.base.faces));
  put(kRoles, bytes_of(basis.edit.role));
  put(kActive, bytes_of(basis.edit.active));
  put(kCentres, bytes_of(basis.edit.centre));
  put(kReaches, bytes_of(basis.edit.reach));
  put(kColumns, bytes_of(basis.edit.columns));
  put(kTargets, bytes_of(basis.edit.target));
}

void BasisWriter::put(std::uint64_t key, std::span<const std::byte> bytes) {
  table_.push_back({key, file_.append(bytes)});
}

void BasisWriter::add(const NormalDisplacements& batch) {
  put(kBatches + 2 * batches_, bytes_of(batch.of));
  put(kBatches + 2 * batches_ + 1, bytes_of(batch.rest));
  ++batches_;
}

std::uint64_t BasisWriter::finish(const std::string& about) {
  put(kAbout, std::as_bytes(std::span(about.data(), about.size())));
  return file_.finish(table_);
}

BasisReader::BasisReader(const std::filesystem::path& path)
    : file_(path, kBasisKind, sizeof(BasisWriter::Entry)) {
  for (const BasisWriter::Entry& e : file_.table<BasisWriter::Entry>()) sections_[e.key] = e.section;
  if (sections_.count(kAbout) == 0) file_.damaged(0, "it has no description");
}

template <class T>
std::vector<T> BasisReader::part(std::uint64_t key) const {
  const auto at = sections_.find(key);
  if (at == sections_.end()) file_.damaged(0, "a part is missing");
  return file_.load<T>(at->second);
}

std::string BasisReader::about() const {
  const std::vector<char> text = part<char>(kAbout);
  return {text.begin(), text.end()};
}

DeformBasis BasisReader::load() const {
  DeformBasis out;
  out.base = {part<Double3>(kPositions), part<std::array<std::uint32_t, 3>>(kFaces)};
  out.edit.role = part<std::int32_t>(kRoles);
  out.edit.active = part<std::int32_t>(kActive);
  out.edit.centre = part<Double3>(kCentres);
  out.edit.reach = part<double>(kReaches);
  out.edit.columns = part<double>(kColumns);
  out.edit.target = part<Double3>(kTargets);
  out.about = about();
  return out;
}

std::uint64_t BasisReader::batches() const {
  return sections_.rbegin()->first < kBatches ? 0 : (sections_.rbegin()->first - kBatches) / 2 + 1;
}

std::uint64_t BasisReader::bytes() const {
  std::uint64_t sum = 0;
  for (const auto& [key, section] : sections_)
    if (key < kBatches) sum += section.bytes;
  return sum;
}

NormalDisplacements BasisReader::batch(std::uint64_t batch) const {
  return {part<NormalDisplacement>(kBatches + 2 * batch), part<TangentRest>(kBatches + 2 * batch + 1)};
}

}  // namespace tessera
