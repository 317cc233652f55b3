/// PLY meshes: any encoding, property order and types; faces as lists of any length or as triangle strips. In ascii an
/// element may be spread over lines, or share one with others; where every element has a line of its own, lines may hold
/// more values than the header declares (wedge colours of MeshLab).
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "stream/formats/colour_range.h"
#include "stream/formats/mesh_parts.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/ply_header.h"
#include "stream/formats/ply_ranges.h"
#include "stream/formats/text_scanner.h"
#include "stream/formats/vertex_fields.h"

namespace tessera {
namespace {

constexpr std::size_t kPiece = 65536;  // bytes of a long list looked at together
constexpr std::uint64_t kNoIndex = ~std::uint64_t{0};

/// Index of a property, or -1: by its very name, else whatever its capitals.
int find_property(const PlyElement& element, std::string_view name) {
  if (const int exact = element.find(name); exact >= 0) return exact;
  for (std::size_t i = 0; i < element.properties.size(); ++i)
    if (equal_any_case(element.properties[i].name, name)) return static_cast<int>(i);
  return -1;
}
int find_element(const PlyHeader& header, std::string_view name) {
  if (const int exact = header.find(name); exact >= 0) return exact;
  for (std::size_t i = 0; i < header.elements.size(); ++i)
    if (equal_any_case(header.elements[i].name, name)) return static_cast<int>(i);
  return -1;
}

class PlyMeshReader : public MeshReader, public MeshRanges {
 public:
  PlyMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)),
        options_(options),
        polygons_([this](const VertexSink& sink) { read_vertices(sink); }, options.temp) {
    ply_ = read_ply_header(file_);
    const int vertex = find_element(ply_, "vertex");
    if (vertex < 0) throw InputError(file_.path().string() + ": the PLY header has no element 'vertex'");
    vertex_ = static_cast<std::size_t>(vertex);
    header_.vertices = element().count;
    find_vertex_properties();
    find_faces();
    header_.comments = ply_.comments;
    std::erase_if(header_.comments, [&](const std::string& c) { return parse_shift(c, header_.shift); });
    format_ = "PLY " + ply_.encoding_name();
    surplus_.assign(ply_.elements.size(), 0);
    if (header_.colour) look_at_colours();
    if (faces_ && !strips_ && confidence_ < 0)
      ranges_ = PlyRanges::find(ply_, file_, vertex_, *faces_, indices_, synthetic_);
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, header_.colour);
    confidence_sum_ = 0.0;
    confident_ = 0;
    if (ply_.encoding == PlyEncoding::kAscii || element().has_list()) {
      read_vertex_values(element().count, [&](const Values& values) { add_vertex(batch, values); });
    } else {
      read_vertex_records(batch);
    }
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override {
    read_faces(sink, [](const Values&) {});
  }

  bool has_ranges() const override { return ranges_.has_value(); }

  void read_vertex_range(std::uint64_t begin, std::uint64_t end, MeshVertexPart& part) const override {
    ranges_->read_vertices(file_, begin, end, part.bytes);
    part.rgba.clear();
    VertexRecords records(*this);
    part.position.resize(end - begin);
    if (records.copy(part.bytes.data(), part.position)) return;
    part.position.clear();
    const VertexSink sink = [&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
      part.position.insert(part.position.end(), positions.begin(), positions.end());
      part.rgba.insert(part.rgba.end(), rgba.begin(), rgba.end());
    };
    VertexBatch batch(sink, header_.colour);
    records.add(part.bytes.data(), end - begin, batch);
    batch.flush();
  }

  std::uint64_t read_face_range(std::uint64_t begin, std::uint64_t end, MeshFacePart& part) const override {
    return ranges_->read_triangles(file_, begin, end, part);
  }

  void read_faces_from(
      std::uint64_t first,
      const std::function<void(std::span<const MeshFace>, std::span<const std::uint8_t>)>& sink) override {
    first_face_ = first;
    read_flagged_faces(sink);
    first_face_ = 0;
  }

  std::optional<double> mean_confidence() const override {
    if (confidence_ < 0 || confident_ == 0) return std::nullopt;
    return confidence_sum_ / static_cast<double>(confident_);
  }

  bool has_synthetic() const override { return synthetic_ >= 0; }

