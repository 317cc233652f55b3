#include "stream/formats/points/las_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "stream/formats/closed_file.h"
#include "stream/formats/points/point_records.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

/// Byte offsets of header fields.
enum Field : std::size_t {
  kGlobalEncoding = 6,
  kVersionMajor = 24,
  kVersionMinor = 25,
  kHeaderSize = 94,
  kPointOffset = 96,
  kPointFormat = 104,
  kRecordLength = 105,
  kLegacyCount = 107,
  kScale = 131,
  kOffset = 155,
  kBounds = 179,  ///< max x, min x, max y, min y, max z, min z
  kHeader12 = 227,
  kWaveform = 227,  ///< 1.3 and later
  kHeader13 = 235,
  kFirstEvlr = 235,  ///< 1.4
  kEvlrCount = 243,
  kCount = 247,
  kHeader14 = 375,
};

struct PointFormat {
  std::size_t bytes;
  int colour;             ///< byte offset of red, -1 without
  std::uint8_t withheld;  ///< bit in byte 15
};
constexpr int kFirstWideFormat = 6;  ///< from here on four bits a return number and a byte for the class
constexpr std::array kPointFormats = {
    PointFormat{20, -1, 0x80}, PointFormat{28, -1, 0x80}, PointFormat{26, 20, 0x80},
    PointFormat{34, 28, 0x80}, PointFormat{57, -1, 0x80}, PointFormat{63, 28, 0x80},
    PointFormat{30, -1, 0x04}, PointFormat{36, 30, 0x04}, PointFormat{38, 30, 0x04},
    PointFormat{59, -1, 0x04}, PointFormat{67, 30, 0x04},
};
constexpr std::size_t kReturnsByte = 14;
constexpr std::size_t kFlagsByte = 15;  ///< formats 0 to 5: the class too
constexpr std::size_t kWideClassByte = 16;

class LasPoints final : public PointFile {
 public:
  LasPoints(const ReadFile& file, const ReadOptions& options) : input_(file), options_(options) {
    read_header(file);
    set_layout();
    verify_count();
    verify_bounds();
    if (layout_.colour[0].there()) {
      layout_.colour_scale = sample_colour_scale(file, begin_, count_.usable, layout_);
    }
  }

  const PointFileInfo& info() const override { return info_; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    return even_slices(file, 0, count_.usable, layout_.stride, target_bytes);
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    const std::uint64_t end = std::min(slice.end, count_.usable);
    const std::uint64_t begin = std::min(slice.begin, end);
    const ReadFile file = input_.open();
    ByteWindow window(file, begin_ + begin * layout_.stride, begin_ + end * layout_.stride,
                      std::max(ByteWindow::kDefaultCapacity, layout_.stride), options_.release_cache);
    for (std::uint64_t left = end - begin; left > 0;) {
      const char* records = window.peek(layout_.stride).data();
      const std::size_t n = std::min(window.peek(layout_.stride).size() / layout_.stride, out.room());
      for (std::size_t i = 0; i < n;) {
        std::size_t kept = i;
        while (kept < n && !withheld(records + kept * layout_.stride)) ++kept;
        append_records(layout_, records + i * layout_.stride, kept - i, out.chunk());
        append_echoes(records + i * layout_.stride, kept - i, out.chunk().echo);
        i = kept;
        while (i < n && withheld(records + i * layout_.stride)) ++i;
        counts.withheld += i - kept;
      }
      window.skip(n * layout_.stride);
      out.added();
      left -= n;
    }
    out.flush();
    counts.points = out.points();
    if (slice.end >= count_.usable) counts.missing = count_.missing;
    return counts;
  }

 private:
  template <class T>
  T field(std::size_t offset) const {
    return load_scalar<T>(head_.data() + offset);
  }
  [[noreturn]] void fail(std::size_t offset, const std::string& what) const {
    throw InputError(input_.path().string() + ": byte " + std::to_string(offset) +
                     " of the LAS header: " + what);
  }
  bool withheld(const char* record) const {
    return (static_cast<std::uint8_t>(record[kFlagsByte]) & withheld_bit_) != 0;
  }

  void append_echoes(const char* records, std::size_t count, std::vector<Echo>& out) const {
    const std::size_t first = out.size();
    out.resize(first + count);
    const unsigned bits = wide_ ? 4 : 3;
    const unsigned mask = (1u << bits) - 1;
    for (std::size_t i = 0; i < count; ++i, records += layout_.stride) {
      const unsigned returns = static_cast<std::uint8_t>(records[kReturnsByte]);
      const unsigned kind = static_cast<std::uint8_t>(records[wide_ ? kWideClassByte : kFlagsByte]);
      out[first + i] = {static_cast<std::uint8_t>(wide_ ? kind : kind & 31u),
                        static_cast<std::uint8_t>(returns & mask),
                        static_cast<std::uint8_t>(returns >> bits & mask)};
    }
  }

