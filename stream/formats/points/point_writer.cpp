#include "stream/formats/points/point_writer.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/output_file.h"
#include "stream/formats/copc/copc_body.h"
#include "stream/formats/copc/copc_nodes.h"
#include "stream/formats/laz/chunk_encoder.h"
#include "stream/formats/laz/chunk_table.h"
#include "stream/formats/points/las_header.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

bool finite(const PointChunk& c, std::size_t i) {
  return std::isfinite(c.x[i]) && std::isfinite(c.y[i]) && std::isfinite(c.z[i]);
}

void count_points(const PointChunk& chunk, EncodedPoints& out) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  out.points = 0;
  out.min = {kInf, kInf, kInf};
  out.max = {-kInf, -kInf, -kInf};
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    if (!finite(chunk, i)) continue;
    ++out.points;
    const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
    for (std::size_t a = 0; a < 3; ++a) {
      out.min[a] = std::min(out.min[a], p[a]);
      out.max[a] = std::max(out.max[a], p[a]);
    }
  }
}

template <class T>
char* put(char* at, T value) {
  std::memcpy(at, &value, sizeof value);
  return at + sizeof value;
}

/// What all formats share: the file, and the sums of what was appended.
class BaseWriter : public PointWriter {
 public:
  BaseWriter(const std::filesystem::path& path, const PointFileHeader& header)
      : file_(path), header_(header) {}
  void append(const EncodedPoints& points) override {
    write(points.bytes);
    if (points.points == 0) return;
    for (std::size_t a = 0; a < 3; ++a) {
      min_[a] = points_ == 0 ? points.min[a] : std::min(min_[a], points.min[a]);
      max_[a] = points_ == 0 ? points.max[a] : std::max(max_[a], points.max[a]);
    }
    points_ += points.points;
    for (std::size_t r = 0; r < by_return_.size(); ++r) by_return_[r] += points.by_return[r];
  }
  std::uint64_t finish() override {
    complete_header();
    const std::uint64_t size = file_.size();
    file_.finish();
    return size;
  }

 protected:
  virtual void write(const std::vector<char>& bytes) { file_.append(bytes.data(), bytes.size()); }
  virtual void complete_header() {}
  OutputFile file_;
  PointFileHeader header_;
  std::uint64_t points_ = 0;
  Double3 min_{}, max_{};
  std::array<std::uint64_t, 15> by_return_{};
};

// ------------------------------------------------------------------------------------------------ PLY

class PlyEncoder final : public PointEncoder {
 public:
  explicit PlyEncoder(const PointFileHeader& header) : header_(header) {}
  void encode(const PointChunk& chunk, const PtxScan&, std::span<const double> scalars,
              EncodedPoints& out) const override {
    count_points(chunk, out);
    const bool normals = header_.attributes.normals, colour = header_.attributes.colour;
    const bool intensity = header_.attributes.intensity_16, echo = header_.attributes.echo;
    const std::size_t record = (header_.double_positions ? 24u : 12u) + (normals ? 12u : 0u) +
                               (colour ? 3u : 0u) + (intensity ? 2u : 0u) + (echo ? 3u : 0u) +
                               header_.scalars.size() * sizeof(double);
    const std::size_t count = header_.scalars.size();
    out.bytes.resize(out.points * record);
    char* at = out.bytes.data();
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      if (!finite(chunk, i)) continue;
      for (const double v : {chunk.x[i], chunk.y[i], chunk.z[i]}) {
        at = header_.double_positions ? put(at, v) : put(at, static_cast<float>(v));
      }
      if (normals) {
        for (const float v : {chunk.nx[i], chunk.ny[i], chunk.nz[i]}) at = put(at, v);
      }
      if (colour) {
        std::memcpy(at, &chunk.rgba[i], 3);  // little endian: r, g, b first
        at += 3;
      }
      if (intensity) at = put(at, chunk.intensity[i]);
      if (echo)
        for (const std::uint8_t v : {chunk.echo[i].kind, chunk.echo[i].number, chunk.echo[i].of})
          at = put(at, v);
      for (std::size_t k = 0; k < count; ++k) at = put(at, scalars[i * count + k]);
    }
  }

 private:
  PointFileHeader header_;
};