  std::vector<std::string> warnings() const override {
    std::vector<std::string> all = ply_.warnings;
    for (const std::uint64_t lines : surplus_) {
      if (lines > 0) all.push_back(surplus_sentence(lines));
    }
    for (std::string& note : list_left_out(left_out_)) all.push_back(std::move(note));
    if (header_.colour && !colours_.note().empty()) all.push_back(colours_.note());
    if (const std::string folded = polygons_.warning(); !folded.empty()) all.push_back(folded);
    return all;
  }

  void read_flagged_faces(
      const std::function<void(std::span<const MeshFace>, std::span<const std::uint8_t>)>& sink) override {
    if (!has_synthetic()) {
      MeshReader::read_flagged_faces(sink);
      return;
    }
    std::vector<MeshFace> triangles;  // batches end where polygons end
    std::vector<std::uint8_t> flags;
    const auto flush_batch = [&] {
      sink(triangles, flags);
      triangles.clear();
      flags.clear();
    };
    read_faces(
        [&](std::span<const MeshFace> batch) {
          triangles.insert(triangles.end(), batch.begin(), batch.end());
        },
        [&](const Values& values) {
          const bool flag = values[static_cast<std::size_t>(synthetic_)] != 0.0;
          flags.resize(triangles.size(), flag ? std::uint8_t{1} : std::uint8_t{0});
          if (triangles.size() >= kFlaggedBatch) flush_batch();
        },
        true);
    if (!triangles.empty()) flush_batch();
  }

 private:
  using Values = std::vector<double>;  ///< of the properties of one element; lists leave theirs alone
  static constexpr std::size_t kFlaggedBatch = 16384;

  /// \param then  called with the properties of each face
  /// \param one_by_one  hand over the triangles of each face before `then` is called
  void read_faces(const FaceSink& sink, const std::function<void(const Values&)>& then,
                  bool one_by_one = false) {
    if (!faces_) return;
    const PlyElement& faces = ply_.elements[*faces_];
    if (ply_.encoding == PlyEncoding::kAscii) {
      TextScanner text = ascii_at(*faces_);
      FaceBatch batch(
          sink, options_, header_.vertices, [&] { return text.where(); }, &polygons_);
      Values values(faces.properties.size());
      Polygon polygon{batch, strips_};
      read_ascii_elements(text, *faces_, faces.count, values, &polygon, [&] {
        if (one_by_one) batch.flush();
        then(values);
      });
      batch.flush();
      return;
    }
    ByteWindow window = binary_at(*faces_);
    if (first_face_ > 0) window.skip(first_face_ * ranges_->triangle_bytes());
    FaceBatch batch(
        sink, options_, header_.vertices, [&] { return at(window); }, &polygons_);
    Values values(faces.properties.size());
    Polygon polygon{batch, strips_};
    std::uint64_t i = first_face_;
    if (!strips_ && !ply_.big_endian() && faces.properties.size() == 1)
      i = read_plain_triangles(window, faces, batch, i);
    for (; i < faces.count; ++i) {
      read_binary_element(window, faces, values, &polygon);
      if (one_by_one) batch.flush();
      then(values);
    }
    batch.flush();
  }

  /// Takes the indices of a face or strip as they come.
  struct Polygon {
    FaceBatch& batch;
    const bool strip;
    std::uint64_t before_last = 0, last = 0;
    std::uint64_t length = 0;  ///< of the strip since its last restart

    void begin() {
      batch.begin_polygon();
      length = 0;
    }
    void index(std::uint64_t v) {
      if (!strip) {
        batch.corner(v);
        return;
      }
      if (v == kNoIndex) {  // -1: the strip starts anew
        length = 0;
        return;
      }
      // Every second triangle of a strip runs the other way; those that repeat an index only steer the strip.
      if (++length > 2 && before_last != last && last != v && before_last != v) {
        if (length % 2 == 1) {
          batch.triangle(before_last, last, v);
        } else {
          batch.triangle(last, before_last, v);
        }
      }
      before_last = last;
      last = v;
    }
    void end() {
      if (!strip) batch.end_polygon();
    }
  };

