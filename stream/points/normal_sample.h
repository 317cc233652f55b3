/// \file normal_sample.h
/// Small complete pieces of a scan with given normals, from which their agreement is measured. Which pieces depends on the
/// points alone; samples of tasks merge to the sample of the whole.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <vector>

#include "kernels/points/normal_agreement.h"
#include "stream/files/json.h"
#include "stream/points/point_sample.h"

namespace tessera {

/// Cells of 3 h, turned so that no wall lies along them, with the smallest hashes of their places; of each the points with the
/// smallest hashes, 64 at most. Cells have the class of the 4^3 around them (CellSampler), so that most points of a large scan
/// are passed over by a look at that one.
class NormalSampler {
 public:
  /// \param points  as in LayeredSampler
  explicit NormalSampler(std::uint64_t points = 0)
      : threshold_(CellSampler::threshold_of(max_sampled_share(kLimit, points))) {}
  /// Of points in quanta those whose normal is finite and not zero. \param p, n  an axis each   \return how many these are
  std::uint64_t add(const std::array<std::span<const double>, 3>& p,
                    const std::array<std::span<const float>, 3>& n);
  /// Of all that was added and merged. The sampler is spent.
  NormalAgreement measure();

  /// \returns bytes written
  std::uint64_t save(const std::filesystem::path& file);
  /// Adds what another sampler saved.
  void merge(const std::filesystem::path& file);
  static constexpr std::uint64_t kBytes = std::uint64_t{8} << 20;  ///< memory of a sampler

 private:
  static constexpr double kCell = 3.0 * 1024.0;
  static constexpr std::size_t kLimit = std::size_t{1} << 15, kOfCell = 64;
  struct Entry {
    std::uint64_t cell = 0, point = 0;  ///< hashes
    Double3 p{};
    Float3 n{};
    std::uint32_t unused = 0;  ///< no byte of the file is left to chance
  };
  void push(const Double3& p, const Float3& n);
  void shrink();  ///< to one and a half times the limit at most
  void sort();    ///< to the sample itself, by cell

  static constexpr std::int64_t kNoCell = std::numeric_limits<std::int64_t>::min();
  CellSampler::CellIndex cell_ = {kNoCell, kNoCell, kNoCell};  ///< that the last point lay in
  std::uint64_t hash_ = 0;                                     ///< its
  std::uint64_t threshold_;
  std::vector<Entry> entries_;
};

/// What the survey measured, beside its plan: a function of the points and h alone.
inline constexpr const char* kAgreementFile = "agreement.json";
/// {pairs, against, cells, split}
void save_agreement(const std::filesystem::path& file, const NormalAgreement& agreement);
/// That of a work directory. \throws InputError naming the file when it is missing or damaged
NormalAgreement agreement_of_work(const std::filesystem::path& work);
/// The same for forecasts, which are also made of a plan alone: empty where there is none.
NormalAgreement agreement_where_measured(const std::filesystem::path& work);

}  // namespace tessera
