#include "stream/points/point_overlay.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <string>

#include <xxhash.h>

#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr char kMagic[8] = {'T', 'S', 'N', 'O', 'R', 'M', 'L', '2'};

struct Footer {
  std::uint64_t table_offset = 0;
  std::uint64_t bricks = 0;
  std::uint64_t table_hash = 0;
  char magic[8] = {};
};

[[noreturn]] void damaged(const std::filesystem::path& path, const std::string& what) {
  throw InputError(path.string() + ": " + what + "; the work directory is damaged, run again with --force");
}

}  // namespace

struct OverlayFileWriter::Impl {
  explicit Impl(const std::filesystem::path& path) : file(path) { file.write(kMagic, sizeof kMagic); }
  DirectFile file;
  std::vector<OverlayBrick> table;
};

OverlayFileWriter::OverlayFileWriter(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}
OverlayFileWriter::~OverlayFileWriter() = default;

void OverlayFileWriter::brick(std::uint64_t key, std::span<const PointOverlayRecord> records,
                              const BrickOrientation& orientation) {
  DirectFile& file = impl_->file;
  OverlayBrick entry;
  entry.key = key;
  entry.points = static_cast<std::uint32_t>(records.size());
  entry.boundary = static_cast<std::uint32_t>(orientation.boundary.size());
  entry.patches = orientation.patches;
  entry.records = file.offset();
  file.write(records.data(), records.size_bytes());
  entry.surfels = file.offset();
  entry.votes = static_cast<std::uint32_t>(orientation.votes.size());
  entry.coarse = static_cast<std::uint32_t>(orientation.coarse.size());
  file.write(orientation.boundary.data(), orientation.boundary.size() * sizeof(Surfel));
  file.write(orientation.facts.data(), orientation.facts.size() * sizeof(PatchFacts));
  file.write(orientation.votes.data(), orientation.votes.size() * sizeof(PatchVote));
  file.write(orientation.coarse.data(), orientation.coarse.size() * sizeof(CoarseSurfel));
  entry.hash = XXH3_64bits(records.data(), records.size_bytes());
  impl_->table.push_back(entry);
}

std::uint64_t OverlayFileWriter::finish() {
  DirectFile& file = impl_->file;
  const auto& table = impl_->table;
  Footer footer;
  footer.table_offset = file.offset();
  footer.bricks = table.size();
  footer.table_hash = XXH3_64bits(table.data(), table.size() * sizeof(OverlayBrick));
  std::copy(std::begin(kMagic), std::end(kMagic), footer.magic);
  file.write(table.data(), table.size() * sizeof(OverlayBrick));
  file.write(&footer, sizeof footer);
  return file.finish();
}

void OverlayDecisions::save(const std::filesystem::path& path) const {
  DirectFile file(path);
  const std::uint64_t head[2] = {min_supporters, patch.size()};
  file.write(head, sizeof head);
  file.write(patch.data(), patch.size());
  file.finish();
}

OverlayDecisions OverlayDecisions::load(const std::filesystem::path& path) {
  const ReadFile file(path);
  std::uint64_t head[2];
  file.read_at(0, head, sizeof head);
  if (head[1] != file.size() - sizeof head) damaged(path, "length does not fit its header");
  OverlayDecisions d;
  d.min_supporters = static_cast<std::uint32_t>(head[0]);
  d.patch.resize(head[1]);
  file.read_at(sizeof head, d.patch.data(), d.patch.size());
  return d;
}

struct PointOverlay::Impl {
  std::vector<ReadFile> files;
  std::vector<std::size_t> file_end;  ///< brick index behind the last of each file
  std::vector<OverlayBrick> bricks;
  std::vector<std::uint64_t> first_patch;
  OverlayDecisions decisions;

  const ReadFile& file_of(std::size_t brick) const {
    return files[static_cast<std::size_t>(std::upper_bound(file_end.begin(), file_end.end(), brick) -
                                          file_end.begin())];
  }
};

PointOverlay::PointOverlay(const std::vector<std::filesystem::path>& paths)
    : impl_(std::make_unique<Impl>()) {
  for (const auto& path : paths) {
    ReadFile file(path);
    Footer footer;
    if (file.size() < sizeof footer + sizeof kMagic) damaged(path, "too short for a normals file");
    file.read_at(file.size() - sizeof footer, &footer, sizeof footer);
    const std::uint64_t bytes = footer.bricks * sizeof(OverlayBrick);
    if (!std::equal(std::begin(kMagic), std::end(kMagic), footer.magic) || footer.bricks > file.size() ||
        footer.table_offset + bytes + sizeof footer != file.size())
      damaged(path, "damaged footer");
    const std::size_t first = impl_->bricks.size();
    impl_->bricks.resize(first + footer.bricks);
    if (bytes != 0) file.read_at(footer.table_offset, impl_->bricks.data() + first, bytes);
    if (XXH3_64bits(impl_->bricks.data() + first, bytes) != footer.table_hash)
      damaged(path, "damaged brick table");
    impl_->files.push_back(std::move(file));
    impl_->file_end.push_back(impl_->bricks.size());
  }
  impl_->first_patch.push_back(0);
  for (const OverlayBrick& b : impl_->bricks)
    impl_->first_patch.push_back(impl_->first_patch.back() + b.patches);
}
PointOverlay::~PointOverlay() = default;