  void read_header(const ReadFile& file) {
    const std::uint64_t there = std::min<std::uint64_t>(input_.size(), head_.size());
    file.read_at(0, head_.data(), there);
    const auto need = [&](std::size_t bytes) {
      if (there < bytes) {
        fail(static_cast<std::size_t>(there), "the file ends here, a header of this version has " +
                                                  std::to_string(bytes) + " bytes; it is truncated");
      }
    };
    need(kHeader12);
    const int major = field<std::uint8_t>(kVersionMajor);
    minor_ = field<std::uint8_t>(kVersionMinor);
    if (major != 1) {
      fail(kVersionMajor, "version " + std::to_string(major) + "." + std::to_string(minor_) +
                              " is not known, 1.0 to 1.4 are");
    }
    if (minor_ > 4) info_.warnings.push_back("LAS version 1." + std::to_string(minor_) + " is read as 1.4");
    if (minor_ >= 3) need(kHeader13);
    if (minor_ >= 4) need(kHeader14);
    const int format = field<std::uint8_t>(kPointFormat);
    if ((format & 0xc0) != 0) {
      fail(kPointFormat,
           "the points are compressed (LAZ), which is not read yet; convert to LAS, for instance with "
           "'laszip -i IN.laz -o OUT.las' or 'pdal translate IN.laz OUT.las'");
    }
    if (static_cast<std::size_t>(format) >= kPointFormats.size()) {
      fail(kPointFormat, "point format " + std::to_string(format) + " is not known, 0 to 10 are");
    }
    format_ = kPointFormats[static_cast<std::size_t>(format)];
    withheld_bit_ = format_.withheld;
    wide_ = format >= kFirstWideFormat;
    begin_ = field<std::uint32_t>(kPointOffset);
    if (begin_ < kHeader12) {
      fail(kPointOffset, "points cannot start at byte " + std::to_string(begin_) + ", within the header");
    }
    info_.path = input_.path();
    info_.format = "LAS 1." + std::to_string(minor_) + " point format " + std::to_string(format);
    info_.bytes = input_.size();
    info_.attributes.intensity = true;
    info_.attributes.echo = true;
  }

  void set_layout() {
    layout_.stride = field<std::uint16_t>(kRecordLength);
    if (layout_.stride < format_.bytes) {
      fail(kRecordLength, "records of " + std::to_string(layout_.stride) +
                              " bytes are too short for their point format, which has " +
                              std::to_string(format_.bytes));
    }
    layout_.scaled = true;
    for (std::size_t a = 0; a < 3; ++a) {
      layout_.position[a] = {ScalarType::kInt32, static_cast<int>(4 * a)};
      layout_.scale[a] = field<double>(kScale + 8 * a);
      layout_.shift[a] = field<double>(kOffset + 8 * a);
      if (!std::isfinite(layout_.scale[a]) || layout_.scale[a] == 0) {
        fail(kScale + 8 * a,
             std::string("the scale of ") + "xyz"[a] + " is zero or no number, so there are no positions");
      }
      if (!std::isfinite(layout_.shift[a])) {
        fail(kOffset + 8 * a,
             std::string("the offset of ") + "xyz"[a] + " is no number, so there are no positions");
      }
    }
    if (format_.colour >= 0) {
      for (int c = 0; c < 3; ++c) {
        layout_.colour[static_cast<std::size_t>(c)] = {ScalarType::kUint16, format_.colour + 2 * c};
      }
      info_.attributes.colour = true;
    }
  }

  void verify_count() {
    const std::uint64_t legacy = field<std::uint32_t>(kLegacyCount);
    info_.declared_points = legacy;
    if (minor_ >= 4) {
      const auto wide = field<std::uint64_t>(kCount);
      if (wide > 0) info_.declared_points = wide;
      if (wide != legacy && legacy != 0) {
        info_.warnings.push_back("the header has two counts that differ: " + std::to_string(wide) +
                                 " (64 bits) and " + std::to_string(legacy) + " (32 bits)");
      }
    }
    // Points end where the file does, or where waveforms or extended records start.
    std::uint64_t end = input_.size();
    const auto limit = [&](std::uint64_t start) {
      if (start > begin_) end = std::min(end, start);
    };
    if (minor_ >= 3 && (field<std::uint16_t>(kGlobalEncoding) & 2) != 0)
      limit(field<std::uint64_t>(kWaveform));
    if (minor_ >= 4 && field<std::uint32_t>(kEvlrCount) > 0) limit(field<std::uint64_t>(kFirstEvlr));
    begin_ = std::min(begin_, input_.size());
    count_ = verified_count(info_.declared_points, std::max(end, begin_) - begin_, layout_.stride, true);
    if (!count_.warning.empty()) info_.warnings.push_back(count_.warning);
  }

  void verify_bounds() {
    bool plausible = true;
    bool zero = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto high = field<double>(kBounds + 16 * a);
      const auto low = field<double>(kBounds + 16 * a + 8);
      info_.declared_min[a] = low;
      info_.declared_max[a] = high;
      plausible = plausible && std::isfinite(low) && std::isfinite(high) && low <= high;
      zero = zero && low == 0 && high == 0;
    }
    info_.has_bounds = plausible && !zero;
    if (!plausible) info_.warnings.push_back("the header's bounds are no box; they are ignored");
    if (plausible && zero && count_.usable > 0) {
      info_.warnings.push_back("the header's bounds are all zero; they are ignored");
    }
  }

  ClosedFile input_;
  ReadOptions options_;
  PointFileInfo info_;
  std::array<char, kHeader14> head_{};
  int minor_ = 0;
  PointFormat format_{};
  std::uint8_t withheld_bit_ = 0;
  bool wide_ = false;
  std::uint64_t begin_ = 0;
  PointRecordLayout layout_;
  RecordCount count_;
};

}  // namespace

std::unique_ptr<PointFile> open_las_points(const ReadFile& file, const ReadOptions& options) {
  return std::make_unique<LasPoints>(file, options);
}

}  // namespace tessera
