/// STL, text and binary. Triangles have no shared vertices: three per face, in order. Binary files of our own writer say
/// what their coordinates count from.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "octree/vector.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/mesh_parts.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/text_scanner.h"
#include "stream/formats/vertex_fields.h"

namespace tessera {
namespace {

constexpr std::uint64_t kHeaderSize = 84;
constexpr std::uint64_t kFacetSize = 50;
constexpr std::size_t kMaxTitle = 79;  // of our own files

/// Binary files have zeros or other bytes that no text has in their header, their count or their first facets.
bool is_text(std::string_view start) {
  return std::none_of(start.begin(), start.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte < 0x20 && (byte < '\t' || byte > '\r')) || byte == 0x7f;
  });
}

class StlMeshReader : public MeshReader, public MeshRanges {
 public:
  StlMeshReader(ReadFile file, const MeshReadOptions&) : file_(std::move(file)) {
    char start[kTextSample] = {};
    const std::uint64_t there = std::min<std::uint64_t>(file_.size(), sizeof start);
    file_.read_at(0, start, there);
    if (is_text({start, static_cast<std::size_t>(there)}) && !has_claimed_size()) {
      format_ = "STL text";
      header_.double_positions = true;  // text has as many digits as its writer gave it
      line_end_ = detect_line_end(file_);
      text_ = true;
      return;
    }
    format_ = "STL binary";
    if (std::string_view(start, 80).find("COLOR=") != std::string_view::npos)
      warnings_.push_back("colours of facets are left out");
    header_.faces = count_facets();
    header_.vertices = 3 * header_.faces;
    read_title(std::string_view(start, 80));
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }
  bool shared_vertices() const override { return false; }
  std::vector<std::string> warnings() const override { return warnings_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, false);
    facets_ = text_ ? TextFacets(file_, line_end_).read(batch) : read_binary(batch);
    batch.flush();
  }

  bool has_ranges() const override { return !text_ && file_.packed().empty(); }

  void read_vertex_range(std::uint64_t begin, std::uint64_t end, MeshVertexPart& part) const override {
    part.position.clear();
    part.rgba.clear();
    if (begin >= end) return;
    const std::uint64_t first = begin / 3, last = (end + 2) / 3;
    part.bytes.resize((last - first) * kFacetSize);
    file_.read_at(begin_ + first * kFacetSize, part.bytes.data(), part.bytes.size());
    file_.release(begin_ + first * kFacetSize, part.bytes.size());
    file_.require_unchanged();
    for (std::uint64_t v = begin; v < end; ++v)
      part.position.push_back(corner(part.bytes.data() + (v / 3 - first) * kFacetSize, v % 3));
  }
  std::uint64_t read_face_range(std::uint64_t begin, std::uint64_t end, MeshFacePart& part) const override {
    part.faces.clear();
    part.synthetic.clear();
    for (; begin < end; ++begin) part.faces.push_back({3 * begin, 3 * begin + 1, 3 * begin + 2});
    return begin;
  }

  void read_faces_from(
      std::uint64_t first,
      const std::function<void(std::span<const MeshFace>, std::span<const std::uint8_t>)>& sink) override {
    for (MeshFacePart part; first < header_.faces; ++first) {
      read_face_range(first, first + 1, part);
      sink(part.faces, {});
    }
  }

  void read_faces(const FaceSink& sink) override {
    if (!facets_) read_vertices([](auto, auto) {});
    FaceBatch batch(sink, {}, 3 * *facets_, [this] { return file_.path().string(); });
    for (std::uint64_t i = 0; i < *facets_; ++i) batch.triangle(3 * i, 3 * i + 1, 3 * i + 2);
    batch.flush();
  }

 private:
  static constexpr std::size_t kTextSample = 1024;

  std::uint64_t claimed() const {
    std::uint32_t count = 0;
    if (file_.size() >= kHeaderSize) file_.read_at(kHeaderSize - sizeof count, &count, sizeof count);
    return count;
  }
  bool has_claimed_size() const {
    return file_.size() >= kHeaderSize && file_.size() == kHeaderSize + claimed() * kFacetSize;
  }

  /// Facets by the size of the file: the count of the header is a claim, which many programs get wrong, or leave out.
  std::uint64_t count_facets() {
    const std::uint64_t size = file_.size(), count = claimed();
    const auto says = [&](std::uint64_t facets) {
      warnings_.push_back("the header counts " + std::to_string(count) + " facets, the file holds " +
                          std::to_string(facets) + ": those are read");
      return facets;
    };
    const std::uint64_t capacity = size < kHeaderSize ? 0 : size - kHeaderSize;
    const std::uint64_t fit = capacity / kFacetSize, rest = capacity % kFacetSize;
    constexpr std::uint64_t kNoCount = kHeaderSize - sizeof(std::uint32_t);
    if (size >= kHeaderSize && rest != 0 && count != fit && (size - kNoCount) % kFacetSize == 0 &&
        count != (size - kNoCount) / kFacetSize && all_plausible(kNoCount, (size - kNoCount) / kFacetSize)) {
      begin_ = kNoCount;
      warnings_.push_back("the header lacks its count of facets");
      return (size - kNoCount) / kFacetSize;
    }
    if (size < kHeaderSize || (count > fit && (rest != 0 || fit == 0))) {
      throw InputError(file_.path().string() + ": byte " + std::to_string(size) +
                       ": the file ends before all " + std::to_string(count) + " facets of the header (" +
                       std::to_string(kHeaderSize + count * kFacetSize) +
                       " bytes); it is truncated or no STL file");
    }
    if (count > fit) return says(fit);
    const std::uint64_t more = fit - count;
    if (more > 0 && all_plausible(kHeaderSize + count * kFacetSize, more)) return says(fit);
    if (more > 0 || rest > 0)
      warnings_.push_back(std::to_string(capacity - count * kFacetSize) +
                          " bytes behind the last facet are left out");
    return count;
  }

  /// Whether bytes beyond a count are facets and no appendix: the first thousand have finite corners, not all zero, of a
  /// size that the facets before them have too, if there are any.
  bool all_plausible(std::uint64_t begin, std::uint64_t facets) const {
    constexpr std::uint64_t kMax = 1000;
    constexpr double kFarther = 1e6;
    double known = 0.0;
    const std::uint64_t before = begin > kHeaderSize ? (begin - kHeaderSize) / kFacetSize : 0;
    for (std::uint64_t i = 0; i < std::min(before, kMax); ++i)
      known = std::max(known, size_of(kHeaderSize + i * kFacetSize));
    for (std::uint64_t i = 0; i < std::min(facets, kMax); ++i) {
      const double size = size_of(begin + i * kFacetSize);
      if (!(size > 0.0) || !std::isfinite(size)) return false;
      if (known > 0.0 && (size > known * kFarther || size < known / kFarther)) return false;
    }
    return facets > 0;
  }
  /// The largest coordinate of a facet; NaN if one is none.
  double size_of(std::uint64_t at) const {
    char facet[kFacetSize];
    file_.read_at(at, facet, sizeof facet);
    double largest = 0.0;
    for (std::size_t k = 3; k < 12; ++k) {
      const double x = std::fabs(static_cast<double>(load_scalar<float>(facet + 4 * k)));
      if (std::isnan(x)) return x;
      largest = std::max(largest, x);
    }
    return largest;
  }

  /// What our own writer says of the coordinates: what they count from, what was subtracted before.
  void read_title(std::string_view title) {
    if (!title.starts_with("Tessera; ")) return;
    title = title.substr(0, title.find('\0'));
    for (std::size_t at = title.find("; "); at != std::string_view::npos; at = title.find("; ", at + 2)) {
      const std::string_view line = title.substr(at + 2);
      if (title.size() >= kMaxTitle && line.find("; ") == std::string_view::npos) return;  // cut off
      if (parse_triple(line, kStlOrigin, origin_)) header_.double_positions = true;
      parse_shift(line, header_.shift);
    }
  }

  Double3 corner(const char* facet, std::uint64_t c) const {
    const char* p = facet + 12 * (c + 1);
    const Double3 at = {load_scalar<float>(p), load_scalar<float>(p + 4), load_scalar<float>(p + 8)};
    return header_.double_positions ? origin_ + at : at;
  }

  std::uint64_t read_binary(VertexBatch& batch) const {
    ByteWindow window(file_, begin_, file_.size(), ByteWindow::kDefaultCapacity, true);
    for (std::uint64_t i = 0; i < header_.faces; ++i) {
      const char* facet = window.peek(kFacetSize).data();
      for (std::size_t c = 0; c < 3; ++c) batch.add(corner(facet, c));
      window.skip(kFacetSize);
    }
    return header_.faces;
  }

  /// Facets as words, whatever white space is between them. Only vertices and the ends of facets matter; normals are
  /// derived data. Names of solids go to the end of their line, or to the first facet on it.
  class TextFacets {
   public:
    TextFacets(const ReadFile& file, char line_end) : text_(file, byte_order_mark(file), 1, line_end, '\0') {}

    std::uint64_t read(VertexBatch& batch) {
      bool any = false;
      for (std::string_view word = text_.word(); !word.empty(); word = text_.word()) {
        if (is(word, "vertex")) {
          vertex(batch);
        } else if (is(word, "facet")) {
          begin();
        } else if (is(word, "endfacet")) {
          end();
        } else if (is(word, "end")) {  // "end loop", "end facet"
          if (is(text_.word(), "facet")) end();
        } else if (!open_ && (is(word, "solid") || is(word, "endsolid"))) {
          any = true;
          pass_name();
        }
      }
      if (open_) throw InputError(text_.where() + ": the file ends inside a facet; it is truncated");
      if (facets_ == 0 && !any)
        throw InputError(text_.where() + ": the file ends without a facet; it is no STL file");
      return facets_;
    }

   private:
    static bool is(std::string_view word, std::string_view keyword) { return equal_any_case(word, keyword); }

    void vertex(VertexBatch& batch) {
      if (!open_) throw InputError(text_.where() + ": a vertex stands outside of any facet");
      if (++corners_ > 3) throw InputError(text_.where() + ": a facet has more than three vertices");
      Double3 p;
      for (double& value : p) value = text_.number("a coordinate");
      batch.add(p);
    }
    void begin() {
      if (open_) throw InputError(text_.where() + ": a facet begins before the last one ended");
      open_ = true;
      corners_ = 0;
    }
    void end() {
      if (!open_ || corners_ != 3) {
        throw InputError(text_.where() + ": a facet ends with " + std::to_string(corners_) +
                         " vertices, not three");
      }
      open_ = false;
      ++facets_;
    }
    /// Words that mean something elsewhere may stand in a name; a facet has a normal of numbers.
    void pass_name() {
      bool facet = false, normal = false;
      for (std::string_view word = text_.word_in_line(); !word.empty(); word = text_.word_in_line()) {
        double value = 0.0;
        std::string_view rest = word;
        if (normal && take_number(rest, value) && rest.empty()) return begin();
        normal = facet && is(word, "normal");
        facet = is(word, "facet");
      }
    }

    TextScanner text_;
    std::uint64_t facets_ = 0;
    int corners_ = 0;
    bool open_ = false;
  };

  const ReadFile file_;
  bool text_ = false;
  char line_end_ = '\n';
  std::uint64_t begin_ = kHeaderSize;  ///< of the facets
  MeshHeader header_;
  Double3 origin_ = {0, 0, 0};  ///< binary: what is added to all coordinates
  std::string format_;
  std::vector<std::string> warnings_;
  std::optional<std::uint64_t> facets_;  ///< known after a first pass
};

}  // namespace

std::unique_ptr<MeshReader> open_stl_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<StlMeshReader>(std::move(file), options);
}

}  // namespace tessera