class PlyPointWriter final : public BaseWriter {
 public:
  PlyPointWriter(const std::filesystem::path& path, const PointFileHeader& header)
      : BaseWriter(path, header) {
    file_.append(header_text(0));
  }

 private:
  /// The same length for any count: the number of spaces in the last comment makes up for the digits.
  std::string header_text(std::uint64_t points) const {
    const std::string count = std::to_string(points);
    std::string text = "ply\nformat binary_little_endian 1.0\n";
    for (const auto& line : header_.comments) text += "comment " + line + "\n";
    text += "comment Tessera" + std::string(20 - count.size(), ' ') + "\nelement vertex " + count + "\n";
    const char* type = header_.double_positions ? "double" : "float";
    for (const char* name : {"x", "y", "z"}) text += std::string("property ") + type + " " + name + "\n";
    if (header_.attributes.normals) text += "property float nx\nproperty float ny\nproperty float nz\n";
    if (header_.attributes.colour) {
      text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    if (header_.attributes.intensity_16) text += "property ushort intensity\n";
    if (header_.attributes.echo)
      text +=
          "property uchar classification\nproperty uchar return_number\nproperty uchar number_of_returns\n";
    for (const std::string& name : header_.scalars) text += "property double " + name + "\n";
    return text + "end_header\n";
  }
  void complete_header() override {
    const std::string text = header_text(points_);
    file_.patch(0, text.data(), text.size());
  }
};

// ------------------------------------------------------------------------------------------------ LAS

/// Of what a point format has.
std::size_t las_format_bytes(const PointFileHeader& header) {
  return header.attributes.colour ? 36 : 30;
}
std::size_t las_extra_bytes(const PointFileHeader& header) {
  return header.scalars.size() * sizeof(double);
}
std::size_t las_record_bytes(const PointFileHeader& header) {
  return las_format_bytes(header) + las_extra_bytes(header);
}

class LasEncoder final : public PointEncoder {
 public:
  explicit LasEncoder(const PointFileHeader& header) : header_(header) {}
  void encode(const PointChunk& chunk, const PtxScan&, std::span<const double> scalars,
              EncodedPoints& out) const override {
    count_points(chunk, out);
    const bool colour = header_.attributes.colour;
    const std::size_t count = header_.scalars.size();
    out.bytes.assign(out.points * las_record_bytes(header_), 0);
    out.by_return = {};
    char* record = out.bytes.data();
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      if (!finite(chunk, i)) continue;
      char* at = record;
      const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
      for (std::size_t a = 0; a < 3; ++a) {
        const double steps = std::floor((p[a] - header_.las_offset[a]) / header_.las_scale + 0.5);
        if (!(std::fabs(steps) <= 2147483647.0)) {
          throw UsageError("LAS: coordinate " + std::to_string(p[a]) + " does not fit 32 bits at LAS scale " +
                           std::to_string(header_.las_scale) + "; write PLY instead");
        }
        at = put(at, static_cast<std::int32_t>(steps));
      }
      // Return 1 of 1, unclassified, where nothing is known.
      const Echo echo = header_.attributes.echo ? chunk.echo[i] : Echo{1, 1, 1};
      const unsigned number = std::min<unsigned>(echo.number, 15);
      if (header_.attributes.intensity_16) put(record + 12, chunk.intensity[i]);
      record[14] = static_cast<char>(number | std::min<unsigned>(echo.of, 15) << 4);
      record[16] = static_cast<char>(echo.kind);
      if (number > 0) ++out.by_return[number - 1];
      if (colour) {
        for (int c = 0; c < 3; ++c) {
          const std::uint32_t v = chunk.rgba[i] >> (8 * c) & 0xffu;
          put(record + 30 + 2 * c, static_cast<std::uint16_t>(v * 257u));
        }
      }
      char* extra = record + las_format_bytes(header_);
      for (std::size_t k = 0; k < count; ++k) extra = put(extra, scalars[i * count + k]);
      record += las_record_bytes(header_);
    }
  }

