#include "stream/files/packed_file.h"

#include <cassert>
#include <cstddef>
#include <cstring>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr std::size_t kMagicBytes = 8;

struct Footer {
  std::uint64_t table_offset = 0;
  std::uint64_t entries = 0;
  std::uint64_t entry_bytes = 0;
  std::uint64_t info_bytes = 0;
  std::uint64_t table_hash = 0;  ///< XXH3 of the table
  std::uint64_t reserved = 0;
  std::uint64_t hash = 0;  ///< XXH3 of the info and the fields above
  char magic[kMagicBytes] = {};
};
static_assert(sizeof(Footer) == 64);

class Hasher {
 public:
  Hasher() { XXH3_64bits_reset(&state_); }
  void add(const void* data, std::size_t bytes) { XXH3_64bits_update(&state_, data, bytes); }
  std::uint64_t value() const { return XXH3_64bits_digest(&state_); }

 private:
  XXH3_state_t state_;
};

std::uint64_t hash_of(std::span<const std::byte> data) {
  return XXH3_64bits(data.data(), data.size());
}

std::uint64_t hash_of(std::span<const std::byte> info, const Footer& footer) {
  Hasher hash;
  hash.add(info.data(), info.size());
  hash.add(&footer, offsetof(Footer, hash));
  return hash.value();
}

}  // namespace

PackedWriter::PackedWriter(const std::filesystem::path& path, const PackedKind& kind,
                           std::size_t buffer_bytes)
    : kind_(kind), file_(path, buffer_bytes) {
  file_.write(kind_.magic, kMagicBytes);
}

Section PackedWriter::append(std::initializer_list<std::span<const std::byte>> parts) {
  Section section{file_.offset(), 0, 0};
  Hasher hash;
  for (const auto& part : parts) {
    if (parts.size() > 1) hash.add(part.data(), part.size());
    file_.write(part.data(), part.size());
    section.bytes += part.size();
  }
  section.hash = parts.size() == 1 ? hash_of(*parts.begin()) : hash.value();
  return section;
}

std::uint64_t PackedWriter::finish(std::span<const std::byte> table, std::uint64_t entry_bytes,
                                   std::span<const std::byte> info) {
  Footer footer;
  footer.table_offset = file_.offset();
  footer.entries = table.size() / entry_bytes;
  footer.entry_bytes = entry_bytes;
  footer.info_bytes = info.size();
  footer.table_hash = hash_of(table);
  footer.hash = hash_of(info, footer);
  std::memcpy(footer.magic, kind_.magic, kMagicBytes);
  file_.write(table.data(), table.size());
  file_.write(info.data(), info.size());
  file_.write(&footer, sizeof footer);
  return file_.finish();
}

PackedFile::PackedFile(const std::filesystem::path& path, const PackedKind& kind, std::size_t entry_bytes,
                       std::size_t info_bytes)
    : file_(path), info_(info_bytes) {
  const std::string name = kind.name;
  char magic[kMagicBytes] = {};
  Footer footer;
  file_.read_at(0, magic, std::min<std::uint64_t>(file_.size(), kMagicBytes));
  if (file_.size() < kMagicBytes + info_bytes + sizeof footer) damaged(file_.size(), "too short for " + name);
  if (std::memcmp(magic, kind.magic, kMagicBytes) != 0) damaged(0, "not " + name + " of this version");
  const std::uint64_t end = file_.size() - sizeof footer;
  file_.read_at(end, &footer, sizeof footer);
  file_.read_at(end - info_bytes, info_.data(), info_bytes);
  if (std::memcmp(footer.magic, kind.magic, kMagicBytes) != 0)
    damaged(end, "no footer of " + name + ", it is cut short");
  if (footer.hash != hash_of(info_, footer)) damaged(end, "damaged footer (checksum)");
  if (footer.entry_bytes != entry_bytes || footer.info_bytes != info_bytes)
    damaged(end, "not " + name + " of this version");
  if (footer.entries > file_.size() / entry_bytes ||
      footer.table_offset + footer.entries * entry_bytes + info_bytes != end)
    damaged(end, "the table does not fit the file");
  entries_ = footer.entries;
  table_offset_ = footer.table_offset;
  table_hash_ = footer.table_hash;
}

void PackedFile::damaged(std::uint64_t offset, const std::string& what) const {
  throw InputError(path().string() + ": byte " + std::to_string(offset) + ": " + what +
                   "; the work directory is damaged, run again with --force");
}

void throw_out_of_order(const std::filesystem::path& path, std::uint64_t key) {
  throw InputError(path.string() + ": brick " + std::to_string(key) +
                   " is out of order: files of different jobs were mixed; run again with --force");
}

void PackedFile::read_table(std::span<std::byte> to) const {
  file_.read_at(table_offset_, to.data(), to.size());
  if (hash_of(to) != table_hash_) damaged(table_offset_, "damaged table (checksum)");
}

void PackedFile::check(const Section& section, std::uint64_t hash) const {
  if (hash != section.hash) damaged(section.offset, "damaged section (checksum)");
}

void PackedFile::read_part(const Section& section, std::uint64_t from, void* to, std::uint64_t bytes) const {
  assert(from + bytes <= section.bytes);
  if (section.bytes > table_offset_ || section.offset > table_offset_ - section.bytes)
    damaged(section.offset,
            "a section of " + std::to_string(section.bytes) + " bytes reaches out of the file");
  file_.read_at(section.offset + from, to, bytes);
}

void PackedFile::read(const Section& section, std::initializer_list<std::span<std::byte>> parts) const {
  std::uint64_t done = 0;
  Hasher hash;
  for (const auto& part : parts) {
    read_part(section, done, part.data(), part.size());
    if (parts.size() > 1) hash.add(part.data(), part.size());
    done += part.size();
  }
  assert(done == section.bytes);
  check(section, parts.size() == 1 ? hash_of(*parts.begin()) : hash.value());
}

struct SectionReader::Hash : Hasher {};

SectionReader::SectionReader(const PackedFile& file, const Section& section)
    : file_(file), section_(section), hash_(std::make_unique<Hash>()) {}
SectionReader::~SectionReader() = default;

void SectionReader::next(void* to, std::uint64_t bytes) {
  file_.read_part(section_, done_, to, bytes);
  hash_->add(to, bytes);
  done_ += bytes;
  if (left() == 0) file_.check(section_, hash_->value());
}

}  // namespace tessera
