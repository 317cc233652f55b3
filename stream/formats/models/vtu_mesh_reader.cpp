/// VTK's XML format for unstructured grids: one piece whose arrays lie raw and unpacked behind the XML. Triangles, quads and polygons
/// are read, other cells are counted.
#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <vector>

#include "stream/formats/byte_window.h"
#include "stream/formats/colour_range.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/xml_events.h"

namespace tessera {
namespace {

constexpr const char* kSaveRaw = "; save it with appended raw data and without compression";

/// An array that the XML tells of, by the element that it stands in.
struct VtuArray {
  std::string type;
  std::uint64_t offset = 0, components = 1;
  std::uint64_t begin = 0, bytes = 0;  ///< in the file, once they are known
};

class VtuHead : public XmlEvents {
 public:
  using XmlEvents::XmlEvents;
  std::uint64_t points = 0, cells = 0;
  std::size_t size_bytes = 4;  ///< of the number before every array
  std::optional<VtuArray> positions, connectivity, offsets, types, rgba, synthetic;
  bool left_out = false;  ///< other arrays of points and cells
  /// Offset in the document behind the tag <AppendedData>; 0: there was none.
  std::uint64_t data = 0;

 private:
  void start(std::string_view name, Attributes a) override {
    const auto is = [&](const char* key, std::string_view value) {
      const char* const found = attribute(a, key);
      return found != nullptr && value == found;
    };
    if (depth_++ == 0) {
      if (name != "VTKFile" || !is("type", "UnstructuredGrid"))
        fail("no unstructured grid of VTK; only those are read (.vtu)");
      if (!is("byte_order", "LittleEndian"))
        fail("its bytes are not little endian, the only order that is read");
      if (attribute(a, "compressor") != nullptr) fail(std::string("its arrays are compressed") + kSaveRaw);
      if (is("header_type", "UInt64")) size_bytes = 8;
    } else if (name == "Piece") {
      if (++pieces_ > 1) fail("more than one piece; save it as one");
      points = count(a, "NumberOfPoints"), cells = count(a, "NumberOfCells");
    } else if (name == "DataArray") {
      take(a);
    } else if (name == "AppendedData") {
      if (!is("encoding", "raw")) fail(std::string("its data are encoded as text") + kSaveRaw);
      data = offset();
      stop();
    }
    if (name != "DataArray") inside_ = name;
  }
  void end(std::string_view) override { --depth_; }

  void take(Attributes a) {
    const char *const type = attribute(a, "type"), *const called = attribute(a, "Name"),
                      *const format = attribute(a, "format");
    const std::string name = called != nullptr ? called : "";
    std::optional<VtuArray>* to = nullptr;
    if (inside_ == "Points") to = &positions;
    if (inside_ == "Cells" && name == "connectivity") to = &connectivity;
    if (inside_ == "Cells" && name == "offsets") to = &offsets;
    if (inside_ == "Cells" && name == "types") to = &types;
    if (inside_ == "PointData" && name == "rgba") to = &rgba;
    if (inside_ == "CellData" && name == "synthetic") to = &synthetic;
    if (to == nullptr) {
      left_out = left_out || inside_ == "PointData" || inside_ == "CellData";
      return;
    }
    if (format == nullptr || std::string_view(format) != "appended")
      fail("the array '" + name.substr(0, 40) + "' stands in the XML itself" + kSaveRaw);
    *to = VtuArray{type != nullptr ? type : "", count(a, "offset"), 1, 0, 0};
    if (attribute(a, "NumberOfComponents") != nullptr) (*to)->components = count(a, "NumberOfComponents");
  }
  std::uint64_t count(Attributes a, const char* name) const {
    const char* const value = attribute(a, name);
    const std::string_view word = value != nullptr ? value : "";
    std::uint64_t n = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), n);
    if (error != std::errc() || end != word.data() + word.size() || n > std::uint64_t{1} << 48)
      fail(std::string("an element without a whole number as its ") + name);
    return n;
  }

  int depth_ = 0, pieces_ = 0;
  std::string inside_;
};

/// Whole numbers of an array, in order.
class VtuNumbers {
 public:
  VtuNumbers(const ReadFile& file, const VtuArray& array, std::size_t bytes)
      : window_(file, array.begin, array.begin + array.bytes, std::size_t{1} << 18, true), bytes_(bytes) {}
  std::uint64_t next() {
    const char* const p = window_.peek(bytes_).data();
    const std::uint64_t value = bytes_ == 8   ? load_scalar<std::uint64_t>(p)
                                : bytes_ == 4 ? load_scalar<std::uint32_t>(p)
                                              : static_cast<std::uint8_t>(*p);
    window_.skip(bytes_);
    return value;
  }

