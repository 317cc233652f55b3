#include "stream/survey/copc_copy.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "octree/error.h"
#include "stream/formats/copc/copc_body.h"
#include "stream/formats/points/projection.h"
#include "stream/formats/scalar.h"

namespace tessera {
namespace {

constexpr std::size_t kHead = 375, kRecordHead = 54, kInfo = kCopcInfoBytes;
constexpr std::uint64_t kSortBytes = std::uint64_t{64} << 20;

std::size_t las_format_bytes(int format) {
  return laz::schema_for(format, 0, laz::Schema::kVariable).record_bytes();
}

template <class T>
void put_at(char* at, T value) {
  std::memcpy(at, &value, sizeof value);
}

int require_copc_format(const LasRecords& from, const std::filesystem::path& to) {
  const int format = copc_point_format(from.header().point_format);
  if (format < 0)
    throw UsageError(to.string() + ": COPC has no waveforms, and " + from.file().path().string() +
                     " has some; write .laz");
  return format;
}

std::string_view user_of(const char* head) {
  const std::string_view user(head + 2, 16);
  return user.substr(0, user.find('\0'));
}

/// Whether a record of the source is written anew or says nothing of the copy.
bool is_replaced(const char* head, bool wkt) {
  const std::string_view user = user_of(head);
  const auto id = load_scalar<std::uint16_t>(head + 18);
  if (user == laz::Schema::kUserId || user == "copc") return true;
  return user == "LASF_Projection" && wkt && (id == 2112 || (id >= 34735 && id <= 34737));
}

}  // namespace

int copc_point_format(int las_format) {
  constexpr std::array<int, 11> kFormats = {6, 6, 7, 7, -1, -1, 6, 7, 8, -1, -1};
  return las_format >= 0 && las_format <= 10 ? kFormats[static_cast<std::size_t>(las_format)] : -1;
}

void upgrade_las_record(const char* from, std::size_t from_bytes, int from_format, char* to) {
  const std::size_t old_bytes = las_format_bytes(from_format),
                    new_bytes = las_format_bytes(copc_point_format(from_format));
  std::memset(to, 0, new_bytes);
  std::memcpy(to, from, 14);  // position, intensity
  const auto returns = static_cast<unsigned char>(from[14]), kind = static_cast<unsigned char>(from[15]);
  to[14] = static_cast<char>((returns & 7u) | (returns >> 3 & 7u) << 4);
  to[15] = static_cast<char>(kind >> 5 | (returns >> 6 & 3u) << 6);
  to[16] = static_cast<char>(kind & 31u);
  to[17] = from[17];
  put_at(to + 18, static_cast<std::int16_t>(std::lround(load_scalar<std::int8_t>(from + 16) / 0.006)));
  std::memcpy(to + 20, from + 18, 2);
  const bool timed = from_format == 1 || from_format == 3;
  if (timed) std::memcpy(to + 22, from + 20, 8);
  if (from_format >= 2) std::memcpy(to + 30, from + (timed ? 28 : 20), 6);
  std::memcpy(to + new_bytes, from + old_bytes, from_bytes - old_bytes);
}

std::uint64_t CopcCopy::bytes(const LasRecords& from) {
  return OutputFile::kBufferBytes + kSortBytes + 3 * kCopcGroupBytes +
         CopcNodes::kLeafPoints * 2 * (from.record_bytes() + 16) + (std::uint64_t{16} << 20);
}

CopcCopy::CopcCopy(const LasRecords& from, const std::filesystem::path& to)
    : from_(from),
      file_(to),
      format_(require_copc_format(from, to)),
      record_bytes_(from.record_bytes() - las_format_bytes(from.header().point_format) +
                    las_format_bytes(format_)),
      schema_(laz::schema_for(format_, record_bytes_ - las_format_bytes(format_), laz::Schema::kVariable)),
      nodes_(to.has_parent_path() ? to.parent_path() : ".", record_bytes_, kSortBytes) {
  write_records();
}

void CopcCopy::append_record(std::string_view user, std::uint16_t id, std::string_view description,
                             std::string_view data) {
  std::array<char, kRecordHead> head{};
  std::memcpy(&head[2], user.data(), user.size());
  put_at(&head[18], id);
  put_at(&head[20], static_cast<std::uint16_t>(data.size()));
  std::memcpy(&head[22], description.data(), std::min<std::size_t>(description.size(), 32));
  file_.append(head.data(), head.size());
  file_.append(data);
  ++records_;
}

/// Header and records before the points: that of COPC first, as it must be.
void CopcCopy::write_records() {
  file_.append(std::string(kHead, '\0'));
  append_record("copc", 1, "COPC info VLR", std::string(kInfo, '\0'));
  const std::vector<char> laszip = laz::schema_record(schema_);
  append_record(laz::Schema::kUserId, laz::Schema::kRecordId, "", {laszip.data(), laszip.size()});
  const Crs& crs = from_.header().info.crs;
  std::string wkt = crs.wkt;
  if (wkt.empty() && crs.horizontal > 0)
    wkt = user_crs("EPSG:" + std::to_string(crs.horizontal),
                   "the coordinate system of " + from_.file().path().string())
              .wkt;
  wkt_ = !wkt.empty() && wkt.size() < 0xffff;
  if (wkt_) append_record("LASF_Projection", 2112, "OGC WKT", wkt + std::string(1, '\0'));
  const ReadFile file = from_.file().open();
  const LasHeader& header = from_.header();
  std::uint64_t at = header.records_at;
  for (std::uint32_t i = 0; i < header.record_count && at + kRecordHead <= header.begin; ++i) {
    char head[kRecordHead];
    file.read_at(at, head, sizeof head);
    const std::uint64_t end = at + kRecordHead + load_scalar<std::uint16_t>(head + 20);
    if (end > header.begin) break;
    std::string all(static_cast<std::size_t>(end - at), '\0');
    file.read_at(at, all.data(), all.size());
    if (!is_replaced(head, wkt_)) file_.append(all), ++records_;
    at = end;
  }
  begin_ = file_.size();
  file_.append(std::string_view("\0\0\0\0\0\0\0\0", 8));  // where the chunk table begins, known in the end
}

void CopcCopy::append(const char* records, std::size_t count) {
  const std::size_t stride = from_.record_bytes();
  upgraded_.resize(count * record_bytes_);
  for (std::size_t i = 0; i < count; ++i) {
    char* const to = upgraded_.data() + i * record_bytes_;
    if (format_ == from_.header().point_format)
      std::memcpy(to, records + i * stride, stride);
    else
      upgrade_las_record(records + i * stride, stride, from_.header().point_format, to);
    for (std::size_t a = 0; a < 3; ++a) {
      const auto p = load_scalar<std::int32_t>(to + 4 * a);
      low_[a] = points_ == 0 ? p : std::min(low_[a], p);
      high_[a] = points_ == 0 ? p : std::max(high_[a], p);
    }
    const auto time = load_scalar<double>(to + 22);
    if (points_ == 0) first_time_ = last_time_ = time;
    if (time < first_time_) first_time_ = time;
    if (time > last_time_) last_time_ = time;
    const unsigned number = static_cast<unsigned char>(to[14]) & 15u;
    if (number > 0) ++by_return_[number - 1];
    ++points_;
  }
  nodes_.add(upgraded_);
}

void CopcCopy::write_nodes() {
  Double3 scale, offset;
  for (std::size_t a = 0; a < 3; ++a)
    scale[a] = from_.header().info.grid.step[a], offset[a] = from_.header().info.grid.shift[a];
  nodes_.build(scale, offset, file_.path());
  const CopcBody body = append_copc_body(file_, schema_, nodes_, begin_, {first_time_, last_time_});
  file_.patch(kHead + kRecordHead, body.info.data(), body.info.size());
  hierarchy_at_ = body.hierarchy_at;
}

/// Identity, days and the kind of times are those of the source.
void CopcCopy::write_header() {
  char old[LasField::kHeader12] = {};
  const ReadFile file = from_.file().open();
  file.read_at(0, old, std::min<std::uint64_t>(sizeof old, file.size()));
  std::array<char, kHead> h{};
  std::memcpy(h.data(), old, 94);
  const auto encoding = load_scalar<std::uint16_t>(old + LasField::kGlobalEncoding);
  put_at(&h[LasField::kGlobalEncoding],
         static_cast<std::uint16_t>((encoding & 1u) | (wkt_ ? 16u : encoding & 16u)));
  h[LasField::kVersionMajor] = 1, h[LasField::kVersionMinor] = 4;
  put_at(&h[LasField::kHeaderSize], static_cast<std::uint16_t>(kHead));
  put_at(&h[LasField::kPointOffset], static_cast<std::uint32_t>(begin_));
  put_at(&h[LasField::kRecordCount], records_);
  h[LasField::kPointFormat] = static_cast<char>(format_ | 0x80);
  put_at(&h[LasField::kRecordLength], static_cast<std::uint16_t>(record_bytes_));
  std::memcpy(&h[LasField::kScale], old + LasField::kScale, 48);
  for (std::size_t a = 0; a < 3; ++a) {
    const PositionGrid& grid = from_.header().info.grid;
    put_at(&h[LasField::kBounds + 16 * a], high_[a] * grid.step[a] + grid.shift[a]);
    put_at(&h[LasField::kBounds + 16 * a + 8], low_[a] * grid.step[a] + grid.shift[a]);
  }
  put_at(&h[LasField::kFirstEvlr], hierarchy_at_);
  put_at(&h[LasField::kEvlrCount], std::uint32_t{1});
  put_at(&h[LasField::kCount], points_);
  for (std::size_t r = 0; r < by_return_.size(); ++r) put_at(&h[255 + 8 * r], by_return_[r]);
  file_.patch(0, h.data(), h.size());
}

std::uint64_t CopcCopy::finish() {
  write_nodes();
  write_header();
  const std::uint64_t size = file_.size();
  from_.file().open().require_unchanged();
  file_.finish();
  return size;
}

}  // namespace tessera
