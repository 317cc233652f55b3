#include "stream/formats/ply_scalar.h"

#include <algorithm>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/files/file_extension.h"

namespace tessera {
namespace {

constexpr std::size_t kBatchVertices = 16384;

double column_value(const char* at, ScalarType type, bool big_endian) {
  return visit_scalar_type(type, [&](auto kind) {
    using T = decltype(kind);
    return static_cast<double>(big_endian ? load_scalar<T, true>(at) : load_scalar<T>(at));
  });
}

}  // namespace

std::optional<PlyScalar> PlyScalar::open(const std::filesystem::path& path, std::string_view name) {
  if (lower_extension(path) != ".ply") return std::nullopt;
  PlyScalar out{ReadFile(path)};
  const PlyHeader header = read_ply_header(out.file_);
  if (header.encoding == PlyEncoding::kAscii || header.elements.empty()) return std::nullopt;
  const PlyElement& vertex = header.elements.front();
  if (vertex.name != "vertex" || vertex.has_list()) return std::nullopt;
  const std::array<std::string_view, 4> names = {"x", "y", "z", name};
  for (std::size_t k = 0; k < names.size(); ++k) {
    const int at = vertex.find(names[k]);
    if (at < 0) return std::nullopt;
    const auto index = static_cast<std::size_t>(at);
    out.columns_[k] = {vertex.properties[index].type, vertex.offset(index)};
  }
  out.begin_ = header.data_begin, out.count_ = vertex.count, out.stride_ = vertex.stride();
  out.big_endian_ = header.big_endian();
  const int face = header.find("face");
  out.has_faces_ = face >= 0 && header.elements[static_cast<std::size_t>(face)].count > 0;
  if (out.count_ > (out.file_.size() - out.begin_) / out.stride_)
    throw InputError(path.string() + ": ends within the " + std::to_string(out.count_) +
                     " vertices that its header declares");
  return out;
}

void PlyScalar::read(
    const std::function<void(std::span<const Double3>, std::span<const double>)>& sink) const {
  std::vector<char> bytes(kBatchVertices * stride_);
  std::vector<Double3> positions;
  std::vector<double> values;
  for (std::uint64_t first = 0; first < count_; first += kBatchVertices) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kBatchVertices, count_ - first));
    file_.read_at(begin_ + first * stride_, bytes.data(), count * stride_);
    positions.clear(), values.clear();
    for (std::size_t i = 0; i < count; ++i) {
      const char* record = bytes.data() + i * stride_;
      const auto column = [&](std::size_t k) {
        return column_value(record + columns_[k].offset, columns_[k].type, big_endian_);
      };
      positions.push_back({column(0), column(1), column(2)});
      values.push_back(column(3));
    }
    sink(positions, values);
  }
}

}  // namespace tessera
