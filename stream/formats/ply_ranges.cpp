#include "stream/formats/ply_ranges.h"

#include <algorithm>

#include "stream/formats/scalar.h"

namespace tessera {
namespace {

void read_ply_records(const ReadFile& file, std::uint64_t first, std::size_t record, std::uint64_t begin,
                      std::uint64_t end, std::vector<char>& bytes) {
  bytes.resize((end - begin) * record);
  file.read_at(first + begin * record, bytes.data(), bytes.size());
  file.release(first + begin * record, bytes.size());
  file.require_unchanged();
}

}  // namespace

std::optional<PlyRanges> PlyRanges::find(const PlyHeader& header, const ReadFile& file, std::size_t vertex,
                                         std::size_t faces, std::size_t indices, int synthetic) {
  if (header.encoding == PlyEncoding::kAscii || !file.packed().empty() || faces < vertex) return {};
  PlyRanges ranges;
  std::uint64_t at = header.data_begin;
  for (std::size_t i = 0; i < faces; ++i) {
    const PlyElement& e = header.elements[i];
    if (e.has_list() || e.properties.empty() || e.count > (file.size() - at) / e.stride()) return {};
    if (i == vertex) {
      ranges.vertex_begin_ = at;
      ranges.vertex_bytes_ = e.stride();
    }
    at += e.count * e.stride();
  }
  ranges.face_begin_ = at;
  ranges.big_endian_ = header.big_endian();
  const PlyElement& face = header.elements[faces];
  for (std::size_t p = 0; p < face.properties.size(); ++p) {
    const PlyProperty& prop = face.properties[p];
    if (prop.list && p != indices) return {};
    if (p == indices) {
      ranges.list_at_ = ranges.triangle_bytes_;
      ranges.count_type_ = prop.count_type;
      ranges.index_type_ = prop.type;
    }
    if (static_cast<int>(p) == synthetic) {
      ranges.synthetic_at_ = ranges.triangle_bytes_;
      ranges.synthetic_type_ = prop.type;
    }
    ranges.triangle_bytes_ +=
        prop.list ? scalar_bytes(prop.count_type) + 3 * scalar_bytes(prop.type) : scalar_bytes(prop.type);
  }
  return ranges;
}

void PlyRanges::read_vertices(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                              std::vector<char>& bytes) const {
  read_ply_records(file, vertex_begin_, vertex_bytes_, begin, end, bytes);
}

std::uint64_t PlyRanges::read_triangles(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                                        MeshFacePart& part) const {
  part.synthetic.clear();
  end = std::max(begin, std::min(end, (file.size() - face_begin_) / triangle_bytes_));
  part.faces.resize(end - begin);
  if (begin == end) return begin;
  read_ply_records(file, face_begin_, triangle_bytes_, begin, end, part.bytes);
  const std::size_t first = list_at_ + scalar_bytes(count_type_), width = scalar_bytes(index_type_);
  const bool plain = !big_endian_ && index_type_ == ScalarType::kUint32;
  const bool small = scalar_bytes(count_type_) == 1;
  const char* at = part.bytes.data();
  std::size_t count = 0;
  for (MeshFace& face : part.faces) {
    if (small ? at[list_at_] != 3 : load_integer(count_type_, big_endian_, at + list_at_) != 3) break;
    for (std::size_t c = 0; c < 3; ++c)
      face[c] = plain ? load_scalar<std::uint32_t>(at + first + 4 * c)
                      : load_integer(index_type_, big_endian_, at + first + width * c);
    if (synthetic_type_)
      part.synthetic.push_back(load_double(*synthetic_type_, big_endian_, at + synthetic_at_) != 0.0);
    at += triangle_bytes_;
    ++count;
  }
  part.faces.resize(count);
  return begin + count;
}

}  // namespace tessera