 private:
  ByteWindow window_;
  std::size_t bytes_;
};

std::size_t whole_bytes(const std::string& type) {
  if (type == "Int64" || type == "UInt64") return 8;
  if (type == "Int32" || type == "UInt32") return 4;
  return type == "UInt8" || type == "Int8" ? 1 : 0;
}

class VtuMeshReader : public MeshReader {
 public:
  VtuMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)),
        options_(options),
        head_(file_.path().string()),
        polygons_([this](const VertexSink& sink) { read_vertices(sink); }, options.temp) {
    read_head();
    for (std::optional<VtuArray>* array :
         {&head_.positions, &head_.connectivity, &head_.offsets, &head_.types, &head_.rgba, &head_.synthetic})
      if (*array) locate(**array);
    check();
    header_.vertices = head_.points;
    header_.faces = head_.cells;
    header_.double_positions = head_.positions->type == "Float64";
    header_.colour = head_.rgba.has_value();
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }
  bool has_synthetic() const override { return head_.synthetic.has_value(); }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, header_.colour);
    const std::size_t bytes = header_.double_positions ? 8 : 4;
    ByteWindow window(file_, head_.positions->begin, head_.positions->begin + head_.positions->bytes,
                      ByteWindow::kDefaultCapacity, true);
    std::optional<VtuNumbers> colours;
    if (head_.rgba) colours.emplace(file_, *head_.rgba, 4);
    for (std::uint64_t v = 0; v < head_.points; ++v) {
      const char* const p = window.peek(3 * bytes).data();
      Double3 position;
      for (std::size_t k = 0; k < 3; ++k)
        position[k] =
            header_.double_positions ? load_scalar<double>(p + 8 * k) : double{load_scalar<float>(p + 4 * k)};
      batch.add(position, colours ? static_cast<std::uint32_t>(colours->next()) : 0);
      window.skip(3 * bytes);
    }
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override { faces(sink, {}); }
  void read_flagged_faces(
      const std::function<void(std::span<const MeshFace>, std::span<const std::uint8_t>)>& sink) override {
    if (!has_synthetic()) return read_faces([&](std::span<const MeshFace> f) { sink(f, {}); });
    // One flag for every triangle of a cell: batches are handed on cell by cell, and gathered here.
    std::vector<MeshFace> some;
    std::vector<std::uint8_t> flags;
    const auto flush = [&] {
      if (!some.empty()) sink(some, flags);
      some.clear(), flags.clear();
    };
    faces([&](std::span<const MeshFace> f) { some.insert(some.end(), f.begin(), f.end()); },
          [&](std::uint8_t flag) {
            flags.resize(some.size(), flag);
            if (some.size() >= 8192) flush();
          });
    flush();
  }

  std::vector<std::string> warnings() const override {
    std::vector<std::string> all;
    if (head_.left_out) all = list_left_out({"arrays of points and cells other than rgba and synthetic"});
    if (others_ > 0) all.push_back(std::to_string(others_) + " cells that are no faces are left out");
    if (const std::string folded = polygons_.warning(); !folded.empty()) all.push_back(folded);
    return all;
  }

 private:
  [[noreturn]] void fail(std::uint64_t at, const std::string& what) const {
    throw InputError(file_.path().string() + ": byte " + std::to_string(at) + ": " + what);
  }

  void read_head() {
    ByteWindow window(file_, 0, file_.size(), std::size_t{1} << 16);
    while (window.remaining() > 0) {
      const std::string_view bytes = window.peek(1);
      if (!head_.feed(bytes)) break;
      window.skip(bytes.size());
    }
    if (head_.data == 0) {
      head_.finish();
      fail(file_.size(), std::string("it has no appended data") + kSaveRaw);
    }
    // Behind the tag: white space, an underscore, and the arrays.
    std::string text(static_cast<std::size_t>(std::min<std::uint64_t>(file_.size() - head_.data, 4096)),
                     '\0');
    file_.read_at(head_.data, text.data(), text.size());
    const std::size_t mark = text.find('_', std::min(text.find('>'), text.size()));
    if (mark == std::string::npos) fail(head_.data, "no underscore stands before its data; it is damaged");
    head_.data += mark + 1;
    if (!head_.positions || !head_.connectivity || !head_.offsets || !head_.types)
      fail(head_.data, "an array of points, connectivity, offsets or types is missing");
  }

  void locate(VtuArray& array) const {
    const std::uint64_t left = file_.size() - head_.data;
    if (array.offset > left || left - array.offset < head_.size_bytes)
      fail(head_.data, "an array begins beyond the end of the file, which is cut off or damaged");
    char size[8] = {};
    file_.read_at(head_.data + array.offset, size, head_.size_bytes);
    array.begin = head_.data + array.offset + head_.size_bytes;
    array.bytes = load_scalar<std::uint64_t>(size);
    if (array.bytes > file_.size() - array.begin)
      fail(array.begin, "an array of " + std::to_string(array.bytes) +
                            " bytes ends beyond the end of the file, which is cut off or damaged");
  }

  void check() const {
    const VtuArray& p = *head_.positions;
    const std::uint64_t real = p.type == "Float64" ? 8 : p.type == "Float32" ? 4 : 0;
    if (real == 0 || p.components != 3) fail(p.begin, "its points are not three floats or doubles each");
    require(p, head_.points, 3 * real);
    for (const VtuArray* a : {&*head_.connectivity, &*head_.offsets})
      if (whole_bytes(a->type) < 4) fail(a->begin, "its cells are not of whole numbers of 32 or 64 bits");
    if (whole_bytes(head_.types->type) != 1) fail(head_.types->begin, "its types are not bytes");
    require(*head_.offsets, head_.cells, whole_bytes(head_.offsets->type));
    require(*head_.types, head_.cells, 1);
    if (head_.rgba && (head_.rgba->type != "UInt8" || head_.rgba->components != 4))
      fail(head_.rgba->begin, "its colours are not four bytes each");
    if (head_.rgba) require(*head_.rgba, head_.points, 4);
    if (head_.synthetic && head_.synthetic->type != "UInt8")
      fail(head_.synthetic->begin, "its flags are not bytes");
    if (head_.synthetic) require(*head_.synthetic, head_.cells, 1);
  }
  void require(const VtuArray& array, std::uint64_t count, std::uint64_t bytes) const {
    if (array.bytes < count * bytes)
      fail(array.begin, "an array has " + std::to_string(array.bytes) + " bytes where " +
                            std::to_string(count * bytes) + " are needed");
  }

  /// \param cell_done  may be empty; after each cell, with what the cell says of itself, once its triangles were handed on
  void faces(const FaceSink& sink, const std::function<void(std::uint8_t)>& cell_done) {
    std::uint64_t cell = 0;
    FaceBatch batch(
        sink, options_, head_.points,
        [&] { return file_.path().string() + ": cell " + std::to_string(cell); }, &polygons_);
    const std::size_t corner_bytes = whole_bytes(head_.connectivity->type);
    const std::uint64_t corners = head_.connectivity->bytes / corner_bytes;
    VtuNumbers connectivity(file_, *head_.connectivity, corner_bytes),
        offsets(file_, *head_.offsets, whole_bytes(head_.offsets->type)), types(file_, *head_.types, 1);
    std::optional<VtuNumbers> flags;
    if (cell_done && head_.synthetic) flags.emplace(file_, *head_.synthetic, 1);
    std::uint64_t at = 0;
    others_ = 0;
    for (; cell < head_.cells; ++cell) {
      const std::uint64_t end = offsets.next(), type = types.next();
      if (end < at || end > corners)
        fail(head_.offsets->begin, "cell " + std::to_string(cell) + " ends at corner " + std::to_string(end) +
                                       ", but the one before at " + std::to_string(at) + " and all at " +
                                       std::to_string(corners));
      const bool face = (type == 5 && end - at == 3) || (type == 9 && end - at == 4) || type == 7;
      if (face) {
        batch.begin_polygon();
        for (; at < end; ++at) batch.corner(connectivity.next());
        batch.end_polygon();
      } else {
        for (; at < end; ++at) connectivity.next();
        ++others_;
      }
      if (!cell_done) continue;
      batch.flush();
      cell_done(flags ? static_cast<std::uint8_t>(flags->next()) : std::uint8_t{0});
    }
    batch.flush();
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  VtuHead head_;
  MeshHeader header_;
  const std::string format_ = "VTU";
  PolygonFaces polygons_;
  std::uint64_t others_ = 0;
};

}  // namespace

std::unique_ptr<MeshReader> open_vtu_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<VtuMeshReader>(std::move(file), options);
}

}  // namespace tessera