std::shared_ptr<const PointOverlay> PointOverlay::open(const std::filesystem::path& work) {
  if (!std::filesystem::exists(work / kDecisionsFile)) return nullptr;
  auto overlay = std::make_shared<PointOverlay>(list_task_files(work / kFolder, kExtension));
  overlay->impl_->decisions = OverlayDecisions::load(work / kDecisionsFile);
  if (overlay->impl_->decisions.patch.size() != overlay->first_patch().back())
    damaged(work / kDecisionsFile, "does not belong to these normals");
  return overlay;
}

std::span<const OverlayBrick> PointOverlay::bricks() const {
  return impl_->bricks;
}
std::size_t PointOverlay::file_count() const {
  return impl_->files.size();
}
std::span<const std::uint64_t> PointOverlay::first_patch() const {
  return impl_->first_patch;
}
std::pair<std::size_t, std::size_t> PointOverlay::file_range(std::size_t file) const {
  return {file == 0 ? 0 : impl_->file_end[file - 1], impl_->file_end[file]};
}

std::int64_t PointOverlay::find(std::uint64_t key) const {
  const auto& b = impl_->bricks;
  const auto it = std::lower_bound(b.begin(), b.end(), key,
                                   [](const OverlayBrick& e, std::uint64_t k) { return e.key < k; });
  return it == b.end() || it->key != key ? -1 : it - b.begin();
}

std::vector<Surfel> PointOverlay::load_boundary(std::size_t brick) const {
  const OverlayBrick& e = impl_->bricks[brick];
  std::vector<Surfel> surfels(e.boundary);
  impl_->file_of(brick).read_at(e.surfels, surfels.data(), surfels.size() * sizeof(Surfel));
  return surfels;
}

std::vector<PatchFacts> PointOverlay::load_facts(std::size_t brick) const {
  const OverlayBrick& e = impl_->bricks[brick];
  std::vector<PatchFacts> facts(e.patches);
  impl_->file_of(brick).read_at(e.surfels + e.boundary * sizeof(Surfel), facts.data(),
                                facts.size() * sizeof(PatchFacts));
  return facts;
}

std::vector<PatchVote> PointOverlay::load_votes(std::size_t brick) const {
  const OverlayBrick& e = impl_->bricks[brick];
  std::vector<PatchVote> votes(e.votes);
  impl_->file_of(brick).read_at(e.surfels + e.boundary * sizeof(Surfel) + e.patches * sizeof(PatchFacts),
                                votes.data(), votes.size() * sizeof(PatchVote));
  return votes;
}

std::vector<CoarseSurfel> PointOverlay::load_coarse(std::size_t brick) const {
  const OverlayBrick& e = impl_->bricks[brick];
  std::vector<CoarseSurfel> coarse(e.coarse);
  impl_->file_of(brick).read_at(
      e.surfels + e.boundary * sizeof(Surfel) + e.patches * sizeof(PatchFacts) + e.votes * sizeof(PatchVote),
      coarse.data(), coarse.size() * sizeof(CoarseSurfel));
  return coarse;
}

std::vector<PointOverlayRecord> PointOverlay::load_records(std::size_t brick, std::uint64_t first,
                                                           std::uint64_t count) const {
  const OverlayBrick& e = impl_->bricks[brick];
  assert(first + count <= e.points);
  std::vector<PointOverlayRecord> records(count);
  const ReadFile& file = impl_->file_of(brick);
  file.read_at(e.records + first * sizeof(PointOverlayRecord), records.data(),
               count * sizeof(PointOverlayRecord));
  if (count == e.points && XXH3_64bits(records.data(), count * sizeof(PointOverlayRecord)) != e.hash)
    damaged(file.path(), "brick " + std::to_string(e.key) + ": checksum of its normals differs");
  return records;
}

void PointOverlay::prefetch(std::uint64_t key) const {
  const std::int64_t at = find(key);
  if (at < 0) return;
  const auto brick = static_cast<std::size_t>(at);
  const OverlayBrick& e = impl_->bricks[brick];
  impl_->file_of(brick).will_need(e.records, e.points * sizeof(PointOverlayRecord));
}

void PointOverlay::apply(std::uint64_t key, std::uint64_t first, std::span<PointRecord> records) const {
  const std::int64_t at = find(key);
  if (at < 0) damaged(impl_->files.front().path(), "brick " + std::to_string(key) + " is missing");
  const auto brick = static_cast<std::size_t>(at);
  const std::vector<PointOverlayRecord> overlay = load_records(brick, first, records.size());
  const std::uint8_t* decided = impl_->decisions.patch.data() + impl_->first_patch[brick];
  for (std::size_t i = 0; i < records.size(); ++i) {
    const PointOverlayRecord& o = overlay[i];
    PointRecord& p = records[i];
    if (o.supporters < impl_->decisions.min_supporters) p.flags |= kPointOutlier;
    if (o.patch == kGivenPatch) continue;
    p.normal = o.normal;
    if (o.patch == kNoPatch) continue;
    if ((decided[o.patch] & kPatchFlip) == 0) continue;
    const Float3 n = decode_normal(o.normal);
    p.normal = encode_normal(-n[0], -n[1], -n[2]);
  }
}

}  // namespace tessera
