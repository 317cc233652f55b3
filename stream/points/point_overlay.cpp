#include "stream/points/point_overlay.h"

#include <cstring>
#include <numeric>
#include <string>

#include "octree/error.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kNormalKind = {"TSNORML4", "a file of normals"};
constexpr PackedKind kDecisionsKind = {"TSDECID2", "a file of orientation decisions"};

}  // namespace

Section OverlayBrick::section(Part part) const {
  const std::uint64_t bytes[] = {points * sizeof(PointOverlayRecord), boundary * sizeof(Surfel),
                                 patches * sizeof(PatchStats), votes * sizeof(PatchVote),
                                 coarse * sizeof(CoarseSurfel)};
  return {std::accumulate(bytes, bytes + part, offset), bytes[part], hash[part]};
}

OverlayFileWriter::OverlayFileWriter(const std::filesystem::path& path) : file_(path, kNormalKind) {}

void OverlayFileWriter::brick(std::uint64_t key, std::span<const PointOverlayRecord> records,
                              const BrickOrientation& orientation) {
  OverlayBrick e;
  e.key = key;
  e.points = static_cast<std::uint32_t>(records.size());
  e.boundary = static_cast<std::uint32_t>(orientation.boundary.size());
  e.patches = static_cast<std::uint32_t>(orientation.stats.size());
  e.votes = static_cast<std::uint32_t>(orientation.votes.size());
  e.coarse = static_cast<std::uint32_t>(orientation.coarse.size());
  const Section first = file_.append(std::as_bytes(records));
  e.offset = first.offset;
  e.hash = {first.hash, file_.append(bytes_of(orientation.boundary)).hash,
            file_.append(bytes_of(orientation.stats)).hash, file_.append(bytes_of(orientation.votes)).hash,
            file_.append(bytes_of(orientation.coarse)).hash};
  table_.push_back(e);
}

const char* name_of(VolumetricUse volumetric) {
  return volumetric == VolumetricUse::kDrop     ? "dropped"
         : volumetric == VolumetricUse::kBodies ? "bodies"
         : volumetric == VolumetricUse::kTop    ? "top"
                                                : "surface";
}

void OverlayDecisions::save(const std::filesystem::path& path) const {
  PackedWriter file(path, kDecisionsKind);
  const std::vector<Section> table = {file.append(bytes_of(patch))};
  const std::array<std::uint32_t, 2> limits = {min_supporters, static_cast<std::uint32_t>(volumetric)};
  file.finish(table, std::as_bytes(std::span(limits)));
}

OverlayDecisions OverlayDecisions::load(const std::filesystem::path& path) {
  OverlayDecisions d;
  std::array<std::uint32_t, 2> limits{};
  const PackedFile file(path, kDecisionsKind, sizeof(Section), sizeof limits);
  std::memcpy(limits.data(), file.info().data(), sizeof limits);
  d.min_supporters = limits[0], d.volumetric = static_cast<VolumetricUse>(limits[1]);
  d.patch = file.load<std::uint8_t>(file.table<Section>().at(0));
  return d;
}

struct PointOverlay::Impl {
  PackedTables<OverlayBrick> bricks;
  std::vector<std::uint64_t> first_patch;
  OverlayDecisions decisions;

  template <class T>
  std::vector<T> load(std::size_t brick, OverlayBrick::Part part) const {
    return bricks.file_of(brick).load<T>(bricks[brick].section(part));
  }
};

PointOverlay::PointOverlay(const std::vector<std::filesystem::path>& paths)
    : impl_(new Impl{{paths, kNormalKind}, {0}, {}}) {
  for (const OverlayBrick& b : bricks()) impl_->first_patch.push_back(impl_->first_patch.back() + b.patches);
}
PointOverlay::~PointOverlay() = default;

std::shared_ptr<const PointOverlay> PointOverlay::open(const std::filesystem::path& work) {
  const std::filesystem::path decisions = work / kDecisionsFile;
  if (!std::filesystem::exists(decisions)) return nullptr;
  auto overlay = std::make_shared<PointOverlay>(list_task_files(work / kFolder, kExtension));
  overlay->impl_->decisions = OverlayDecisions::load(decisions);
  if (overlay->impl_->decisions.patch.size() != overlay->first_patch().back())
    throw InputError(decisions.string() + ": does not belong to these normals; run again with --force");
  return overlay;
}

