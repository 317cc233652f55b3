#include "stream/stages/deform/deform_files.h"

namespace tessera {
namespace {

constexpr PackedKind kBaseKind = {"TSEBASE4", "a base surface"};
constexpr PackedKind kBasisKind = {"TSEBASI3", "a basis of an edit"};

enum Key : std::uint64_t {
  kPositions,
  kFaces,
  kRoles,
  kActive,
  kCentres,
  kRadii,
  kColumns,
  kTargets,
  kAbout,
  kRotations,
  kGivenFaces,
  kLevels = 100,   ///< kLevelParts of each level
  kBatches = 1000  ///< two of each batch
};
enum LevelPart : std::uint64_t {
  kSurface,
  kCoarseFaces,
  kFree,
  kOn,
  kWeights,
  kFiner,
  kFinerRest,
  kLevelParts
};

}  // namespace

void save_base(const std::filesystem::path& path, const BaseSurface& base) {
  PackedWriter file(path, kBaseKind);
  const std::vector<double> split = {base.split_edge, static_cast<double>(base.given_crossings)};
  const std::vector<Section> sections = {file.append(bytes_of(base.position)),
                                         file.append(bytes_of(base.faces)), file.append(bytes_of(base.sharp)),
                                         file.append(bytes_of(split)),
                                         file.append(bytes_of(base.given_faces))};
  file.finish(sections);
}

BaseSurface load_base(const std::filesystem::path& path) {
  const PackedFile file(path, kBaseKind, sizeof(Section));
  const auto sections = file.table<Section>();
  const auto split = file.load<double>(sections.at(3));
  return {file.load<Double3>(sections.at(0)),      file.load<std::array<std::uint32_t, 3>>(sections.at(1)),
          file.load<Double3>(sections.at(2)),      split.at(0),
          static_cast<std::uint64_t>(split.at(1)), file.load<std::array<std::uint32_t, 3>>(sections.at(4))};
}

BasisWriter::BasisWriter(const std::filesystem::path& path, const DeformBasis& basis)
    : file_(path, kBasisKind) {
  put(kPositions, bytes_of(basis.base.position));
  put(kFaces, bytes_of(basis.base.faces));
  put(kGivenFaces, bytes_of(basis.base.given_faces));
  put(kRoles, bytes_of(basis.edit.role));
  put(kActive, bytes_of(basis.edit.active));
  put(kCentres, bytes_of(basis.edit.centre));
  put(kRadii, bytes_of(basis.edit.radius));
  put(kColumns, bytes_of(basis.edit.columns));
  put(kTargets, bytes_of(basis.edit.target));
  put(kRotations, bytes_of(basis.edit.rotation_columns));
  for (std::uint64_t k = 0; k < basis.levels.size(); ++k) {
    const LayerLevel& l = basis.levels[k];
    const std::uint64_t from = kLevels + k * kLevelParts;
    put(from + kSurface, bytes_of(l.coarse.surface));
    put(from + kCoarseFaces, bytes_of(l.coarse.faces));
    put(from + kFree, bytes_of(l.coarse.free));
    put(from + kOn, bytes_of(l.coarse.on));
    put(from + kWeights, bytes_of(l.coarse.weight));
    put(from + kFiner, bytes_of(l.finer.of));
    put(from + kFinerRest, bytes_of(l.finer.rest));
  }
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
  out.base = {part<Double3>(kPositions), part<std::array<std::uint32_t, 3>>(kFaces), {}};
  out.base.given_faces = part<std::array<std::uint32_t, 3>>(kGivenFaces);
  out.edit.role = part<std::int32_t>(kRoles);
  out.edit.active = part<std::int32_t>(kActive);
  out.edit.centre = part<Double3>(kCentres);
  out.edit.radius = part<double>(kRadii);
  out.edit.columns = part<double>(kColumns);
  out.edit.target = part<Double3>(kTargets);
  out.edit.rotation_columns = part<float>(kRotations);
  for (std::uint64_t from = kLevels; sections_.count(from) != 0; from += kLevelParts)
    out.levels.push_back(
        {{part<Double3>(from + kSurface), part<std::array<std::uint32_t, 3>>(from + kCoarseFaces),
          part<std::uint8_t>(from + kFree), part<std::array<std::uint32_t, 3>>(from + kOn),
          part<std::array<double, 3>>(from + kWeights)},
         {part<NormalDisplacement>(from + kFiner), part<TangentRest>(from + kFinerRest)}});
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
