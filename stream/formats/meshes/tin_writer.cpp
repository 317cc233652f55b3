#include "stream/formats/meshes/tin_writer.h"

#include <charconv>
#include <cmath>

#include "octree/error.h"
#include "stream/files/file_extension.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTinStoreBytes = std::uint64_t{64}
                                         << 20;  // 2.8 million vertices never touch the disk
constexpr std::size_t kTinTextBytes = std::size_t{1} << 18;
/// Outside of these the digits of plain decimals would be zeros for the most part.
constexpr double kPlainLow = 1e-9, kPlainHigh = 1e15;

}  // namespace

TinWriter::TinWriter(const std::filesystem::path& path, const MeshHeader& header)
    : MeshWriterBase(path, header, false),
      store_(path.has_parent_path() ? path.parent_path() : ".", true, kTinStoreBytes) {}

void TinWriter::put(double value) {
  char digits[64];
  const double size = std::abs(value);
  const bool plain = size == 0.0 || (size >= kPlainLow && size < kPlainHigh);
  // Readers of CAD programs know plain decimals best. Minus zero is zero.
  const auto end = std::to_chars(digits, digits + sizeof digits, value == 0.0 ? 0.0 : value,
                                 plain ? std::chars_format::fixed : std::chars_format::scientific)
                       .ptr;
  text_.append(digits, end);
}

void TinWriter::put(std::uint64_t value) {
  char digits[24];
  text_.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

void TinWriter::flush_if_long() {
  if (text_.size() >= kTinTextBytes) flush();
}

void TinWriter::flush() {
  file_.append(text_);
  text_.clear();
}

void TinWriter::remember(std::span<const Double3> positions) {
  for (const Double3& p : positions) {
    if (!(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])))
      throw InputError(
          file_.path().string() + ": vertex " + std::to_string(remembered_) +
          " is not finite, which CAD programs do not read; clean the mesh first, as tessera decimate does");
    ++remembered_;
  }
  store_.append(positions);
}

bool is_tin_file(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".xml" || extension == ".dxf";
}

std::unique_ptr<TinWriter> create_tin_file(const std::filesystem::path& path, const MeshHeader& header,
                                           const TinSettings& settings) {
  return lower_extension(path) == ".xml" ? create_landxml_tin(path, header, settings)
                                         : create_dxf_tin(path, header, settings);
}

}  // namespace tessera