 private:
  PointFileHeader header_;
};

/// LAS 1.4 R15, point format 6 (30 bytes) or 7 (with colour, 36 bytes): 64-bit counts, no legacy fields.
class LasPointWriter : public BaseWriter {
 public:
  LasPointWriter(const std::filesystem::path& path, const PointFileHeader& header)
      : LasPointWriter(path, header, 0) {}

 protected:
  static constexpr std::size_t kHeaderBytes = 375;
  static constexpr int kCompressedBit = 0x80;
  /// \param info_bytes  of a record of COPC before all others, zeros
  LasPointWriter(const std::filesystem::path& path, const PointFileHeader& header, std::size_t info_bytes)
      : BaseWriter(path, header) {
    const std::array<char, kHeaderBytes> blank{};
    file_.append(blank.data(), blank.size());
    if (info_bytes > 0) append_record("copc", 1, std::string(info_bytes, '\0'));
    if (header.scalars.empty()) return;
    const std::string extra = las_extra_doubles(header.scalars);
    append_record(LasExtraField::kUserId, LasExtraField::kRecordId, extra);
  }

  int point_format() const { return header_.attributes.colour ? 7 : 6; }
  void complete_header() override { write_header(0); }
  /// A variable length record; all of them come before the points.
  void append_record(std::string_view user, std::uint16_t id, std::string_view data) {
    std::array<char, 54> head{};
    std::memcpy(&head[2], user.data(), user.size());
    put(&head[18], id);
    put(&head[20], static_cast<std::uint16_t>(data.size()));
    file_.append(head.data(), head.size());
    file_.append(data);
    begin_ = file_.size();
    ++records_;
  }
  /// \param format_bits  beside the format
  void write_header(int format_bits) {
    std::array<char, kHeaderBytes> h{};
    std::memcpy(h.data(), "LASF", 4);
    put(&h[6], std::uint16_t{1 << 4});  // global encoding: coordinate system as WKT, required by formats 6-10
    h[24] = 1;
    h[25] = 4;
    std::memcpy(&h[26], "Tessera", 7);
    std::memcpy(&h[58], "tessera " TESSERA_VERSION, sizeof("tessera " TESSERA_VERSION) - 1);
    put(&h[90], std::uint16_t{1});  // creation day and year: fixed, the same bytes every time
    put(&h[92], std::uint16_t{2026});
    put(&h[94], std::uint16_t{kHeaderBytes});
    put(&h[96], static_cast<std::uint32_t>(begin_));
    put(&h[100], records_);
    h[104] = static_cast<char>(point_format() | format_bits);
    put(&h[105], static_cast<std::uint16_t>(las_record_bytes(header_)));
    for (std::size_t a = 0; a < 3; ++a) {
      put(&h[131 + 8 * a], header_.las_scale);
      put(&h[155 + 8 * a], header_.las_offset[a]);
      put(&h[179 + 16 * a], stored(max_[a], a));
      put(&h[187 + 16 * a], stored(min_[a], a));
    }
    put(&h[235], extended_at_);
    put(&h[243], std::uint32_t{extended_at_ > 0 ? 1u : 0u});
    put(&h[247], points_);
    for (std::size_t r = 0; r < by_return_.size(); ++r) put(&h[255 + 8 * r], by_return_[r]);
    file_.patch(0, h.data(), h.size());
  }

  std::uint64_t begin_ = kHeaderBytes;  ///< of the points
  std::uint64_t extended_at_ = 0;       ///< of the one record behind the points; 0 = there is none

