/// \file point_inputs.h
/// The scans of a job behind one door: their slices in tasks of even size, and the one table of sensors.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "stream/formats/points/point_source.h"
#include "stream/points/point_filter.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage.h"

namespace tessera {

class PointInputs {
 public:
  /// \param task_bytes  input bytes that one task reads, about, at most; grows for huge inputs so that tasks stay below
  ///                    about 400. Changes no result.
  /// \throws UsageError  no file, or classes or returns wanted that no file tells; InputError  more than 65534
  /// different sensor origins
  /// \param notes  sentences that notices() begins with
  PointInputs(std::vector<std::unique_ptr<PointFile>> files, const ReconstructOptions& options,
              std::uint64_t task_bytes = std::uint64_t{32} << 20, std::vector<std::string> notes = {});

  std::size_t file_count() const { return files_.size(); }
  const PointFile& file(std::size_t i) const { return *files_[i]; }
  /// Whether the pass "unpack" has anything to do: some input is packed, or all are to be thinned.
  bool has_packed() const;
  std::uint64_t bytes() const { return bytes_; }
  std::uint64_t declared_points() const;
  /// Points by the headers, as far as they can be believed, of files whose points all stand for returns; 0 where options
  /// leave points out, for nobody knows how many.
  std::uint64_t expected_points() const;
  bool has_colour() const;
  bool has_grid_normals() const;
  /// The one that the files name; unknown where none does.
  const Crs& crs() const { return crs_; }
  /// What was decided about the inputs, and FileNotices of them; `read` follows, what reading them found.
  std::vector<std::string> notices(const std::vector<std::string>& read) const {
    std::vector<std::string> all = notices_;
    all.insert(all.end(), read.begin(), read.end());
    return all;
  }

  /// Tasks that read the whole input once: consecutive slices, about even in bytes.
  std::size_t task_count() const { return tasks_.size(); }
  std::span<const InputSlice> task(std::size_t k) const { return tasks_[k]; }
  std::uint64_t task_input_bytes(std::size_t k) const;
  /// Whether task k reads what was unpacked, or thinned.
  bool is_packed(std::size_t k) const;

  /// Buckets of cubes that points are dealt to, to be thinned; 0 = all stay.
  std::size_t thin_buckets() const { return thin_buckets_; }
  /// From now on packed tasks read what the pass "unpack" has left in this work directory; where points are thinned, the
  /// tasks are the buckets that "thin" has left.
  void read_unpacked_of(const std::filesystem::path& work, bool colours);
  /// Bytes of the file in the work directory that task k reads, 0 = it reads inputs.
  std::uint64_t unpacked_bytes(std::size_t k) const;
  /// The file of task k, or of bucket k, relative to the work directory.
  static std::string unpacked_file(std::size_t k);
  static std::string thinned_file(std::size_t k);

  /// Sensor origins of all files and of --viewpoint: ascending, no repeats, so that ids follow from the set
  /// alone.
  const std::vector<Double3>& sensors() const { return sensors_; }
  /// Sensor ids of a chunk of file `file`. A point keeps its file's own sensor; else, of the viewpoints
  /// given: the only one; the one of its file, if there are as many as files; else the nearest.
  void sensor_ids(std::uint32_t file, const PointChunk& chunk, std::vector<std::uint16_t>& ids) const;

  /// Streams the slices of task k, without the points that are not wanted. Reports progress in input
  /// bytes when `in_bytes`, else in points; checks for a stop between chunks. Returns the summed fates.
  ReadCounts read(std::size_t k, TaskContext& context, bool in_bytes,
                  const std::function<void(std::uint32_t file, const PointChunk&)>& sink) const;

  /// \throws EmptyError  where classes, returns, bounds and polygons leave none of the points read
  void require_wanted(std::uint64_t read, std::uint64_t left_out) const {
    filter_.require_wanted(read, left_out);
  }

  /// Memory that reading one task takes, at most.
  static constexpr std::uint64_t kReadBytes = std::uint64_t{12} << 20;

 private:
  ReadCounts read_unpacked_task(std::size_t k, TaskContext& context, bool in_bytes,
                                const std::function<void(std::uint32_t, const PointChunk&)>& sink) const;
  std::uint16_t id_of(const Double3& origin) const;
  /// \throws InputError naming two files of different systems
  void require_one_crs();

  std::vector<std::unique_ptr<PointFile>> files_;
  std::filesystem::path unpacked_of_;  ///< work directory; empty = packed inputs are unpacked anew
  bool unpacked_colours_ = true;
  std::size_t thin_buckets_ = 0;
  PointFilter filter_;
  std::vector<std::vector<InputSlice>> tasks_;
  std::vector<Double3> sensors_;
  std::vector<std::vector<std::uint16_t>> file_sensors_;  ///< per file: its sensor index -> id
  std::vector<std::uint16_t> viewpoints_;                 ///< ids of the viewpoints, in the order given
  std::uint64_t bytes_ = 0;
  Crs crs_;
  std::vector<std::string> notices_;
};

/// {name, wkt, epsg, epsg_vertical}, without what is not known; null for an unknown system.
Json to_json(const Crs& crs);

/// Opens the inputs of a job, packed ones as unpacked by then. \param colours  ReadOptions::colours
/// \throws InputError as open_point_file
std::shared_ptr<const PointInputs> open_point_inputs(const JobState& job, bool colours);
/// Opens them as they are. \param unpacked  ReadOptions::unpacked: their points are not read
std::shared_ptr<const PointInputs> open_packed_inputs(const JobState& job, bool unpacked);

}  // namespace tessera
