#include "stream/formats/points/las_header.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "octree/error.h"
#include "stream/formats/points/crs.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

struct PointFormat {
  std::size_t bytes;
  int colour;             ///< byte offset of red, -1 without
  std::uint8_t withheld;  ///< bit in byte 15
};
constexpr int kFirstWideFormat = 6;
constexpr std::array kPointFormats = {
    PointFormat{20, -1, 0x80}, PointFormat{28, -1, 0x80}, PointFormat{26, 20, 0x80},
    PointFormat{34, 28, 0x80}, PointFormat{57, -1, 0x80}, PointFormat{63, 28, 0x80},
    PointFormat{30, -1, 0x04}, PointFormat{36, 30, 0x04}, PointFormat{38, 30, 0x04},
    PointFormat{59, -1, 0x04}, PointFormat{67, 30, 0x04},
};
constexpr int kCompressedBit = 0x80;  ///< of the point format

/// Places in a description of extra bytes (LAS Specification 1.4 R15, table 24), and a type.
constexpr std::size_t kExtraType = 2, kExtraOptions = 3, kExtraName = 4;
constexpr char kExtraDouble = 10;

}  // namespace

std::string las_extra_doubles(std::span<const std::string> names) {
  std::string text;
  for (const std::string& name : names) {
    std::array<char, LasExtraField::kBytes> d{};
    d[kExtraType] = kExtraDouble;
    std::memcpy(&d[kExtraName], name.data(), name.size());
    text.append(d.data(), d.size());
  }
  return text;
}

std::array<char, LasExtraField::kBytes> las_extra_unknown(std::size_t count) {
  std::array<char, LasExtraField::kBytes> d{};
  d[kExtraOptions] = static_cast<char>(count);
  return d;
}