std::span<const OverlayBrick> PointOverlay::bricks() const {
  return impl_->bricks.entries();
}
std::size_t PointOverlay::file_count() const {
  return impl_->bricks.file_count();
}
std::span<const std::uint64_t> PointOverlay::first_patch() const {
  return impl_->first_patch;
}
std::pair<std::size_t, std::size_t> PointOverlay::file_range(std::size_t file) const {
  return impl_->bricks.file_range(file);
}
std::int64_t PointOverlay::find(std::uint64_t key) const {
  return impl_->bricks.index_of(key);
}

std::vector<Surfel> PointOverlay::load_boundary(std::size_t brick) const {
  return impl_->load<Surfel>(brick, OverlayBrick::kBoundary);
}
std::vector<PatchStats> PointOverlay::load_stats(std::size_t brick) const {
  return impl_->load<PatchStats>(brick, OverlayBrick::kStats);
}
std::vector<PatchVote> PointOverlay::load_votes(std::size_t brick) const {
  return impl_->load<PatchVote>(brick, OverlayBrick::kVotes);
}
std::vector<CoarseSurfel> PointOverlay::load_coarse(std::size_t brick) const {
  return impl_->load<CoarseSurfel>(brick, OverlayBrick::kCoarse);
}

std::vector<PointOverlayRecord> PointOverlay::load_records(std::size_t brick, std::uint64_t first,
                                                           std::uint64_t count) const {
  const OverlayBrick& e = impl_->bricks[brick];
  const Section all = e.section(OverlayBrick::kRecords);
  std::vector<PointOverlayRecord> records(count);
  if (count == e.points)
    impl_->bricks.file_of(brick).read(all, {buffer_of(records)});
  else
    impl_->bricks.file_of(brick).read_part(all, first * sizeof(PointOverlayRecord), records.data(),
                                           count * sizeof(PointOverlayRecord));
  return records;
}

VolumetricUse OverlayDecisions::use_of(const PointOverlayRecord& point) const {
  const std::uint16_t strewn =
      volumetric == VolumetricUse::kBodies ? kVolumetric | kAmongVolumetric : kVolumetric;
  return (point.supporters & strewn) != 0 ? volumetric : VolumetricUse::kSurface;
}

bool OverlayDecisions::shows_side(const PointOverlayRecord& point) const {
  return use_of(point) == VolumetricUse::kSurface && (point.supporters & kSupporters) >= min_supporters;
}

VolumetricUse PointOverlay::volumetric() const {
  return impl_->decisions.volumetric;
}

void PointOverlay::prefetch(std::uint64_t key) const {
  if (const OverlayBrick* e = impl_->bricks.find(key))
    impl_->bricks.file_of(*e).will_need(e->section(OverlayBrick::kRecords));
}

void PointOverlay::apply(std::uint64_t key, std::uint64_t first, std::span<PointRecord> records) const {
  const std::int64_t at = find(key);
  if (at < 0)
    throw InputError("the normals of brick " + std::to_string(key) +
                     " are missing; the work directory is damaged, run again with --force");
  const auto brick = static_cast<std::size_t>(at);
  const std::vector<PointOverlayRecord> overlay = load_records(brick, first, records.size());
  const std::uint8_t* decided = impl_->decisions.patch.data() + impl_->first_patch[brick];
  for (std::size_t i = 0; i < records.size(); ++i) {
    const PointOverlayRecord& o = overlay[i];
    PointRecord& p = records[i];
    const OverlayDecisions& d = impl_->decisions;
    const VolumetricUse volumetric = d.use_of(o);
    if (volumetric == VolumetricUse::kDrop || (o.supporters & kSupporters) < d.min_supporters)
      p.flags |= kPointOutlier;
    if (volumetric == VolumetricUse::kTop) p.flags |= kPointVolumetric;
    if (volumetric == VolumetricUse::kBodies) {
      p.normal = kNoNormal;
      continue;
    }
    if (o.patch == kGivenPatch) continue;
    p.normal = o.normal;
    if (o.patch == kNoPatch) continue;
    if ((decided[o.patch] & kPatchFlip) == 0) continue;
    const Float3 n = decode_normal(o.normal);
    p.normal = encode_normal(-n[0], -n[1], -n[2]);
  }
}

}  // namespace tessera