 private:
  /// The coordinate as a reader will see it, so that the bounds hold exactly.
  double stored(double v, std::size_t axis) const {
    const double steps = std::floor((v - header_.las_offset[axis]) / header_.las_scale + 0.5);
    return steps * header_.las_scale + header_.las_offset[axis];
  }

  std::uint32_t records_ = 0;  ///< between header and points
};

// ------------------------------------------------------------------------------------------------ LAZ

/// The same, compressed in layers: chunks of 50,000 points, whatever batches they come in, several at a time.
class LazPointWriter final : public LasPointWriter {
 public:
  LazPointWriter(const std::filesystem::path& path, const PointFileHeader& header)
      : LasPointWriter(path, header),
        schema_(laz::schema_for(point_format(), las_extra_bytes(header), kChunkPoints)) {
    const std::vector<char> record = laz::schema_record(schema_);
    append_record(laz::Schema::kUserId, laz::Schema::kRecordId, {record.data(), record.size()});
    file_.append(std::string_view("\0\0\0\0\0\0\0\0", 8));  // where the chunk table begins, known in the end
  }

 private:
  static constexpr std::uint32_t kChunkPoints = 50000;
  static constexpr std::size_t kGroup = 8;  ///< chunks compressed at a time

  std::size_t chunk_bytes() const { return kChunkPoints * schema_.record_bytes(); }
  void write(const std::vector<char>& bytes) override {
    const std::size_t full = kGroup * chunk_bytes();
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t part = std::min(full - pending_.size(), bytes.size() - at);
      pending_.append(bytes.data() + at, part);
      at += part;
      if (pending_.size() == full) compress();
    }
  }
  void compress() {
    const std::size_t chunks = (pending_.size() + chunk_bytes() - 1) / chunk_bytes();
    std::vector<std::vector<char>> coded(chunks);
    parallel_for(chunks, [&](std::size_t i) {
      coded[i] =
          laz::encode_chunk(schema_, std::string_view(pending_).substr(i * chunk_bytes(), chunk_bytes()));
    });
    for (const std::vector<char>& chunk : coded) {
      file_.append(chunk.data(), chunk.size());
      table_.push_back({0, static_cast<std::uint32_t>(chunk.size())});
    }
    pending_.clear();
  }
  void complete_header() override {
    compress();
    const std::uint64_t table_begin = file_.size();
    const std::vector<char> table = laz::chunk_table(table_, false);
    file_.append(table.data(), table.size());
    file_.patch(begin_, &table_begin, sizeof table_begin);
    write_header(kCompressedBit);
  }

  laz::Schema schema_;
  std::string pending_;  ///< records not yet compressed
  std::vector<laz::ChunkSize> table_;
};

// ------------------------------------------------------------------------------------------------ COPC

/// A LAZ file whose chunks are the nodes of an octree (copc_nodes.h), coarse ones first.
class CopcPointWriter final : public LasPointWriter {
 public:
  CopcPointWriter(const std::filesystem::path& path, const PointFileHeader& header)
      : LasPointWriter(path, header, kCopcInfoBytes),
        schema_(laz::schema_for(point_format(), las_extra_bytes(header), laz::Schema::kVariable)),
        nodes_(path.has_parent_path() ? path.parent_path() : ".", las_record_bytes(header), kSortBytes) {
    const std::vector<char> record = laz::schema_record(schema_);
    append_record(laz::Schema::kUserId, laz::Schema::kRecordId, {record.data(), record.size()});
    if (!header.wkt.empty()) append_record("LASF_Projection", 2112, header.wkt + std::string(1, '\0'));
    file_.append(std::string_view("\0\0\0\0\0\0\0\0", 8));  // where the chunk table begins, known in the end
  }

 private:
  static constexpr std::size_t kInfoAt = kHeaderBytes + 54;
  static constexpr std::uint64_t kSortBytes = std::uint64_t{128} << 20;