  const PlyElement& element() const { return ply_.elements[vertex_]; }
  std::string at(const ByteWindow& window) const {
    return file_.path().string() + ": byte " + std::to_string(window.offset());
  }
  [[noreturn]] void truncated(const std::string& where, const PlyElement& e) const {
    throw InputError(where + ": the file ends before all " + std::to_string(e.count) + " elements '" +
                     e.name + "' of the header; it is truncated");
  }

  void find_vertex_properties() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      xyz_[axis] = find_property(element(), kPositionFields[axis]);
      if (xyz_[axis] < 0 || property(xyz_[axis]).list) {
        throw InputError(file_.path().string() + ": the PLY element 'vertex' has no number '" +
                         std::string(kPositionFields[axis]) + "'");
      }
      header_.double_positions |= property(xyz_[axis]).type != ScalarType::kFloat32;
    }
    confidence_ = find_property(element(), "confidence");
    if (confidence_ >= 0 && property(confidence_).list) confidence_ = -1;
    for (const FieldTriple& names : kColourFields) {
      for (std::size_t c = 0; c < 3; ++c) rgba_[c] = find_property(element(), names[c]);
      header_.colour =
          std::all_of(rgba_.begin(), rgba_.begin() + 3, [&](int p) { return p >= 0 && !property(p).list; });
      if (!header_.colour) continue;
      for (const char* name : {"alpha", "a", "diffuse_alpha"}) {
        if (rgba_[3] < 0) rgba_[3] = find_property(element(), name);
        if (rgba_[3] >= 0 && property(rgba_[3]).list) rgba_[3] = -1;
      }
      break;
    }
    find_left_out();
  }
  /// Whatever of the vertices is not read. Normals follow from the faces, so nothing is lost with them.
  void find_left_out() {
    for (std::size_t p = 0; p < element().properties.size(); ++p) {
      const auto is = [p](int used) { return used == static_cast<int>(p); };
      const std::string& name = element().properties[p].name;
      const bool normal = std::any_of(kNormalFields.begin(), kNormalFields.end(), [&](const FieldTriple& n) {
        return std::any_of(n.begin(), n.end(), [&](std::string_view f) { return equal_any_case(f, name); });
      });
      if (normal || is(confidence_) || std::any_of(xyz_.begin(), xyz_.end(), is) ||
          (header_.colour && std::any_of(rgba_.begin(), rgba_.end(), is)))
        continue;
      left_out_.push_back("'" + name + "' of vertices");
    }
  }
  /// The range of the colours of the first vertices.
  void look_at_colours() {
    colours_ = ColourRange(property(rgba_[0]).type);
    if (scalar_bytes(property(rgba_[0]).type) == 1) return;  // which nothing changes
    read_vertex_values(std::min(element().count, ColourRange::kRows), [&](const Values& values) {
      for (std::size_t c = 0; c < 3; ++c) colours_.add(values[static_cast<std::size_t>(rgba_[c])]);
    });
  }
  const PlyProperty& property(int i) const { return element().properties[static_cast<std::size_t>(i)]; }

  void find_faces() {
    for (const char* name : {"face", "tristrips"}) {
      const int found = find_element(ply_, name);
      if (found < 0) continue;
      const PlyElement& e = ply_.elements[static_cast<std::size_t>(found)];
      int indices = find_property(e, "vertex_indices");
      if (indices < 0) indices = find_property(e, "vertex_index");
      if (indices < 0 && e.count == 0) continue;
      if (indices < 0 || !e.properties[static_cast<std::size_t>(indices)].list ||
          scalar_is_float(e.properties[static_cast<std::size_t>(indices)].type)) {
        throw InputError(file_.path().string() + ": the PLY element '" + name +
                         "' has no list of integers 'vertex_indices'");
      }
      if (faces_ && e.count == 0) continue;
      faces_ = static_cast<std::size_t>(found);
      indices_ = static_cast<std::size_t>(indices);
      strips_ = std::string(name) == "tristrips";
      synthetic_ = e.find("synthetic");
      if (synthetic_ >= 0 && e.properties[static_cast<std::size_t>(synthetic_)].list) synthetic_ = -1;
      header_.faces = strips_ ? 0 : e.count;
      if (e.count == 0) continue;
      for (std::size_t p = 0; p < e.properties.size(); ++p)
        if (static_cast<int>(p) != indices && static_cast<int>(p) != synthetic_)
          left_out_.push_back("'" + e.properties[p].name + "' of faces");
      return;
    }
    if (!faces_ && find_element(ply_, "face") < 0 && find_element(ply_, "tristrips") < 0) {
      throw InputError(file_.path().string() +
                       ": the PLY file holds points and no faces; a mesh is needed here");
    }
  }

  void add_vertex(VertexBatch& batch, const Values& values) const {
    const auto value = [&](int p) { return values[static_cast<std::size_t>(p)]; };
    std::uint32_t rgba = 0;
    if (header_.colour) {
      const auto byte = [&](std::size_t c) { return colours_.byte(value(rgba_[c])); };
      rgba = pack_rgba(byte(0), byte(1), byte(2), rgba_[3] < 0 ? 255 : alpha_byte(value(rgba_[3])));
    }
    batch.add({value(xyz_[0]), value(xyz_[1]), value(xyz_[2])}, rgba);
    if (confidence_ < 0 || !std::isfinite(value(confidence_))) return;
    confidence_sum_ += value(confidence_);
    ++confident_;
  }

  /// Alpha may be of another type than the colours.
  std::uint32_t alpha_byte(double alpha) const {
    if (property(rgba_[3]).type == property(rgba_[0]).type) return colours_.byte(alpha);
    return ColourRange(property(rgba_[3]).type).byte(alpha);
  }

  /// Takes the vertices out of records of fixed size.
  class VertexRecords {
   public:
    explicit VertexRecords(const PlyMeshReader& reader)
        : reader_(reader), wanted_(reader.xyz_.begin(), reader.xyz_.end()) {
      const PlyElement& e = reader.element();
      for (std::size_t p = 0; p < e.properties.size(); ++p) offsets_.push_back(e.offset(p));
      for (const int p : reader.rgba_) {
        if (reader.header_.colour && p >= 0) wanted_.push_back(p);
      }
      if (reader.confidence_ >= 0) wanted_.push_back(reader.confidence_);
      plain_ = !reader.ply_.big_endian() && !reader.header_.double_positions && wanted_.size() == 3;
      values_.resize(e.properties.size());
    }
    /// Where little endian floats of positions are all that is wanted.
    bool copy(const char* record, std::span<Double3> to) const {
      const std::size_t x = offset(wanted_[0]), y = offset(wanted_[1]), z = offset(wanted_[2]);
      const std::size_t stride = plain_ ? reader_.element().stride() : 0;
      for (std::size_t i = 0; plain_ && i < to.size(); ++i, record += stride)
        to[i] = {load_scalar<float>(record + x), load_scalar<float>(record + y),
                 load_scalar<float>(record + z)};
      return plain_;
    }
    void add(const char* record, std::uint64_t count, VertexBatch& batch) {
      const std::size_t stride = reader_.element().stride();
      for (std::uint64_t k = 0; k < count; ++k, record += stride) {
        if (plain_) {
          batch.add({load_scalar<float>(record + offset(wanted_[0])),
                     load_scalar<float>(record + offset(wanted_[1])),
                     load_scalar<float>(record + offset(wanted_[2]))});
          continue;
        }
        for (const int p : wanted_) {
          values_[static_cast<std::size_t>(p)] =
              load_double(reader_.property(p).type, reader_.ply_.big_endian(), record + offset(p));
        }
        reader_.add_vertex(batch, values_);
      }
    }

   private:
    std::size_t offset(int p) const { return offsets_[static_cast<std::size_t>(p)]; }

    const PlyMeshReader& reader_;
    std::vector<int> wanted_;
    std::vector<std::size_t> offsets_;
    bool plain_ = false;
    Values values_;
  };

  /// Hands out the properties of the first vertices.
  template <class F>
  void read_vertex_values(std::uint64_t count, F&& use) const {
    Values values(element().properties.size());
    if (ply_.encoding == PlyEncoding::kAscii) {
      TextScanner text = ascii_at(vertex_);
      read_ascii_elements(text, vertex_, count, values, nullptr, [&] { use(values); });
      return;
    }
    ByteWindow window = binary_at(vertex_);
    for (std::uint64_t i = 0; i < count; ++i) {
      read_binary_element(window, element(), values, nullptr);
      use(values);
    }
  }

  /// Vertices of fixed size.
  void read_vertex_records(VertexBatch& batch) {
    const std::size_t stride = element().stride();
    VertexRecords records(*this);
    ByteWindow window = binary_at(vertex_);
    for (std::uint64_t i = 0; i < element().count;) {
      const std::string_view bytes = window.peek(stride);
      const std::uint64_t count = std::min<std::uint64_t>(bytes.size() / stride, element().count - i);
      if (count == 0) truncated(at(window), element());
      records.add(bytes.data(), count, batch);
      window.skip(count * stride);
      i += count;
    }
  }

  /// Little endian faces of nothing but a byte count and 32-bit indices, as nearly all files have them. Stops
  /// at the first one that is no triangle; returns how many were read.
  std::uint64_t read_plain_triangles(ByteWindow& window, const PlyElement& faces, FaceBatch& batch,
                                     std::uint64_t first) const {
    const PlyProperty& list = faces.properties[0];
    constexpr std::size_t kBytes = 13;
    const bool is_signed = list.type == ScalarType::kInt32;
    if (scalar_bytes(list.count_type) != 1 || (!is_signed && list.type != ScalarType::kUint32)) return first;
    const auto index = [&](const char* p) {
      return is_signed ? static_cast<std::uint64_t>(load_scalar<std::int32_t>(p))
                       : load_scalar<std::uint32_t>(p);
    };
    for (std::uint64_t i = first; i < faces.count;) {
      const std::string_view bytes = window.peek(kBytes);
      const std::uint64_t capacity = std::min<std::uint64_t>(bytes.size() / kBytes, faces.count - i);
      std::uint64_t k = 0;
      for (; k < capacity && bytes[k * kBytes] == 3; ++k) {
        const char* p = bytes.data() + k * kBytes + 1;
        batch.triangle(index(p), index(p + 4), index(p + 8));
      }
      window.skip(k * kBytes);
      i += k;
      if (k < capacity || capacity == 0) return i;
    }
    return faces.count;
  }

  void read_binary_element(ByteWindow& window, const PlyElement& e, Values& values, Polygon* polygon) const {
    for (std::size_t p = 0; p < e.properties.size(); ++p) {
      const PlyProperty& prop = e.properties[p];
      const ScalarType first = prop.list ? prop.count_type : prop.type;
      const std::size_t width = scalar_bytes(first);
      const std::string_view bytes = window.peek(width);
      if (bytes.size() < width) truncated(at(window), e);
      if (!prop.list) {
        values[p] = load_double(first, ply_.big_endian(), bytes.data());
        window.skip(width);
        continue;
      }
      const std::uint64_t items = load_integer(first, ply_.big_endian(), bytes.data());
      const std::size_t item = scalar_bytes(prop.type);
      if (items > (window.remaining() - width) / item) {
        throw InputError(at(window) + ": a list '" + prop.name + "' of " + std::to_string(items) +
                         " items passes the end of the file; the file is truncated or damaged");
      }
      window.skip(width);
      if (polygon != nullptr && p == indices_) {
        read_indices(window, prop.type, items, *polygon);
      } else {
        window.skip(items * item);
      }
    }
  }

  void read_indices(ByteWindow& window, ScalarType type, std::uint64_t items, Polygon& polygon) const {
    const std::size_t width = scalar_bytes(type);
    polygon.begin();
    while (items > 0) {
      const std::uint64_t wanted = std::min<std::uint64_t>(items, kPiece / width);
      const std::string_view bytes = window.peek(wanted * width);
      if (bytes.size() < wanted * width) truncated(at(window), ply_.elements[*faces_]);
      for (std::uint64_t i = 0; i < wanted; ++i) {
        polygon.index(load_integer(type, ply_.big_endian(), bytes.data() + i * width));
      }
      window.skip(wanted * width);
      items -= wanted;
    }
    polygon.end();
  }

  /// Reads `count` elements of one kind, and counts the lines with more values than declared.
  template <class F>
  void read_ascii_elements(TextScanner& text, std::size_t index, std::uint64_t count, Values& values,
                           Polygon* polygon, F&& then) const {
    const PlyElement& e = ply_.elements[index];
    std::uint64_t surplus = 0;
    for (std::uint64_t i = 0; i < count && !e.properties.empty(); ++i) {
      while (text.line_done() && text.next_line()) {
      }
      const std::uint64_t line = text.line();
      read_ascii_element(text, e, values, polygon);
      if (text.line() == line && !text.line_done() && line_each()) {
        ++surplus;
        text.next_line();
      }
      then();
    }
    surplus_[index] = surplus;
  }

  /// Every element has a line of its own: there are as many lines. Asked only where one holds more than it should.
  bool line_each() const {
    if (!line_each_) {
      std::uint64_t elements = 0;
      for (const PlyElement& e : ply_.elements) {
        if (!e.properties.empty()) elements += std::min(e.count, file_.size());
      }
      TextScanner lines(file_, ply_.data_begin, 1, ply_.line_end, '\0');
      std::uint64_t found = 0;
      do {
        if (!lines.line_done()) ++found;
      } while (lines.next_line());
      line_each_ = found >= elements;
    }
    return *line_each_;
  }

  void read_ascii_element(TextScanner& text, const PlyElement& e, Values& values, Polygon* polygon) const {
    for (std::size_t p = 0; p < e.properties.size(); ++p) {
      const PlyProperty& prop = e.properties[p];
      if (!prop.list) {
        values[p] = text.number("a number");
        continue;
      }
      const std::uint64_t items = text.count("the length of a list");
      const bool indices = polygon != nullptr && p == indices_;
      if (indices) polygon->begin();
      for (std::uint64_t i = 0; i < items; ++i) {
        const double value = text.number("an item of a list");
        if (indices) polygon->index(index_of(text, value));
      }
      if (indices) polygon->end();
    }
  }
  static std::uint64_t index_of(const TextScanner& text, double value) {
    constexpr double kExact = 9007199254740992.0;  // 2^53
    if (value > -kExact && value < kExact) {
      const auto index = static_cast<std::int64_t>(value);
      if (static_cast<double>(index) == value) return static_cast<std::uint64_t>(index);
    }
    throw InputError(text.where() + ": a vertex index is no whole number");
  }

  /// At the first element of a kind: those before it are read past.
  ByteWindow binary_at(std::size_t index) const {
    ByteWindow window(file_, ply_.data_begin, file_.size(), ByteWindow::kDefaultCapacity, true);
    for (std::size_t i = 0; i < index; ++i) {
      const PlyElement& e = ply_.elements[i];
      if (skip_ply_elements(e, ply_.big_endian(), e.count, window) < e.count) truncated(at(window), e);
    }
    return window;
  }
  TextScanner ascii_at(std::size_t index) const {
    TextScanner text(file_, ply_.data_begin, ply_.lines + 1, ply_.line_end, '\0');
    for (std::size_t i = 0; i < index; ++i) {
      Values ignored(ply_.elements[i].properties.size());
      read_ascii_elements(text, i, ply_.elements[i].count, ignored, nullptr, [] {});
    }
    return text;
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  PlyHeader ply_;
  std::size_t vertex_ = 0;
  std::array<int, 3> xyz_ = {-1, -1, -1};
  std::array<int, 4> rgba_ = {-1, -1, -1, -1};
  std::optional<std::size_t> faces_;  ///< element of faces or strips; none in a mesh without faces
  std::size_t indices_ = 0;           ///< its list of vertex indices
  bool strips_ = false;
  int synthetic_ = -1;  ///< property of the faces
  std::optional<PlyRanges> ranges_;
  std::uint64_t first_face_ = 0;       ///< where reading faces begins
  int confidence_ = -1;                ///< of the vertices
  ColourRange colours_;                ///< known after a look at the first vertices
  std::vector<std::string> left_out_;  ///< properties that are read past
  PolygonFaces polygons_;
  mutable double confidence_sum_ = 0.0;
  mutable std::uint64_t confident_ = 0;  ///< vertices in the sum
  MeshHeader header_;
  std::string format_;
  mutable std::vector<std::uint64_t> surplus_;  ///< ascii: per element, lines with more values than declared
  mutable std::optional<bool> line_each_;  ///< ascii: every element has a line of its own, once it was asked
};

}  // namespace

std::unique_ptr<MeshReader> open_ply_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<PlyMeshReader>(std::move(file), options);
}

}  // namespace tessera