std::size_t las_extra_size(const char* description) {
  constexpr std::array<std::size_t, 11> kBytes = {0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  const auto type = static_cast<unsigned char>(description[kExtraType]);
  if (type == 0) return static_cast<unsigned char>(description[kExtraOptions]);
  // Up to 30: two or three numbers of one type, deprecated.
  return type <= 30 ? kBytes[(type - 1) % 10 + 1] * ((type - 1) / 10 + 1) : 0;
}

template <class T>
T LasHeader::field(std::size_t offset) const {
  return load_scalar<T>(head_.data() + offset);
}

void LasHeader::fail(std::size_t offset, const std::string& what) const {
  throw InputError(info.path.string() + ": byte " + std::to_string(offset) + " of the LAS header: " + what);
}

LasHeader::LasHeader(const ReadFile& file) {
  info.path = file.path();
  info.bytes = file.size();
  const std::uint64_t there = std::min<std::uint64_t>(file.size(), head_.size());
  file.read_at(0, head_.data(), there);
  const auto need = [&](std::size_t bytes) {
    if (there < bytes) {
      fail(static_cast<std::size_t>(there), "the file ends here, a header of this version has " +
                                                std::to_string(bytes) + " bytes; it is truncated");
    }
  };
  need(LasField::kHeader12);
  const int major = field<std::uint8_t>(LasField::kVersionMajor);
  minor_ = field<std::uint8_t>(LasField::kVersionMinor);
  if (major != 1) {
    fail(LasField::kVersionMajor,
         "version " + std::to_string(major) + "." + std::to_string(minor_) + " is not known, 1.0 to 1.4 are");
  }
  if (minor_ > 4) info.warnings.push_back("LAS version 1." + std::to_string(minor_) + " is read as 1.4");
  if (minor_ >= 3) need(LasField::kHeader13);
  if (minor_ >= 4) need(LasField::kHeader14);
  set_format();
  set_layout();
  set_count();
  set_end(file.size());
  info.crs = las_crs(file, info.warnings);
}

void LasHeader::set_format() {
  const int format = field<std::uint8_t>(LasField::kPointFormat);
  compressed = (format & kCompressedBit) != 0;
  point_format = format & ~kCompressedBit;
  if (static_cast<std::size_t>(point_format) >= kPointFormats.size()) {
    fail(LasField::kPointFormat,
         "point format " + std::to_string(point_format) + " is not known, 0 to 10 are");
  }
  withheld_bit_ = kPointFormats[static_cast<std::size_t>(point_format)].withheld;
  wide_ = point_format >= kFirstWideFormat;
  begin = field<std::uint32_t>(LasField::kPointOffset);
  if (begin < LasField::kHeader12) {
    fail(LasField::kPointOffset,
         "points cannot start at byte " + std::to_string(begin) + ", within the header");
  }
  records_at = field<std::uint16_t>(LasField::kHeaderSize);
  record_count = field<std::uint32_t>(LasField::kRecordCount);
  info.format = (compressed ? "LAZ 1." : "LAS 1.") + std::to_string(minor_) + " point format " +
                std::to_string(point_format);
  info.attributes.intensity = info.attributes.intensity_16 = true;
  info.attributes.echo = true;
}

void LasHeader::set_layout() {
  const PointFormat& format = kPointFormats[static_cast<std::size_t>(point_format)];
  layout.stride = field<std::uint16_t>(LasField::kRecordLength);
  if (layout.stride < format.bytes) {
    fail(LasField::kRecordLength, "records of " + std::to_string(layout.stride) +
                                      " bytes are too short for their point format, which has " +
                                      std::to_string(format.bytes));
  }
  layout.scaled = true;
  for (std::size_t a = 0; a < 3; ++a) {
    layout.position[a] = {ScalarType::kInt32, static_cast<int>(4 * a)};
    layout.scale[a] = field<double>(LasField::kScale + 8 * a);
    layout.shift[a] = field<double>(LasField::kOffset + 8 * a);
    if (!std::isfinite(layout.scale[a]) || layout.scale[a] == 0) {
      fail(LasField::kScale + 8 * a,
           std::string("the scale of ") + "xyz"[a] + " is zero or no number, so there are no positions");
    }
    if (!std::isfinite(layout.shift[a])) {
      fail(LasField::kOffset + 8 * a,
           std::string("the offset of ") + "xyz"[a] + " is no number, so there are no positions");
    }
  }
  info.grid = {layout.scale, layout.shift};
  if (format.colour < 0) return;
  for (int c = 0; c < 3; ++c) {
    layout.colour[static_cast<std::size_t>(c)] = {ScalarType::kUint16, format.colour + 2 * c};
  }
  info.attributes.colour = true;
}

void LasHeader::set_count() {
  const std::uint64_t legacy = field<std::uint32_t>(LasField::kLegacyCount);
  info.declared_points = legacy;
  if (minor_ < 4) return;
  const auto wide = field<std::uint64_t>(LasField::kCount);
  if (wide > 0) info.declared_points = wide;
  if (wide != legacy && legacy != 0) {
    info.warnings.push_back("the header has two counts that differ: " + std::to_string(wide) +
                            " (64 bits) and " + std::to_string(legacy) + " (32 bits)");
  }
}

void LasHeader::set_end(std::uint64_t size) {
  end = size;
  const auto limit = [&](std::uint64_t start) {
    if (start > begin) end = std::min(end, start);
  };
  if (minor_ >= 3 && (field<std::uint16_t>(LasField::kGlobalEncoding) & 2) != 0)
    limit(field<std::uint64_t>(LasField::kWaveform));
  if (minor_ >= 4 && field<std::uint32_t>(LasField::kEvlrCount) > 0)
    limit(field<std::uint64_t>(LasField::kFirstEvlr));
  begin = std::min(begin, size);
  end = std::max(end, begin);
}

void LasHeader::check_bounds(bool points) {
  bool plausible = true;
  bool zero = true;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto high = field<double>(LasField::kBounds + 16 * a);
    const auto low = field<double>(LasField::kBounds + 16 * a + 8);
    info.declared_min[a] = low;
    info.declared_max[a] = high;
    plausible = plausible && std::isfinite(low) && std::isfinite(high) && low <= high;
    zero = zero && low == 0 && high == 0;
  }
  info.has_bounds = plausible && !zero;
  if (!plausible) info.warnings.push_back("the header's bounds are no box; they are ignored");
  if (plausible && zero && points)
    info.warnings.push_back("the header's bounds are all zero; they are ignored");
}

void LasHeader::append(const char* records, std::size_t count, ChunkSink& out, ReadCounts& counts) const {
  const auto withheld = [&](std::size_t i) {
    return (static_cast<std::uint8_t>(records[i * layout.stride + LasRecordField::kFlags]) & withheld_bit_) !=
           0;
  };
  const unsigned bits = wide_ ? 4 : 3;
  const unsigned mask = (1u << bits) - 1;
  PointChunk& chunk = out.chunk();
  for (std::size_t i = 0; i < count;) {
    std::size_t kept = i;
    while (kept < count && !withheld(kept)) ++kept;
    append_records(layout, records + i * layout.stride, kept - i, chunk);
    chunk.echo.reserve(chunk.size());
    for (; i < kept; ++i) {
      const char* record = records + i * layout.stride;
      if (intensities)
        chunk.intensity.push_back(load_scalar<std::uint16_t>(record + LasRecordField::kIntensity));
      const unsigned returns = static_cast<std::uint8_t>(record[LasRecordField::kReturns]);
      const unsigned kind =
          static_cast<std::uint8_t>(record[wide_ ? LasRecordField::kWideClass : LasRecordField::kFlags]);
      chunk.echo.push_back({static_cast<std::uint8_t>(wide_ ? kind : kind & 31u),
                            static_cast<std::uint8_t>(returns & mask),
                            static_cast<std::uint8_t>(returns >> bits & mask)});
    }
    while (i < count && withheld(i)) ++i;
    counts.withheld += i - kept;
  }
  out.added();
}

}  // namespace tessera