  void write(const std::vector<char>& bytes) override { nodes_.add({bytes.data(), bytes.size()}); }

  void complete_header() override {
    const double scale = header_.las_scale;
    nodes_.build({scale, scale, scale}, header_.las_offset, file_.path());
    const CopcBody body = append_copc_body(file_, schema_, nodes_, begin_, {});  // no times are known
    file_.patch(kInfoAt, body.info.data(), body.info.size());
    extended_at_ = body.hierarchy_at;
    write_header(kCompressedBit);
  }

  laz::Schema schema_;
  CopcNodes nodes_;
};

// ------------------------------------------------------------------------------------------------ text

/// Appends a number in the shortest form that reads back to the same bits, and a separator.
void put_number(std::vector<char>& out, double value, char after) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  out.insert(out.end(), text, end);
  out.push_back(after);
}
void put_number(std::vector<char>& out, float value, char after) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  out.insert(out.end(), text, end);
  out.push_back(after);
}
void put_colour(std::vector<char>& out, std::uint32_t rgba) {
  char text[8];
  for (int c = 0; c < 3; ++c) {
    const auto end = std::to_chars(text, text + sizeof text, rgba >> (8 * c) & 0xffu).ptr;
    out.insert(out.end(), text, end);
    out.push_back(c < 2 ? ' ' : '\n');
  }
}

class XyzEncoder final : public PointEncoder {
 public:
  explicit XyzEncoder(const PointFileHeader& header) : header_(header) {}
  void encode(const PointChunk& chunk, const PtxScan&, std::span<const double>,
              EncodedPoints& out) const override {
    count_points(chunk, out);
    const bool normals = header_.attributes.normals, colour = header_.attributes.colour;
    out.bytes.clear();
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      if (!finite(chunk, i)) continue;
      put_number(out.bytes, chunk.x[i], ' ');
      put_number(out.bytes, chunk.y[i], ' ');
      put_number(out.bytes, chunk.z[i], normals || colour ? ' ' : '\n');
      if (normals) {
        put_number(out.bytes, chunk.nx[i], ' ');
        put_number(out.bytes, chunk.ny[i], ' ');
        put_number(out.bytes, chunk.nz[i], colour ? ' ' : '\n');
      }
      if (colour) put_colour(out.bytes, chunk.rgba[i]);
    }
  }

 private:
  PointFileHeader header_;
};

class PtxEncoder final : public PointEncoder {
 public:
  explicit PtxEncoder(const PointFileHeader& header) : header_(header) {}
  void encode(const PointChunk& chunk, const PtxScan& scan, std::span<const double>,
              EncodedPoints& out) const override {
    count_points(chunk, out);
    const bool colour = header_.attributes.colour;
    out.bytes.clear();
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      const bool hit = finite(chunk, i);
      put_number(out.bytes, hit ? chunk.x[i] - scan.origin[0] : 0.0, ' ');
      put_number(out.bytes, hit ? chunk.y[i] - scan.origin[1] : 0.0, ' ');
      put_number(out.bytes, hit ? chunk.z[i] - scan.origin[2] : 0.0, ' ');
      put_number(out.bytes, 0.5, colour ? ' ' : '\n');
      if (colour) put_colour(out.bytes, hit ? chunk.rgba[i] : 0u);
    }
  }

 private:
  PointFileHeader header_;
};

class PtxPointWriter final : public BaseWriter {
 public:
  using BaseWriter::BaseWriter;
  void begin_scan(const PtxScan& scan) override {
    std::vector<char> text;
    const auto word = [&text](const std::string& s) { text.insert(text.end(), s.begin(), s.end()); };
    const auto origin = [&](const char* end) {
      for (const double v : scan.origin) put_number(text, v, ' ');
      text.pop_back();
      word(end);
    };
    word(std::to_string(scan.columns) + "\n" + std::to_string(scan.rows) + "\n");
    origin("\n");
    word("1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n");
    origin(" 1\n");
    file_.append(text.data(), text.size());
  }
};

