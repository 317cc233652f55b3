/// \file class_writer.h
/// The last pass over a scan whose ground is known: a copy of the file with the classes of its points.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>

#include "kernels/points/height_classes.h"
#include "stream/formats/points/las_records.h"
#include "stream/survey/ground_tiles.h"
#include "stream/survey/lowest_heights.h"

namespace tessera {

struct ClassifiedScan {
  std::filesystem::path input, output;
  std::uint64_t points = 0, bytes = 0;
  std::uint64_t kept = 0;                    ///< set aside: their class is what it was
  std::array<std::uint64_t, 256> classes{};  ///< of the others
};

class ClassWriter {
 public:
  /// \param heights  in steps of `cells` \param all  records that are set aside too
  ClassWriter(const ScanCells& cells, GroundTiles& ground, const HeightClasses& heights, bool all)
      : cells_(cells), ground_(ground), heights_(heights), all_(all) {}

  /// On the threads of the enclosing pool, with so many batches on their way.
  ClassifiedScan write(const LasRecords& scan, const std::filesystem::path& to, std::size_t slots,
                       int threads);

  /// Memory of a record on its way, beside itself.
  static constexpr std::uint64_t kPlacedBytes = 12;

 private:
  struct Placed {
    TileKey tile;
    std::uint32_t index = 0;
  };
  static_assert(sizeof(Placed) == kPlacedBytes);
  template <class Copy>
  ClassifiedScan write_to(Copy& copy, const LasRecords& scan, const std::filesystem::path& to,
                          std::size_t slots);
  void place(const LasRecords& scan, const LasBatch& batch, std::vector<Placed>& out) const;
  std::uint8_t class_of(const LasRecords& scan, const char* record);

  const ScanCells& cells_;
  GroundTiles& ground_;
  HeightClasses heights_;
  bool all_;
};

}  // namespace tessera