enum class Format { kPly, kLas, kLaz, kCopc, kPtx, kXyz };

Format format_for(const std::filesystem::path& path, const PointFileHeader& header) {
  const std::string extension = lower_extension(path);
  const auto without_normals = [&](Format format, const char* name) {
    if (!header.attributes.normals) return format;
    throw UsageError(path.string() + ": " + name +
                     " cannot hold normals; write .ply or .xyz, or leave them out");
  };
  if (extension == ".ply") return Format::kPly;
  if (!header.scalars.empty() && extension != ".las" && extension != ".laz")
    throw UsageError(path.string() + ": only .ply, .las and .laz hold a '" + header.scalars.front() +
                     "' of points");
  if (extension == ".xyz" || extension == ".txt") return Format::kXyz;
  if (extension == ".las") return without_normals(Format::kLas, "LAS");
  if (is_copc_name(path)) return without_normals(Format::kCopc, "COPC");
  if (extension == ".laz") return without_normals(Format::kLaz, "LAZ");
  if (extension == ".ptx") return without_normals(Format::kPtx, "PTX");
  throw UsageError(path.string() + ": unknown extension '" + extension +
                   "' for points; use .ply, .las, .laz, .ptx or .xyz");
}

}  // namespace

std::unique_ptr<PointEncoder> make_point_encoder(const std::filesystem::path& path,
                                                 const PointFileHeader& header) {
  switch (format_for(path, header)) {
    case Format::kPly:
      return std::make_unique<PlyEncoder>(header);
    case Format::kLas:
    case Format::kLaz:
    case Format::kCopc:
      return std::make_unique<LasEncoder>(header);
    case Format::kPtx:
      return std::make_unique<PtxEncoder>(header);
    default:
      return std::make_unique<XyzEncoder>(header);
  }
}

std::unique_ptr<PointWriter> create_point_file(const std::filesystem::path& path,
                                               const PointFileHeader& header) {
  switch (format_for(path, header)) {
    case Format::kPly:
      return std::make_unique<PlyPointWriter>(path, header);
    case Format::kLas:
      return std::make_unique<LasPointWriter>(path, header);
    case Format::kLaz:
      return std::make_unique<LazPointWriter>(path, header);
    case Format::kCopc:
      return std::make_unique<CopcPointWriter>(path, header);
    case Format::kPtx:
      return std::make_unique<PtxPointWriter>(path, header);
    default:
      return std::make_unique<BaseWriter>(path, header);
  }
}

bool is_copc_name(const std::filesystem::path& path) {
  return lower_extension(path) == ".laz" && lower_extension(path.stem()) == ".copc";
}

void fill_missing(PointChunk& chunk, const PointAttributes& attributes) {
  const std::size_t n = chunk.size();
  if (attributes.normals && chunk.nx.empty()) chunk.nx.resize(n), chunk.ny.resize(n), chunk.nz.resize(n);
  if (attributes.colour && chunk.rgba.empty()) chunk.rgba.resize(n);
  if (attributes.intensity_16 && chunk.intensity.empty()) chunk.intensity.resize(n);
  if (attributes.echo && chunk.echo.empty()) chunk.echo.resize(n, Echo{1, 1, 1});
}

double fitting_las_scale(const Double3& min, const Double3& max) {
  double extent = 0;
  for (std::size_t a = 0; a < 3; ++a) extent = std::max(extent, max[a] - min[a]);
  // Literals, not products: a step of exactly 0.001 is what other programs write.
  for (const double scale : {1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0}) {
    if (extent / scale < 1 << 30) return scale;
  }
  throw UsageError("the points lie too far apart for LAS (more than 1e9 units); write PLY or XYZ instead");
}

}  // namespace tessera
